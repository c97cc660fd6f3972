"""What all trials of a study say together: in frames and JSON, in the terminal, and where nothing can be said."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import Finished
from pandas.testing import assert_frame_equal

import metaid as package
from metaid.errors import StudyError
from metaid.estimation import TakenUp
from metaid.models import ChainModel
from metaid.results import read_snapshot, validate_law
from metaid.show import report
from metaid.store import Store
from metaid.study import Problem, create_study, load_study, run_study
from metaid.study.estimates.making import first_enough

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]
INERTIA = ["inertia_1", "inertia_2", "inertia_3"]


def test_every_study_stands_by_the_estimate_that_explains_what_was_seen(estimated: Path) -> None:
    """Whichever sampler proposed the trials: all nine lumps with intervals, and how early they were known."""
    for name in ("matched", "searched"):
        shown = package.summary(name, str(estimated))
        estimate = shown["estimate"]
        assert (shown["verdict"], shown["reasons"], shown["source"]) == ("found", [], "estimate")
        assert shown["misfit"] == estimate["misfit"] < estimate["explained_below"]
        assert estimate["explains"]
        assert estimate["trials"] == min(shown["trials"]["total"], 12)
        assert 1 <= estimate["known_from"] <= 2
        assert shown["max_error"] < 1e-9
        assert [lump["name"] for lump in shown["lumps"]][-3:] == INERTIA
        assert all(lump["sd"] > 0.0 for lump in shown["lumps"])


def test_lumps_that_an_estimate_is_not_of_are_the_nominal_ones(tmp_path: Path) -> None:
    """The law that is identified has them, where it is shown and where it is written; a report draws the others."""
    changes = {"nominal": "three-link", "estimate.lumps": ["gravity", "inertia"]}
    storage = str(tmp_path / "metaid.db")
    found = package.run(load_study("three-link-oscillation", changes), storage=storage)
    assert found["determined"].all()
    assert package.summary("three-link-oscillation", storage)["verdict"] == "found"
    model, chain = package.model("three-link-oscillation", storage), package.load_plant("three-link").chain
    angles, speeds = np.array([0.1, -0.2, 0.3]), np.array([1.0, -2.0, 0.5])
    assert model.torque(angles, speeds) == pytest.approx(ChainModel(chain.lumps, 9.81).torque(angles, speeds))
    page = report.render(package.load_findings("three-link-oscillation", storage))
    assert "gravity_1" in page


@pytest.mark.parametrize("wanted", range(1, 14))
def test_how_many_trials_were_enough_is_found_with_few_estimates(wanted: int) -> None:
    """Seven at most of twelve trials, one where the first is enough; None where all are not."""
    tried = []

    def is_enough(count: int) -> bool:
        tried.append(count)
        return count >= wanted

    assert first_enough(1, 12, is_enough) == (wanted if wanted <= 12 else None)
    assert len(tried) == len(set(tried)) <= (1 if wanted == 1 else 7)
    assert first_enough(2, 1, is_enough) is None


@pytest.mark.parametrize(("name", "which"), [("matched", "all 2 trials"), ("searched", "the first 12 trials")])
def test_estimate_is_shown_once_with_what_it_is_worth(metaid: Metaid, estimated: Path, name: str, which: str) -> None:
    """One table of all lumps; below it how early they were known, the misfit, and last of all the verdict."""
    shown = metaid("study", "show", name, "--storage", str(estimated))
    out = shown.out
    assert out.count("gravity_1") == out.count("inertia_3") == 1
    words = " ".join(out.split())
    assert f"estimate from {which}; after the first of " in words
    assert "no lump moved by more than 0.1%; ± is half the 95 % interval; the model explains what was" in words
    assert shown.verdict[0].startswith("FOUND: 9 lumps, each to within ")


@pytest.mark.parametrize(("name", "which"), [("hidden", "all 4 trials"), ("hidden-searched", "the first 12 trials")])
def test_model_that_explains_nothing_leaves_no_number(metaid: Metaid, estimated: Path, name: str, which: str) -> None:
    """Every lump is said to be not found; no interval, no error; the verdict names the misfit."""
    done = metaid("study", "show", name, "--storage", str(estimated))
    assert done.status == 0
    lines = done.out.splitlines()[: -len(done.verdict)]
    assert f"estimate from {which}; the model does not explain what was seen" in lines[-1]
    assert done.verdict[0].startswith("NOT FOUND: ")
    why = "; ".join(done.verdict)
    assert "the model does not explain what was seen" in why
    assert "(explained: below 3)" in why
    rows = [line.split() for line in lines if "gravity_" in line or "inertia_" in line]
    assert len(rows) == (6 if name == "hidden" else 3)
    for row in rows:
        assert row[2:5] == ["not", "found", "–"]
        assert row[6] == "–"


@pytest.mark.parametrize("name", ["matched", "searched", "noisy"])
def test_bodies_of_an_estimate_hold_the_true_links(estimated: Path, name: str) -> None:
    """Masses, centres of mass and inertias are sets; lengths follow from the lumps, but for the last."""
    frame = package.bodies(name, str(estimated)).set_index("name")
    assert len(frame) == 12
    assert ((frame["low"] <= frame["true"]) & (frame["true"] <= frame["high"])).all()
    assert frame.index[~frame["bounded"]].tolist() == ["mass_1", "length_3"]
    widths = (frame["high"] / frame["low"])[["mass_2", "com_2", "length_2"]]
    assert (widths > [2.0, 2.0, 1.0]).all()
    assert widths["length_2"] < 1.01


def test_bodies_are_shown_where_they_are_asked_for(metaid: Metaid, estimated: Path) -> None:
    """A table below that of the lumps, and a key of the JSON; what has no largest value is called unbounded, in JSON it
    is null and not `bounded`.
    """
    asked = ("study", "show", "matched", "--storage", str(estimated))
    shown = metaid(*asked, "--bodies")
    out = shown.out
    rows = {line.split()[0]: line.split() for line in out.splitlines() if "_" in line}
    assert rows["mass_1"][3] == rows["length_3"][3] == "unbounded"
    assert "known to a tenth: length_1, length_2" in " ".join(out.split())
    assert shown.verdict[0].startswith("FOUND: ")
    assert "mass_1" not in metaid(*asked).out
    shown = json.loads(metaid(*asked, "--bodies", "--json").out)
    assert shown["why_no_bodies"] is None
    bodies = {row["name"]: row for row in shown["bodies"]}
    assert set(bodies["mass_2"]) == {"name", "unit", "nominal", "low", "high", "bounded", "true"}
    assert bodies["mass_1"]["high"] is None
    assert not bodies["mass_1"]["bounded"]
    assert "bodies" not in json.loads(metaid(*asked, "--json").out)


def test_no_bodies_are_shown_where_no_lumps_were_found(metaid: Metaid, estimated: Path) -> None:
    """The line says why; Python says it as an error."""
    out = metaid("study", "show", "hidden", "--storage", str(estimated), "--bodies").out
    assert "no bodies: the verdict is 'not found': the model does not explain what was seen" in " ".join(out.split())
    with pytest.raises(StudyError, match="no bodies: the verdict is 'not found'"):
        package.bodies("hidden", str(estimated))


@pytest.mark.parametrize("name", ["hidden", "hidden-searched"])
def test_json_of_a_model_that_explains_nothing_has_its_values_without_intervals(
    metaid: Metaid, estimated: Path, name: str
) -> None:
    """It holds what the estimate came to, though no lump is known or determined, nor is there a largest error."""
    shown = json.loads(metaid("study", "show", name, "--storage", str(estimated), "--json").out)
    assert shown["verdict"] == "not found"
    assert shown["misfit"] > 1e3
    assert not shown["estimate"]["explains"]
    assert shown["estimate"]["known_from"] is shown["max_error"] is None
    for lump in shown["lumps"]:
        assert lump["identified"] == pytest.approx(lump["factor"] * lump["nominal"])
        assert {lump[key] for key in ("sd", "low", "high")} == {None}
        assert not lump["determined"]


NONE_MADE = {
    "[estimate] enabled is false": ("three-link-coast", {"estimate.enabled": False, "trials": 10}),
    "its episodes keep no windows of motion": (
        "ten-link",
        {"episode.count": 700, "episode.steps": 20, "sampler": "random", "search.coordinates": "plain", "trials": 2},
    ),
}


@pytest.mark.parametrize("why", NONE_MADE)
def test_study_without_an_estimate_says_why_in_one_line(metaid: Metaid, why: str) -> None:
    """Below the table, and in its JSON."""
    source, changes = NONE_MADE[why]
    with_store = Store("metaid.db", create=True)
    create_study(with_store, load_study(source, changes), "without")
    run_study(with_store, "without")
    with_store.close()
    assert f"no estimate from all trials: {why}" in metaid("study", "show", "without").out.splitlines()
    shown = package.summary("without")
    assert shown["estimate"] is shown["misfit"] is None
    assert shown["why_no_estimate"] == why
    with pytest.raises(StudyError, match="study 'without' has no estimate: ") as refused:
        _ = package.study("without").estimate
    assert str(refused.value).endswith(why)


def test_intervals_hold_what_another_explanation_would_change(estimated: Path) -> None:
    """As of a tilt that was taken up where offsets of the encoders do as well, with each unknown 2 % larger."""
    with closing(Store(str(estimated))) as store:
        found = read_snapshot(store, "matched").estimate
    assert found is not None
    shifts = np.full((1, len(found.estimate.unknowns)), 0.02)
    both = replace(found, taken_up=TakenUp(("tilt",), ("10 mrad",), 26.0, 0.7, ("encoder offsets",), shifts))
    values = found.estimate.values
    assert (found.deviations < 1e-3 * values).all()
    assert (both.deviations / values).min() == pytest.approx(0.02, rel=0.01)


def test_study_without_a_trial_says_nothing_of_an_estimate(metaid: Metaid) -> None:
    """There is nothing to be missed yet."""
    metaid("study", "create", "three-link-coast")
    assert "stimate" not in metaid("study", "show", "three-link-coast").out
    with pytest.raises(StudyError, match="no trial yet: run it first"):
        _ = package.study("three-link-coast").estimate


def test_list_and_frame_have_the_verdict(estimated: Path) -> None:
    """With the largest error of what the study stands by, and nothing where nothing was found."""
    listed = package.studies(str(estimated)).set_index("name")
    found = {name for name, verdict in listed["verdict"].items() if verdict == "found"}
    assert found == {"matched", "searched", "noisy"}
    assert set(listed["verdict"].drop(list(found))) == {"not found"}
    assert listed["max_error"]["searched"] < 1e-9
    assert listed["max_error"].isna()["hidden"]
    attributes = package.lumps("hidden", str(estimated)).attrs
    assert (attributes["verdict"], attributes["source"]) == ("not found", "estimate")
    assert "explain" in attributes["reasons"][0]


def test_frame_of_an_estimate_is_that_of_lumps_whichever_sampler(estimated: Path) -> None:
    """The same columns; the same table where the study stands by its estimate; no interval where nothing was found."""
    lumps = {name: package.lumps(name, str(estimated)) for name in ("matched", "searched")}
    matched, searched, hidden = (
        package.study(name, str(estimated)).estimate for name in ("matched", "searched", "hidden-searched")
    )
    assert_frame_equal(matched, lumps["matched"], check_exact=True)
    assert_frame_equal(searched, lumps["searched"], check_exact=True)
    assert list(searched) == list(lumps["searched"]) == list(hidden)
    assert searched["identified"].to_numpy() == pytest.approx(matched["identified"].to_numpy(), rel=1e-9)
    assert (searched["low"] <= searched["identified"]).all()
    assert (searched["identified"] <= searched["high"]).all()
    assert hidden["identified"].notna().all()
    assert hidden[["sd", "low", "high"]].isna().all(axis=None)


def test_validation_is_of_the_estimate_with_its_inertia_lumps(metaid: Metaid) -> None:
    """Each lump by its name: behind those of inertia come those of friction."""
    spec = load_study("full-three-link", {"trials": 4})
    store = Store("metaid.db", create=True)
    create_study(store, spec, "rubbing")
    run_study(store, "rubbing")
    store.close()
    problem, lumps = Problem(spec), package.lumps("rubbing").set_index("name")
    assert np.abs(lumps["error"]).max() < 1e-6
    identified = problem.robot.law_at(lumps["identified"].to_dict())
    assert package.validate("rubbing", pushes=1).summary() == validate_law(problem, identified, 1, 0).summary()


def test_validation_of_lumps_that_were_not_found_is_refused(estimated: Path) -> None:
    """The nominal lumps are not passed off as identified ones."""
    with pytest.raises(StudyError, match="its verdict is 'not found': the model does not explain"):
        package.validate("hidden", str(estimated), pushes=1)
