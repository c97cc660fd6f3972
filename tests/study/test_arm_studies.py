"""Studies of arms: created, run, resumed, shown and exported like those of chains, with base parameters for lumps."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import mujoco
import numpy as np
import optuna
import pytest
from arm_studies import ARM, spec_of, with_noise
from conftest import Finished
from optuna_dashboard import get_note

from metaid import results
from metaid.files import shipped_folder
from metaid.models.tree import joint_torque
from metaid.show import make_dashboard
from metaid.store import Store
from metaid.study import create_study, load_study, run_study

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]


def test_one_trial_finds_all_base_parameters_of_an_arm(arms: Path) -> None:
    """From a nominal arm that is up to 30 % wrong, rotors and friction unknown; the dynamics are exact on states that
    no trial has seen.
    """
    with closing(Store(str(arms))) as store:
        shown = results.summary(store, "exact")
    assert shown["verdict"] == "found"
    assert shown["estimate"]["known_from"] == 1
    assert len(shown["lumps"]) == 22
    assert all(lump["determined"] for lump in shown["lumps"])
    assert max(shown["model_error"].values()) < 1e-9
    first = shown["lumps"][0]
    assert first["expression"].startswith("zz1 + rotor1 + ")
    assert first["low"] < first["identified"] < first["high"]


@pytest.mark.parametrize("name", ["scara", "horizontal-five-link"])
def test_joints_that_gravity_does_not_load_are_identified(tmp_path: Path, name: str) -> None:
    """What the paper left to the future: Coriolis forces and springs tell all that a torque can."""
    with closing(Store(str(tmp_path / "metaid.db"), create=True)) as store:
        run_study(store, create_study(store, load_study(name, {"trials": 1})))
        shown = results.summary(store, name)
    assert shown["verdict"] == "found"
    assert all(lump["determined"] for lump in shown["lumps"])
    assert max(shown["model_error"].values()) < 1e-6


def test_intervals_on_noisy_sensors_hold_the_truth(arms: Path) -> None:
    """A tenth of a milliradian and no sensor of speed: to half a percent, and within four standard deviations."""
    with closing(Store(str(arms))) as store:
        shown, frame = results.summary(store, "noisy"), results.lumps_frame(store, "noisy")
    assert shown["verdict"] == "found"
    assert max(shown["model_error"].values()) < 5e-3
    known = frame[frame["determined"]]
    assert (np.abs(known["identified"] - known["true"]) < 4.0 * known["sd"]).all()


def test_estimate_of_all_trials_begins_at_that_of_the_first(arms: Path) -> None:
    """It takes a step or two, where the first grew windows from the nominal arm."""
    with closing(Store(str(arms))) as store:
        snapshot = results.read_snapshot(store, "noisy")
    found, experiment = snapshot.estimate, snapshot.problem.experiment()
    assert found is not None
    assert experiment is not None
    first = experiment.estimate(found.seen()[1][:1], thorough=False)
    assert first is not None
    assert found.trials > 1
    assert found.estimate.iterations <= 3 < first.iterations


def test_arm_of_another_shape_is_not_found(arms: Path, metaid: Metaid) -> None:
    """Links one percent longer than the nominal model says explain nothing: no base parameter is known."""
    done = metaid("study", "show", "bent", "--storage", str(arms))
    assert done.verdict[0].startswith("NOT FOUND: the model does not explain what was seen")
    with closing(Store(str(arms))) as store:
        shown = results.summary(store, "bent")
    assert all(lump["low"] is None and not lump["determined"] for lump in shown["lumps"])
    assert shown["model_error"] is None


def test_trials_of_an_arm_do_not_depend_on_how_often_a_run_stopped(arms: Path, tmp_path: Path) -> None:
    """Nor on the number of workers: bit for bit."""
    with closing(Store(str(tmp_path / "again.db"), create=True)) as again, closing(Store(str(arms))) as store:
        name = create_study(again, with_noise(spec_of(trials=2), 1e-4), "noisy")
        run_study(again, name, trials=1)
        run_study(again, name, workers=2)
        assert results.trials_frame(again, name).to_csv() == results.trials_frame(store, "noisy").to_csv()


def test_plain_optuna_reads_the_base_parameters_of_each_trial(arms: Path) -> None:
    """Under their own names, in SI units, with the measure as the value."""
    with closing(Store(str(arms))) as store:
        shown, trials = results.summary(store, "exact"), results.trials_frame(store, "exact")
        study = optuna.load_study(study_name="exact", storage=store.optuna)
    assert study.best_trial.number == shown["best"]["number"]
    assert set(study.best_trial.params) == {lump["name"] for lump in shown["lumps"]}
    assert trials["m2z"].tolist() == [trial.params["m2z"] for trial in study.trials]


def test_commands_show_list_and_export_an_arm(arms: Path, metaid: Metaid, tmp_path: Path) -> None:
    """As they do a chain."""
    storage = ("--storage", str(arms))
    out = metaid("study", "show", "exact", *storage).out
    assert "FOUND: 22 base parameters\n- on states that no trial has seen wrong by: gravity torque " in out
    assert json.loads(metaid("study", "show", "exact", *storage, "--json").out)["measure"] == "kinetic"
    assert "kinetic" in metaid("study", "list", *storage).out
    assert metaid("study", "export", "exact", *storage, "-o", "trials.csv").status == 0
    assert (tmp_path / "trials.csv").read_text().startswith("number,state,value,generation,steps,zz1,")


def test_bodies_of_an_arm_hold_the_truth_in_their_intervals(arms: Path, metaid: Metaid) -> None:
    """Nine in ten of masses, centres of mass and inertias, which its base parameters leave open; those that these tell
    of are known better than beforehand. Of an arm that was not found there are none, and why is said.
    """
    with closing(Store(str(arms))) as store:
        snapshot = results.read_snapshot(store, "exact")
        bodies = results.bodies_table(snapshot).set_index("name")
    assert len(bodies) == 30
    held = (bodies["low"] <= bodies["true"]) & (bodies["true"] <= bodies["high"])
    assert held.mean() > 0.9 - 1.0 / 30.0
    assert bodies.loc["com_x_2", "sd"] < 0.1 * np.linalg.norm(spec_of().nominal.tree.com[1])
    out = metaid("study", "show", "exact", "--storage", str(arms), "--bodies").out
    assert "Possible bodies with these base parameters" in out
    assert (
        "no bodies: the verdict is 'not found'"
        in metaid("study", "show", "bent", "--storage", str(arms), "--bodies").out
    )


def test_exported_model_of_an_arm_has_its_identified_torque(arms: Path, metaid: Metaid, tmp_path: Path) -> None:
    """MuJoCo needs the same torque for the exported arm, and the exported law gives it; a plant file is refused."""
    storage = ("--storage", str(arms))
    for suffix in ("xml", "urdf", "py", "h", "json"):
        assert metaid("study", "model", "exact", *storage, "-o", f"arm.{suffix}").status == 0
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data, true = mujoco.MjData(model), spec_of().plant.arm.tree
    data.qpos[:], data.qvel[:] = states = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 3))
    mujoco.mj_forward(model, data)
    torque = joint_torque(true, *states, np.zeros(3))
    assert np.allclose(data.qfrc_bias - data.qfrc_passive, torque, rtol=0, atol=1e-9)
    law: dict[str, Callable[..., list[float]]] = {}
    exec((tmp_path / "arm.py").read_text(encoding="utf-8"), law)
    assert np.allclose(law["torque"](*states.tolist()), torque, rtol=0, atol=1e-9)
    assert len(json.loads((tmp_path / "arm.json").read_text(encoding="utf-8"))["lumps"]) == 22
    assert "(allowed: .xml, .urdf, .py, .h, .json)" in metaid("study", "model", "exact", *storage, "-o", "arm.toml").err
    refused = metaid("study", "model", "bent", *storage, "-o", "bent.xml")
    assert refused.status == 2
    assert "its verdict is 'not found'" in refused.err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('nominal = "pa10"', "the nominal arm s1, s2, s3, e1, e2, w1, w2: they must agree"),
        ('nominal = "three-link"', "three-link.toml: no arm, as the plant of the study is"),
        ('nominal = "spatial-three-link"\nsampler = "dinoip"', "sampler"),
        ('nominal = "spatial-three-link"\n[episode]\npushes = "rich"', "'pushes'"),
    ],
)
def test_study_file_of_an_arm_that_contradicts_itself_is_refused_in_one_line(
    metaid: Metaid, tmp_path: Path, text: str, said: str
) -> None:
    """It says what is wrong, where, and what is allowed."""
    (tmp_path / "study.toml").write_text(f'plant = "{ARM}"\n{text}\n', encoding="utf-8")
    refused = metaid("study", "create", "study.toml")
    assert (refused.status, refused.out) == (2, "")
    assert said in refused.err
    assert refused.err.count("\n") == 1
    assert not (tmp_path / "metaid.db").exists()


@pytest.mark.parametrize("name", ["pa10", "crs-a465", "puma560", "scara", "horizontal-five-link", ARM])
def test_shipped_studies_of_arms_can_be_created(name: str) -> None:
    """Each is of the shipped arm of its name, and its nominal arm is not the true one."""
    spec = load_study(name)
    assert (shipped_folder("plants") / f"{spec.plant_name}.toml").exists()
    assert not np.allclose(spec.nominal.tree.parameters, spec.plant.arm.tree.parameters)


def test_check_says_what_one_trial_of_an_arm_determines_and_what_springs_alone_show(metaid: Metaid) -> None:
    """Before any trial, by the nominal arm: rotor and inertia of the last joint show in the mass matrix alone."""
    shown = json.loads(metaid("study", "check", ARM, "--json").out)["lumps"]
    assert len(shown) == 22
    assert all(lump["determined"] for lump in shown)
    by = {lump["name"]: lump["shown_by"] for lump in shown}
    assert by["rotor3"] == "springs"
    assert by["m3z"] == "coasts"
    out = metaid("study", "check", ARM, "--set", "episode.springs=0").out
    assert "one trial does not determine " in out
    assert "rotor3" in out.splitlines()[-1]


def test_dashboard_has_a_note_on_a_study_of_an_arm(arms: Path, tmp_path: Path) -> None:
    """Its verdict and its base parameters; and no study of an arm keeps the others from being served."""
    path = tmp_path / "metaid.db"
    path.write_bytes(arms.read_bytes())
    with closing(Store(str(path))) as store, make_dashboard(store, 0):
        written = get_note(optuna.load_study(study_name="exact", storage=store.optuna))
        refused = get_note(optuna.load_study(study_name="bent", storage=store.optuna))
    assert "**Verdict: found.**" in written
    assert "| `m2z` | 0.81182 | 0.894 |" in written
    assert "**Verdict: not found.**" in refused


def test_what_rounding_leaves_of_a_base_parameter_that_is_zero_is_zero(tmp_path: Path) -> None:
    """Else its error were some million percent: the PUMA 560 has such ones, by the turns of its frames."""
    with closing(Store(str(tmp_path / "new.db"), create=True)) as store:
        table = results.lumps_frame(store, create_study(store, load_study("puma560"))).set_index("name")
    assert table.loc["m6x", "true"] == 0.0
    assert table.loc["m5x", "nominal"] == 0.0
    assert (table["true"].abs() > 1e-3).sum() > 5
    assert not table["true"].between(1e-30, 1e-12).any()
