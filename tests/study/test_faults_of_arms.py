"""Studies of an arm of three joints on a plant that has what real ones have."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from arm_files import two
from arm_studies import spec_of
from conftest import Finished

from metaid.errors import StudyError
from metaid.models import Array
from metaid.results import read_snapshot
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from metaid.study.estimates import StudyEstimate

SENSORS = {"angle_noise": 1e-4, "speed_sensor": False}


def found_with(
    folder: Path, searched: tuple[str, ...] | str, seed: int = 0, trials: int = 1, **faults: object
) -> tuple[StudyEstimate, Array]:
    """What so many trials on a plant with these faults say, and how many deviations each base parameter is off."""
    wanted = searched if isinstance(searched, str) else list(searched)
    spec = spec_of(**{"trials": trials, "seed": seed, "estimate.faults": wanted})
    plant = spec.plant.model_copy(update={"faults": spec.plant.faults.model_copy(update={**SENSORS, **faults})})
    store = Store(str(folder / f"arm-{seed}.db"), create=True)
    run_study(store, create_study(store, spec.model_copy(update={"plant": plant}), "arm"))
    found = read_snapshot(store, "arm").estimate
    assert found is not None
    true = found.estimate.searched.prior.base.of(spec.plant.arm.tree.parameters)
    return found, np.asarray((found.estimate.values - true) / found.deviations)


@pytest.mark.parametrize(
    ("kinds", "faults", "true"),
    [
        (("delay",), {"delay": 2}, {"delay": 0.004}),
        (("tilt",), {"tilt": (0.02, -0.03)}, {"tilt_x": 0.02, "tilt_y": -0.03}),
        (("offset",), {"encoder_offset": (0.0, 0.02, -0.01)}, {"offset_2": 0.02}),
        (("gain",), {"torque_gain": (1.0, 1.1, 0.95)}, {"gain_2": 1.1, "gain_3": 0.95}),
        (
            ("delay", "tilt", "gain"),
            {"delay": 1, "control_every": 2, "tilt": (0.02, -0.03), "torque_gain": (1.0, 1.1, 0.95)},
            {"delay": 0.004, "tilt_x": 0.02, "tilt_y": -0.03, "gain_2": 1.1, "gain_3": 0.95},
        ),
    ],
    ids=["delay", "tilt", "offset", "gain", "together"],
)
def test_searched_faults_of_an_arm_are_found(
    tmp_path: Path, kinds: tuple[str, ...], faults: dict[str, object], true: dict[str, float]
) -> None:
    """Within four deviations, with the base parameters; the model then explains what was read."""
    found, off = found_with(tmp_path, kinds, **faults)
    assert found.explains
    assert np.abs(off).max() < 4.0
    assert found.estimate.faults is not None
    named = zip(found.estimate.faults.values, found.estimate.faults.deviations, strict=True)
    values = dict(zip(found.estimate.faults.searched.names, named, strict=True))
    for name, size in true.items():
        value, deviation = values[name]
        assert abs(value - size) < 4.0 * deviation < 0.05 * abs(size)


def test_what_a_level_base_hides_stays_unknown(tmp_path: Path) -> None:
    """Of a turret two first moments show only where it is tilted: on exact sensors, which know all else to rounding,
    a study that takes up faults leaves them as they were.
    """
    found, _ = found_with(tmp_path, "proposed", delay=2, angle_noise=0.0, speed_sensor=True)
    names, (known, _) = found.estimate.names, found.estimate.shares(None)
    hidden = [name in ("m1x", "m1y") for name in names]
    assert sum(hidden) == 2
    assert found.estimate.faults is not None
    assert found.estimate.faults.searched.kinds == ("delay",)
    assert (known[hidden] > 0.3).all()
    assert known[~np.array(hidden)].max() < 1e-3


def test_offset_of_the_last_encoder_stays_unknown_even_on_exact_sensors(tmp_path: Path) -> None:
    """An arm whose last link is turned as far moves alike: what turns with it is as unknown, and intervals hold it."""
    wrong = {"angle_noise": 0.0, "speed_sensor": True, "encoder_offset": (0.0, 0.02, -0.03)}
    found, off = found_with(tmp_path, ("offset",), **wrong)
    assert found.explains
    assert np.abs(off).max() < 4.0
    faults = found.estimate.faults
    assert faults is not None
    known = dict(zip(faults.searched.names, faults.deviations.tolist(), strict=True))
    assert known["offset_2"] < 1e-4
    assert known["offset_3"] > 0.03


def test_faults_of_an_arm_stand_beside_its_base_parameters(tmp_path: Path, metaid: Callable[..., Finished]) -> None:
    """In the table with the truth, in the verdict and in the report."""
    found_with(tmp_path, ("delay", "tilt"), delay=2, tilt=(0.02, -0.03))
    storage = ("--storage", str(tmp_path / "arm-0.db"))
    faults = {row["name"]: row for row in json.loads(metaid("study", "show", "arm", "--json", *storage).out)["faults"]}
    assert {name: row["true"] for name, row in faults.items()} == {"delay": 0.004, "tilt_x": 0.02, "tilt_y": -0.03}
    assert all(row["low"] < row["true"] < row["high"] for row in faults.values())
    assert any(line.startswith("delay 0.00") for line in metaid("study", "show", "arm", *storage).verdict)
    assert metaid("study", "report", "arm", *storage, "-o", "arm.html").status == 0
    assert 'id="faults-table"' in Path("arm.html").read_text(encoding="utf-8")


def test_spring_of_a_file_that_is_slack_somewhere_is_found_with_its_torque_there(
    tmp_path: Path, metaid: Callable[..., Finished]
) -> None:
    """As a spring, and as a bias that holds it where it is slack; the study needs the file no more."""
    (tmp_path / "real.xml").write_text(two(joint="stiffness='3' springref='0.5'"), encoding="utf-8")
    (tmp_path / "rough.xml").write_text(two(), encoding="utf-8")
    study = 'plant = "real.xml"\nnominal = "rough.xml"\ntrials = 1\nseed = 1\nestimate.faults = ["spring", "bias"]\n'
    (tmp_path / "sprung.toml").write_text(study, encoding="utf-8")
    assert metaid("study", "create", "sprung.toml").status == 0
    (tmp_path / "real.xml").unlink()
    assert metaid("study", "run", "sprung").status == 0
    shown = json.loads(metaid("study", "show", "sprung", "--json").out)
    faults = {row["name"]: row for row in shown["faults"]}
    assert {name: row["true"] for name, row in faults.items()} == {
        "spring_1": 3,
        "spring_2": 0,
        "bias_1": 1.5,
        "bias_2": 0,
    }
    assert all(row["identified"] == pytest.approx(row["true"], abs=1e-4) for row in faults.values())


def test_friction_of_an_arm_is_found_with_its_base_parameters(tmp_path: Path) -> None:
    """It needs no fault: the plant has viscous friction that the nominal arm has not, and it is known to a tenth."""
    found, off = found_with(tmp_path, ())
    names = found.estimate.searched.prior.base.names
    damping = [names.index(f"damping{joint}") for joint in (1, 2, 3)]
    assert np.abs(off[damping]).max() < 4.0
    assert (found.estimate.values[damping] > 10.0 * found.deviations[damping]).all()


def test_study_of_an_arm_takes_up_the_fault_that_explains_it(tmp_path: Path) -> None:
    """A delay that nobody has named is what is missing, and the study says so."""
    found, off = found_with(tmp_path, "proposed", delay=2)
    assert found.explains
    assert found.taken_up is not None
    assert found.taken_up.kinds == ("delay",)
    assert np.abs(off).max() < 4.0


def test_pushes_of_an_arm_that_differ_are_accounted_for(tmp_path: Path) -> None:
    """Start speeds scatter by 2 %, and intervals hold what is true."""
    found, off = found_with(tmp_path, (), push_noise=0.02)
    assert found.explains
    assert np.abs(off).max() < 4.0


def test_intervals_hold_on_an_arm_whose_torques_are_noisy(tmp_path: Path) -> None:
    """The readings lead the twin, the size of the noise is found, and 95 % intervals hold in about 95 % of cases."""
    off, sizes = [], []
    for seed in range(2):
        found, each = found_with(tmp_path, (), seed, torque_noise=0.5)
        assert found.explains
        assert found.estimate.torque_noise is not None
        off.append(np.abs(each))
        sizes.append(found.estimate.torque_noise)
    assert np.concatenate(off).max() < 4.5
    assert (np.concatenate(off) < 1.96).mean() > 0.88
    assert np.mean(sizes) == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"estimate.faults": ["viscous"]}, "friction and rotors of an arm's joints are among its base parameters"),
        ({"estimate.faults": ["delay"], "estimate.enabled": False}, "only an estimate finds them"),
        ({"estimate.torque_limit": 5.0}, "only an estimate from readings knows of it"),
        ({"estimate.faults": ["delay"], "estimate.torque_limit": [5.0, 5.0]}, "has 2 numbers .allowed: one, or 3"),
    ],
)
def test_what_an_arm_cannot_have_is_refused(changes: dict[str, object], said: str) -> None:
    """In one line, before anything is run."""
    with pytest.raises(StudyError, match=said):
        load_study("spatial-three-link", changes)


HANGING = """<mujoco>
<compiler angle="radian"/>
<worldbody>
<body pos="0 0 0.4">
<joint name="side" axis="0 1 0" range="-2.4 2.4" armature="0.03" damping="0.15"/>
<inertial pos="-0.005 -0.005 0.14" mass="1" fullinertia="0.011 0.011 0.002 0.0001 0.0005 -0.0002"/>
<body pos="0.036 -0.026 0.4">
<joint name="across" axis="1 0 0" range="-2.4 2.4" armature="0.036" damping="0.08"/>
<inertial pos="-0.014 -0.001 0.08" mass="2.4" fullinertia="0.02 0.019 0.004 0.0006 0.0001 0.0017"/>
</body></body>
</worldbody>
</mujoco>
"""
OFF = 'mjcf = "hanging.xml"\n\n[faults]\nangle_noise = 1e-4\nspeed_sensor = false\nencoder_offset = 0.01\n'
PROPOSED = """plant = "off.toml"
trials = 1
[estimate]
faults = "proposed"
[nominal]
plant = "hanging.xml"
seed = 7
"""


def test_intervals_hold_a_last_encoder_that_is_off_as_the_others_may_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tilt explains as much as an offset of a first joint that is level. Where that is there, the last encoder may be
    off, too, which no motion shows.
    """
    monkeypatch.chdir(tmp_path)
    for name, text in (("hanging.xml", HANGING), ("off.toml", OFF), ("proposed.toml", PROPOSED)):
        Path(name).write_text(text)
    store = Store("off.db", create=True)
    run_study(store, create_study(store, load_study("proposed.toml"), "off"))
    found = (snapshot := read_snapshot(store, "off")).estimate
    assert found is not None
    assert found.taken_up is not None
    assert found.taken_up.kinds == ("tilt",)
    lumps = snapshot.verdict.lumps
    assert ((lumps["low"] <= lumps["true"]) & (lumps["true"] <= lumps["high"])).sum() >= len(lumps) - 1
    turned = lumps.set_index("name").loc["m2y"]
    assert turned["low"] < turned["true"] < turned["high"]
