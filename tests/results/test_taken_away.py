"""What a study found, taken away: as files, as the start of another study, in a controller."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Finished, matching_spec
from exported import FULL, model_of

from metaid.exporting import chain_dynamics
from metaid.study import StudySpec

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DB with the studies `exact`, `noisy`, `coasting`, without an estimate, `hidden`, of a plant with friction that
    the model has not, and `new`, that was not run.
    """
    from metaid.plant import PlantSettings
    from metaid.store import Store
    from metaid.study import create_study, load_study, run_study

    exact = matching_spec(noisy=False)
    assert isinstance(exact.plant, PlantSettings)
    links = tuple(link.model_copy(update={"damping": 0.05}) for link in exact.plant.links)
    hidden = exact.model_copy(update={"plant": exact.plant.model_copy(update={"links": links})})
    coasting = {"sampler": "tpe", "estimate.enabled": False, "trials": 200}
    specs: dict[str, StudySpec] = {
        "exact": exact,
        "noisy": matching_spec(noisy=True),
        "coasting": load_study("two-link-tpe", coasting),
        "hidden": hidden,
        "new": exact,
    }
    path = tmp_path_factory.mktemp("found") / "metaid.db"
    store = Store(str(path), create=True)
    for name, spec in specs.items():
        create_study(store, spec, name)
        if name != "new":
            run_study(store, name)
    store.close()
    return path


def test_plant_file_of_a_model_is_a_plant_and_a_nominal_model(metaid: Metaid, found: Path) -> None:
    """`plant show` shows the identified lumps, and a study takes it as what it believes."""
    import metaid as package

    written = metaid("study", "model", "exact", "-o", "mine.toml", "--storage", str(found))
    assert (written.status, written.out) == (0, "the identified model of 'exact' is in mine.toml\n")
    shown = json.loads(metaid("plant", "show", "mine.toml", "--json").out)
    lumps = package.lumps("exact", str(found)).set_index("name")["identified"]
    for row in shown["lumps"]:
        assert row["true"] == pytest.approx(lumps[row["name"]], rel=1e-8)
    Path("again.toml").write_text('plant = "two-link"\nnominal = "mine.toml"\ntrials = 4\n', encoding="utf-8")
    assert metaid("study", "create", "again.toml").status == 0
    gravity = package.lumps("again").set_index("name")["nominal"]["gravity_1"]
    assert gravity == pytest.approx(lumps["gravity_1"], rel=1e-8)


CONTROLLER = """
import mujoco
from law import torque

model = mujoco.MjModel.from_xml_path("plant.xml")
data = mujoco.MjData(model)
data.qvel[:] = 0.3, -0.2
while data.time < 1.0:
    data.ctrl[:] = torque(data.qpos, data.qvel)
    mujoco.mj_step(model, data)
"""


def test_controller_of_ten_lines_coasts(metaid: Metaid, found: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It sends the true plant, which no gravity seems to pull, what `law.py` says; without it the plant falls."""
    import metaid as package

    assert metaid("study", "model", "exact", "-o", "law.py", "--storage", str(found)).status == 0
    spec = package.load_plant("two-link").chain
    true = chain_dynamics(spec.lumps_of(FULL), 9.81, spec, np.ones(5, dtype=np.bool_))
    text = model_of(true, "plant").text(".xml")
    motors = "".join(f'<motor joint="joint_{i + 1}"/>' for i in range(2))
    Path("plant.xml").write_text(text.replace("</mujoco>", f"<actuator>{motors}</actuator></mujoco>"), encoding="utf-8")
    assert len(CONTROLLER.strip().splitlines()) <= 10
    monkeypatch.syspath_prepend(str(Path.cwd()))
    monkeypatch.delitem(sys.modules, "law", raising=False)
    coasting, falling = dict[str, Any](), dict[str, Any]()
    exec(CONTROLLER, coasting)
    assert coasting["data"].qvel == pytest.approx([0.3, -0.2], abs=2e-3)
    exec(CONTROLLER.replace("torque(data.qpos, data.qvel)", "0.0, 0.0"), falling)
    assert np.abs(falling["data"].qvel - [0.3, -0.2]).max() > 1.0


def test_study_starts_from_what_another_found(metaid: Metaid, found: Path) -> None:
    """Its nominal lumps are those that the other identified, on the command line and in Python."""
    import metaid as package

    shutil.copy(found, "metaid.db")
    assert metaid("study", "create", "two-link-tpe", "--name", "again", "--from", "noisy").status == 0
    lumps = package.lumps("noisy").set_index("name")["identified"]
    nominal = package.lumps("again").set_index("name")["nominal"]
    exact = package.model("noisy").dynamics.chain
    assert exact is not None
    assert nominal[["gravity_1", "gravity_2"]].to_numpy() == pytest.approx(exact.lumps.gravity, rel=1e-12)
    assert nominal["gravity_1"] == pytest.approx(lumps["gravity_1"], rel=0.02)
    spec = package.load_study("two-link-tpe", {"trials": 2})
    frame = package.run(spec, name="python", start_from="noisy")
    assert frame.set_index("name")["nominal"]["gravity_1"] == nominal["gravity_1"]


NO_START = {
    "hidden": ("two-link-tpe", "study 'hidden' has no identified model: its verdict is 'not found'"),
    "exact": ("three-link", "is a planar chain of 3 links, and the model to start from is a planar chain of 2"),
    "noisy": ("puma560", "is an arm with the joints shoulder_pan"),
    "none": ("two-link-tpe", "unknown study 'none'"),
}


@pytest.mark.parametrize("other", NO_START)
def test_study_starts_from_no_other_plant_and_from_nothing_unfound(metaid: Metaid, found: Path, other: str) -> None:
    """One line says why, and no study is made."""
    source, why = NO_START[other]
    done = metaid("study", "create", source, "--name", "x", "--from", other, "--storage", str(found))
    assert (done.status, done.err.count("\n")) == (2, 1)
    assert why.partition(" shoulder_pan")[0] in done.err
    assert "unknown study 'x'" in metaid("study", "show", "x", "--storage", str(found)).err


def test_other_sampler_goes_on_in_a_new_study(metaid: Metaid, found: Path) -> None:
    """A study keeps its sampler; one line says what to add to the command, and that works."""
    shutil.copy(found, "metaid.db")
    again = ["study", "create", "two-link-tpe", "--name", "coasting", "--set", "sampler=random"]
    refused = metaid(*again)
    assert refused.status == 2
    assert "its sampler is tpe, which cannot change; go on with random in a new study" in refused.err
    assert "--name coasting-random --from coasting, in Python name= and start_from=" in refused.err
    assert metaid(*again, "--exist-ok").err == refused.err.replace("already", "made from other settings")
    more = ["--name", "coasting-random", "--from", "coasting"]
    assert metaid(*again[:3], *again[5:], *more).status == 0


def test_model_that_was_not_found_is_given_when_asked_for(metaid: Metaid, found: Path) -> None:
    """It says that nothing is identified; what there is are the values of the last estimate."""
    import metaid as package
    from metaid.errors import StudyError

    told = metaid("study", "model", "hidden", "-o", "m.py", "--even-if-not-found", "--storage", str(found))
    assert told.status == 0
    assert "nothing is identified: these are the values of the estimate, and may be wrong." in told.out
    text, names = Path("m.py").read_text(encoding="utf-8"), dict[str, Any]()
    assert "Verdict: not found" in text
    exec(text, names)
    assert np.isfinite(names["torque"]([0.1, -0.1], [0.5, 0.5])).all()
    with pytest.raises(StudyError, match=r"0 of 8 trials are done$"):
        package.model("new", str(found), even_if_not_found=True)


def test_json_has_lumps_with_their_covariance(metaid: Metaid, found: Path) -> None:
    """In the units of the lumps; the square roots of its diagonal are the standard deviations."""
    assert metaid("study", "model", "noisy", "-o", "m.json", "--storage", str(found)).status == 0
    model = json.loads(Path("m.json").read_text(encoding="utf-8"))
    assert (model["verdict"], model["source"], model["units"]) == ("found", "estimate", "SI")
    rows = {row["name"]: row for row in model["lumps"]}
    assert model["covariance"]["names"] == list(rows)
    deviations = np.sqrt(np.diag(model["covariance"]["values"]))
    assert deviations == pytest.approx([row["sd"] for row in rows.values()])
    assert all(row["low"] < row["value"] < row["high"] for row in rows.values())


def test_every_file_says_what_it_is(metaid: Metaid, found: Path) -> None:
    """Of which study and plant, with which verdict, and in which units; bodies are said not to be identified."""
    for suffix in (".toml", ".xml", ".urdf", ".py", ".h"):
        assert metaid("study", "model", "noisy", "-o", f"m{suffix}", "--storage", str(found)).status == 0
        text = Path(f"m{suffix}").read_text(encoding="utf-8")
        for said in ("in the study 'noisy'", "Verdict: found, by the estimate; misfit", "Units: m, kg, s, rad"):
            assert said in text
        assert ("are not identified: combinations of them are" in text) == (suffix in (".toml", ".xml", ".urdf"))


def test_model_of_a_best_trial_leaves_inertias_to_the_nominal_model(metaid: Metaid, found: Path) -> None:
    """Gravity and Coriolis lumps are those of the best trial; there is no covariance."""
    import metaid as package

    model = package.model("coasting", str(found))
    assert model.about["source"] == "best trial"
    assert model.covariance is None
    assert model.dynamics.chain is not None
    lumps = package.lumps("coasting", str(found))["identified"].to_numpy()
    assert model.dynamics.chain.lumps.vector == pytest.approx(lumps, rel=1e-9)


REFUSED = {
    "hidden": "study 'hidden' has no identified model: its verdict is 'not found': the model does not explain",
    "new": "study 'new' has no identified model: its verdict is 'unfinished': 0 of 8 trials are done",
    "none": "unknown study 'none'",
}


@pytest.mark.parametrize("name", REFUSED)
def test_study_that_found_nothing_has_no_model(metaid: Metaid, found: Path, name: str) -> None:
    """One line says why, and nothing is written."""
    done = metaid("study", "model", name, "-o", "model.xml", "--storage", str(found))
    assert done.status == 2
    assert REFUSED[name] in done.err
    assert done.err.count("\n") == 1
    assert ("even_if_not_found=True, gives what there is)" in done.err) == (name == "hidden")
    assert list(Path().iterdir()) == []


def test_unknown_ending_is_refused(metaid: Metaid, found: Path) -> None:
    """With those that are allowed."""
    done = metaid("study", "model", "exact", "-o", "model.step", "--storage", str(found))
    assert done.status == 2
    assert "(allowed: .toml, .xml, .urdf, .py, .h, .json)" in done.err
