"""The files of what a log has told: each says what was identified, and its printed error is that of itself."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest
from conftest import Finished
from scipy import signal
from swinging import log_of, swinging_arm

from metaid.models import Array
from metaid.models.tree import joint_torque
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import LogRun, RecordedResult, estimate

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]
ZEROS = np.array([0.0, 0.03, -0.04])  # rad
DAMPING, DRY = np.array([0.5, 0.3, 0.2]), np.array([0.4, 0.3, 0.2])


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of an arm with friction, all of whose parameters are a tenth more than the shipped one's."""
    arm = swinging_arm()
    record = log_of(
        arm.with_parameters(1.1 * arm.parameters),
        extra=lambda speeds: DAMPING * speeds + DRY * np.sign(speeds),
        seconds=4.0,
    )
    path = tmp_path_factory.mktemp("arm") / "log.csv"
    frame_of(record).to_csv(path, index=False)
    return path


def frame_of(record: LogRun) -> pd.DataFrame:
    """With the columns that metaid reads."""
    columns = {"time": record.times}
    for kind, values in (("angle", record.angles), ("torque", record.torques)):
        columns |= {f"{kind}_{joint + 1}": values[:, joint] for joint in range(record.njoint)}
    return pd.DataFrame(columns)


@pytest.fixture(scope="module")
def found(log: Path) -> RecordedResult:
    """What it says."""
    return estimate(log, "spatial-three-link", friction=["viscous", "coulomb"])


def test_all_of_the_posterior_mean_is_in_the_file(found: RecordedResult) -> None:
    """No number is replaced by its nominal value, whether it is determined or not."""
    law = found.model.dynamics.law
    random = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 20, 3))
    expected = found.estimate.model.regressor(*random) @ found.estimate.values
    ours = np.array([law.inverse_dynamics(*state) for state in zip(*random, strict=True)])
    np.testing.assert_allclose(ours, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("suffix", [".py", ".h", ".xml", ".urdf"])
def test_printed_error_of_a_file_is_what_a_stranger_measures(
    metaid: Metaid, log: Path, found: RecordedResult, suffix: str
) -> None:
    """Within 2 % of itself, on the same rows, by a script that shares no code with metaid (MuJoCo, scipy)."""
    if suffix == ".h" and shutil.which("cc") is None:
        pytest.skip("there is no C compiler")
    given = (str(log), "--nominal", "spatial-three-link", "--friction", "viscous,coulomb")
    done = metaid("estimate", *given, "-o", f"arm{suffix}", "--json")
    shown = json.loads(done.out)
    printed = shown["files"][0]["relative"]
    assert done.status == 0
    assert shown["verdict"] in ("found", "approximate")
    table = pd.read_csv(log)
    period, cutoff = 0.004, shown["window"]["cutoff_hz"]
    times = np.arange(table["time"].iloc[0], table["time"].iloc[-1], period)
    raw = float(np.median(np.diff(table["time"])))
    angles = signal.sosfiltfilt(
        signal.butter(4, 20.0 * 2.0 * raw, output="sos"), table[["angle_1", "angle_2", "angle_3"]].to_numpy(), axis=0
    )
    q = np.stack([np.interp(times, table["time"], column) for column in angles.T], axis=1)
    v = np.gradient(q, period, axis=0)
    a = np.gradient(v, period, axis=0)
    sent = np.stack(
        [np.interp(times - 0.5 * raw, table["time"], table[f"torque_{i}"]) for i in (1, 2, 3)], axis=1
    )  # each holds until the next
    predicted = predicted_by(Path(f"arm{suffix}"), q, v, a)
    low = signal.butter(4, cutoff * 2.0 * period, output="sos")
    sent, predicted = (signal.sosfiltfilt(low, each, axis=0) for each in (sent, predicted))
    rows = (times > times[0] + 0.2) & (times < times[-1] - 0.2)
    measured = np.linalg.norm((sent - predicted)[rows]) / np.linalg.norm(sent[rows])
    assert printed == pytest.approx(measured, rel=0.02, abs=2e-4)


def run_with(zeros: Array, seed: int) -> LogRun:
    """A log of an arm a tenth heavier than the shipped one, whose encoders have these zeros."""
    arm = swinging_arm()
    record = log_of(arm.with_parameters(1.1 * arm.parameters), noise=1e-5, seconds=4.0, seed=seed)
    return replace(record, name=f"run{seed}", angles=record.angles - zeros)


@pytest.fixture(scope="module")
def shared() -> RecordedResult:
    """What logs say whose encoders are all off by the same."""
    frames = [frame_of(run_with(ZEROS, seed)) for seed in range(2)]
    return estimate(frames, "spatial-three-link", friction=["viscous"])


@pytest.mark.parametrize(("suffix", "share"), [(".py", 0.005), (".xml", 0.005), (".urdf", 0.01)])
def test_file_has_the_zeros_that_all_logs_share(
    shared: RecordedResult, suffix: str, share: float, tmp_path: Path
) -> None:
    """At what the encoders of the next log read it predicts the true torque, though nobody tells it their zeros; a URDF
    without rotors.
    """
    arm = swinging_arm()
    heavier = arm.with_parameters(1.1 * arm.parameters)
    q, v, a = np.random.default_rng(2).uniform(-1.0, 1.0, (3, 50, 3))
    shared.model.write(tmp_path / f"arm{suffix}")
    true = joint_torque(heavier, q, v, a)
    predicted = predicted_by(tmp_path / f"arm{suffix}", q - ZEROS, v, a)
    assert np.linalg.norm(predicted - true) < share * np.linalg.norm(true)
    assert np.abs(shared.estimate.zeros).max() < 2e-3
    assert any("zeros of encoders that all logs share" in each for each in shared.nominal_repairs)


def test_file_has_no_zeros_that_are_of_each_log() -> None:
    """What both share of the last joint the prior alone tells from a link that is turned by as much."""
    frames = [frame_of(run_with(zeros, seed)) for seed, zeros in enumerate((ZEROS, -0.5 * ZEROS), 4)]
    found = estimate(frames, "spatial-three-link", friction=["viscous"])
    assert found.estimate.turned is None
    zeros = found.estimate.zeros
    np.testing.assert_allclose(zeros, [ZEROS, -0.5 * ZEROS], atol=2e-3)
    np.testing.assert_allclose(zeros[:, :2], [ZEROS[:2], -0.5 * ZEROS[:2]], atol=2e-4)
    np.testing.assert_allclose(zeros[0] - zeros[1], 1.5 * ZEROS, atol=2e-4)


def predicted_by(path: Path, q: Array, v: Array, a: Array) -> Array:
    """The torques (nrow x njoint) that a file predicts, as its user would ask it."""
    if path.suffix == ".py":
        names: dict[str, object] = {}
        exec(path.read_text(encoding="utf-8"), names)
        law = names["inverse_dynamics"]
        assert callable(law)
        return np.array([law(*(each.tolist() for each in state)) for state in zip(q, v, a, strict=True)])
    if path.suffix == ".h":
        return by_compiler(path, q, v, a)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    data, torques = mujoco.MjData(model), np.empty_like(q)
    for row, state in enumerate(zip(q, v, a, strict=True)):
        data.qpos[:], data.qvel[:], data.qacc[:] = state
        mujoco.mj_inverse(model, data)
        torques[row] = data.qfrc_inverse
    return torques


def by_compiler(path: Path, q: Array, v: Array, a: Array) -> Array:
    """The same of the law in C."""
    import subprocess

    Path("main.c").write_text(
        f'#include <stdio.h>\n#include "{path.name}"\nint main(void) {{ double s[9], t[3];\n'
        "while (fread(s, sizeof s, 1, stdin) == 1) { log_csv_inverse_dynamics(s, s + 3, s + 6, t);"
        " fwrite(t, sizeof t, 1, stdout); } return 0; }\n",
        encoding="utf-8",
    )
    subprocess.run(["cc", "-std=c99", "main.c", "-o", "main", "-lm"], check=True)
    rows = np.concatenate([q, v, a], axis=1).tobytes()
    done = subprocess.run(["./main"], input=rows, capture_output=True, check=True)
    return np.frombuffer(done.stdout).reshape(-1, 3)


def test_model_takes_one_state_or_many(found: RecordedResult) -> None:
    """Torques and mass matrices of many states are those of each."""
    states = np.random.default_rng(2).uniform(0.2, 1.0, (2, 5, 3))
    model = found.model
    each = np.array([model.torque(q, v) for q, v in zip(*states, strict=True)])
    np.testing.assert_allclose(model.torque(*states), each, rtol=1e-12)
    np.testing.assert_allclose(model.mass_matrix(states[0])[3], model.mass_matrix(states[0][3]), rtol=1e-12)


@pytest.mark.parametrize("suffix", [".xml", ".urdf"])
def test_file_of_an_arm_is_a_plant_with_about_the_true_torque(
    found: RecordedResult, tmp_path: Path, suffix: str
) -> None:
    """It can be the nominal robot of the next study or log; a URDF has no rotors, nor has this arm."""
    path = tmp_path / f"arm{suffix}"
    found.model.write(path)
    plant = load_plant(path)
    assert isinstance(plant, ArmPlant)
    arm = swinging_arm()
    true = arm.with_parameters(1.1 * arm.parameters)
    states = np.random.default_rng(3).uniform(-1.0, 1.0, (3, 50, 3))
    expected = joint_torque(true, *states) + DAMPING * states[1] + DRY * np.sign(states[1])
    ours = joint_torque(plant.tree, *states)
    assert np.linalg.norm(ours - expected) < 0.05 * np.linalg.norm(expected)


def test_log_that_is_too_short_to_simulate_is_summed_up_all_the_same(log: Path) -> None:
    """What is not known is null in its JSON, never NaN."""
    short = pd.read_csv(log)[:500]
    shown = estimate(short, "spatial-three-link", friction=["viscous"]).summary
    assert json.loads(json.dumps(shown, allow_nan=False)) == shown
