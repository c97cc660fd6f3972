"""What all trials of a study say together: in frames and JSON, in the terminal, and where nothing can be said."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Finished
from pandas.testing import assert_frame_equal

import metaid as package
from metaid.errors import StudyError
from metaid.results.overview import summarized
from metaid.results.snapshot import read_snapshot
from metaid.results.tables import lumps_table, studies_frame
from metaid.results.validation import validate_factors
from metaid.store.database import Store
from metaid.study.create import create_study
from metaid.study.problem import Problem, load_study
from metaid.study.run import run_study

Metaid = Callable[..., Finished]
INERTIA = ["inertia_1", "inertia_2", "inertia_3"]


def test_every_study_has_the_estimate_in_its_json_whatever_it_stands_by(estimated: Path) -> None:
    """With the misfit, what it must be below, how many trials it is of, how early it was there, and all nine lumps."""
    for name, source in (("matched", "estimate"), ("searched", "best trial")):
        shown = package.summary(name, str(estimated))
        estimate = shown["estimate"]
        assert shown["source"] == source
        assert shown["misfit"] == estimate["misfit"] < estimate["explained_below"]
        assert estimate["explains"]
        assert estimate["trials"] == min(shown["trials"]["total"], 32)
        assert 1 <= estimate["known_from"] <= 2
        assert estimate["max_error"] < 1e-9
        assert [lump["name"] for lump in estimate["lumps"]][-3:] == INERTIA
        assert all(lump["sd"] > 0.0 for lump in estimate["lumps"])


def test_study_that_stands_by_its_estimate_shows_it_once(metaid: Metaid, estimated: Path) -> None:
    """One table of all lumps, and below it what they are worth."""
    out = metaid("study", "show", "matched", "--storage", str(estimated)).out
    assert out.count("gravity_1") == out.count("inertia_3") == 1
    words = " ".join(out.split())
    assert "estimate from all 2 trials: the model explains what was seen: misfit " in words
    assert "(explained: below 3); low to high is the 95 % interval; largest error " in words
    assert "best " in words
    assert "at trial 1" in words


def test_study_of_any_other_sampler_shows_the_estimate_below_the_best_trial(metaid: Metaid, estimated: Path) -> None:
    """In a table of its own, with how early it was there."""
    words = " ".join(metaid("study", "show", "searched", "--storage", str(estimated)).out.split())
    best, title, estimate = words.partition("Estimate from the first 32 trials")
    assert title
    assert "inertia_1" not in best
    assert "inertia_1" in estimate
    assert "the model explains what was seen: misfit " in estimate
    assert "every lump was known to 0.1% after the first of 40 trials" in estimate


@pytest.mark.parametrize(("name", "which"), [("hidden", "all 4 trials"), ("hidden-searched", "the first 32 trials")])
def test_estimate_that_explains_nothing_prints_no_lump(metaid: Metaid, estimated: Path, name: str, which: str) -> None:
    """One line says that it was not found, from how many trials, and why; no error, no interval, no inertia lump."""
    done = metaid("study", "show", name, "--storage", str(estimated))
    assert done.status == 0
    words = " ".join(done.out.split())
    assert f"stimate from {which}: NOT FOUND: the model does not explain what was seen: misfit " in words
    assert "(explained: below 3)" in words
    assert "95 %" not in words
    assert "not identified" not in words
    for row in (line.split() for line in done.out.splitlines() if "inertia_" in line):
        assert row[2:5] == ["–"] * 3
        assert row[6] == "–"


@pytest.mark.parametrize("name", ["hidden", "hidden-searched"])
def test_json_of_a_model_that_explains_nothing_has_nulls(metaid: Metaid, estimated: Path, name: str) -> None:
    """It is JSON all the same: no lump of the estimate has a number, nor has its largest error."""
    shown = json.loads(metaid("study", "show", name, "--storage", str(estimated), "--json").out)
    estimate = shown["estimate"]
    assert estimate["misfit"] > 1e3
    assert not estimate["explains"]
    assert estimate["known_from"] is estimate["max_error"] is None
    own = shown["lumps"] if name == "hidden" else []
    for lump in estimate["lumps"] + own:
        assert {lump[key] for key in ("factor", "identified", "sd", "low", "high", "error")} == {None}
        assert not lump["determined"]
    if name == "hidden":
        assert shown["max_error"] is None


NONE_MADE = {
    "[estimate] enabled is false": ("three-link", {"estimate.enabled": False, "trials": 10}),
    "its episodes keep no windows of motion": ("ten-link", {"episode.count": 700, "episode.steps": 20, "trials": 2}),
}


@pytest.mark.parametrize("why", NONE_MADE)
def test_study_without_an_estimate_says_why_in_one_line(metaid: Metaid, why: str) -> None:
    """Below the best trial, and in its JSON."""
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
        package.estimate("without")
    assert str(refused.value).endswith(why)


def test_study_without_a_trial_says_nothing_of_an_estimate(metaid: Metaid) -> None:
    """There is nothing to be missed yet."""
    metaid("study", "create", "three-link")
    assert "stimate" not in metaid("study", "show", "three-link").out
    with pytest.raises(StudyError, match="no trial yet: run it first"):
        package.estimate("three-link")


def test_list_of_studies_makes_no_estimate_that_no_study_stands_by(estimated: Path) -> None:
    """The largest error in the list is that of the best trial, and needs no twin; a reading makes the estimate once."""
    snapshot = read_snapshot(Store(str(estimated)), "searched")
    lumps = lumps_table(snapshot)
    assert "estimate" not in vars(snapshot)
    shown = summarized(snapshot, lumps)
    assert snapshot.estimate is vars(snapshot)["estimate"]
    listed = studies_frame(Store(str(estimated))).set_index("name")["max_error"]
    assert listed["searched"] == shown["max_error"]
    assert listed["matched"] < 1e-9
    assert listed.isna()["hidden"]


def test_frame_of_an_estimate_is_that_of_lumps_whichever_sampler(estimated: Path) -> None:
    """The same columns; the same table where the study stands by its estimate; NaN where nothing was found."""
    lumps = {name: package.lumps(name, str(estimated)) for name in ("matched", "searched")}
    matched, searched, hidden = (
        package.estimate(name, str(estimated)) for name in ("matched", "searched", "hidden-searched")
    )
    assert_frame_equal(matched, lumps["matched"], check_exact=True)
    assert list(searched) == list(lumps["searched"]) == list(hidden)
    assert searched["identified"].to_numpy() == pytest.approx(matched["identified"].to_numpy(), rel=1e-9)
    assert (searched["low"] <= searched["identified"]).all()
    assert (searched["identified"] <= searched["high"]).all()
    assert hidden[["factor", "identified", "sd", "low", "high", "error"]].isna().all(axis=None)


def test_validation_is_of_the_estimate_with_its_inertia_lumps(metaid: Metaid) -> None:
    """Each lump by its name: behind those of inertia come those of friction."""
    spec = load_study("full-three-link", {"trials": 4})
    changes = {"sampler": "output-error", "inertia": None}
    spec = spec.model_copy(update={"study": spec.study.model_copy(update=changes)})
    store = Store("metaid.db", create=True)
    create_study(store, spec, "rubbing")
    run_study(store, "rubbing")
    store.close()
    problem, lumps = Problem(spec), package.lumps("rubbing").set_index("name")
    factors, inertia = lumps["factor"][problem.names].to_numpy(), lumps["identified"][INERTIA].to_numpy()
    assert np.abs(lumps["error"]).max() < 1e-6
    assert (
        package.validate("rubbing", pushes=1).summary() == validate_factors(problem, factors, 1, 0, inertia).summary()
    )


def test_validation_of_lumps_that_were_not_found_is_refused(estimated: Path) -> None:
    """The nominal lumps are not passed off as identified ones."""
    with pytest.raises(StudyError, match="no lump that its trials determine"):
        package.validate("hidden", str(estimated), pushes=1)
