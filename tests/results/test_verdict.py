"""Verdicts: what was found, what was not and why, whatever the sampler; nothing is known where there is no result."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chain_studies import SMALL_PUSHES, chain_study, random_chain
from conftest import Finished

from metaid.errors import StudyError
from metaid.plant import FaultSettings, LinkSettings, PlantSettings
from metaid.results import Verdict, read_snapshot, summary
from metaid.store import Store
from metaid.study import create_study, load_study, run_study

pytestmark = pytest.mark.slow

NO_ESTIMATE = {"estimate.enabled": False}
TIGHT = {"search.low": 0.9, "search.high": 1.1, "search.widen": False}


def verdict_of(
    folder: Path, changes: dict[str, Any], study: str = "three-link-coast", trials: int | None = None
) -> Verdict:
    """The verdict on a study that is run, up to that number of `trials` where it is given."""
    store = Store(str(folder / "metaid.db"), create=True)
    create_study(store, load_study(study, changes), "study")
    run_study(store, "study", trials)
    return read_snapshot(store, "study").verdict


def knows_nothing(verdict: Verdict) -> bool:
    """Whether no lump of it has a range or is said to be determined, and tables show no value of it."""
    ranges, shown = verdict.lumps[["sd", "low", "high"]], verdict.shown[["factor", "identified", "error"]]
    is_blank = ranges.isna().all(axis=None) and shown.isna().all(axis=None)
    return bool(is_blank and not verdict.lumps["determined"].any())


def test_bounds_that_exclude_the_truth_are_named(tmp_path: Path) -> None:
    """A search held back by its bounds is not found: the reasons have its best value, and lumps with what to set."""
    verdict = verdict_of(tmp_path, {**TIGHT, **NO_ESTIMATE, "trials": 150})
    assert (verdict.word, verdict.source) == ("not found", "best trial")
    assert knows_nothing(verdict)
    value, *lumps = verdict.reasons
    assert "times the 0.00053 Hz that spectral can tell from none" in value
    assert lumps
    assert all("is at its bound" in reason and "--set search." in reason for reason in lumps)


def test_estimate_is_not_held_by_the_bounds_of_the_search(tmp_path: Path) -> None:
    """The same trials, matched, have every lump: none of the intervals leaves the truth out."""
    verdict = verdict_of(tmp_path, {**TIGHT, "trials": 40})
    assert (verdict.word, verdict.source) == ("found", "estimate")
    assert ((verdict.lumps["low"] <= verdict.lumps["true"]) & (verdict.lumps["true"] <= verdict.lumps["high"])).all()
    assert verdict.lumps["factor"].min() < 0.7


def test_tip_far_heavier_than_believed_is_found_beyond_the_bounds(tmp_path: Path) -> None:
    """Four links, gravity_4 2.5 times the nominal, default bounds: every interval holds the truth."""
    true, nominal = random_chain(4, 1)
    nominal = *nominal[:3], true[3].model_copy(update={"mass": true[3].mass / 2.5})
    spec = load_study("three-link-coast", {"trials": 40})
    spec = spec.model_copy(update={"plant": PlantSettings(links=true), "nominal": nominal})
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, spec, "study")
    run_study(store, "study")
    verdict = read_snapshot(store, "study").verdict
    assert verdict.word == "found"
    assert verdict.lumps["factor"].max() > 2.2
    assert ((verdict.lumps["low"] <= verdict.lumps["true"]) & (verdict.lumps["true"] <= verdict.lumps["high"])).all()


@pytest.mark.parametrize("fault", [{"damping": 0.05}, {"stiffness": 1.0}])
@pytest.mark.parametrize(
    ("study", "sampler"),
    [("three-link-coast", "cmaes"), ("three-link-coast", "output-error"), ("three-link", "cmaes")],
)
def test_what_the_model_does_not_know_is_not_found(
    fault: dict[str, float], study: str, sampler: str, tmp_path: Path
) -> None:
    """Hidden friction or a hidden spring: the misfit says so, whichever the sampler, and whether pushes are strong and
    short or small and counted.
    """
    counted = SMALL_PUSHES if study == "three-link" else {}
    spec = load_study(study, {"sampler": sampler, "trials": 2, **counted})
    assert isinstance(spec.plant, PlantSettings)
    links = tuple(link.model_copy(update=fault) for link in spec.plant.links)
    spec = spec.model_copy(update={"plant": spec.plant.model_copy(update={"links": links})})
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, spec, "study")
    run_study(store, "study")
    verdict = read_snapshot(store, "study").verdict
    assert verdict.word == "not found"
    assert "the model does not explain what was seen" in verdict.reasons[-1]
    assert knows_nothing(verdict)


def test_count_alone_is_not_called_found(tmp_path: Path) -> None:
    """Three links, counted, without an estimate: it printed a gravity lump 70 % off."""
    changes = {"episode.measure": "count", "search.coordinates": "plain", "trials": 40, **NO_ESTIMATE}
    verdict = verdict_of(tmp_path, changes)
    assert verdict.word == "not found"
    assert knows_nothing(verdict)
    assert "count alone cannot tell friction from wrong lumps" in verdict.reasons[-1]


def test_trials_that_are_left_make_it_unfinished_and_give_no_range(tmp_path: Path) -> None:
    """The best so far has a value and no range; the verdict says how many trials are done."""
    verdict = verdict_of(tmp_path, NO_ESTIMATE, trials=30)
    assert verdict.word == "unfinished"
    assert verdict.reasons[0] == "30 of 600 trials are done"
    assert verdict.lumps[["sd", "low", "high"]].isna().all(axis=None)


def test_best_trial_that_coasts_is_found_with_a_range_that_holds_the_truth(tmp_path: Path) -> None:
    """Without an estimate, by the ellipsoid of the pushes' sensitivity: `cmaes` ends near the minimum."""
    verdict = verdict_of(tmp_path, {"trials": 800, **NO_ESTIMATE})
    assert (verdict.word, verdict.source) == ("found", "best trial")
    lumps = verdict.lumps
    assert ((lumps["low"] <= lumps["true"]) & (lumps["true"] <= lumps["high"])).all()
    assert np.abs(lumps["high"] / lumps["low"] - 1.0).max() < 0.05


def test_searcher_that_stopped_by_itself_is_not_unfinished(tmp_path: Path) -> None:
    """Trials are left, but nothing will use them."""
    verdict = verdict_of(tmp_path, NO_ESTIMATE, "paper-two-link")
    assert verdict.word == "not found"
    assert not any("trials are done" in reason for reason in verdict.reasons)


def test_study_of_frequencies_without_a_trial_is_unfinished(tmp_path: Path) -> None:
    """It is shown with a row for each lump that is searched, and no number."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, load_study("three-link"), "study")
    verdict = read_snapshot(store, "study").verdict
    assert verdict.word == "unfinished"
    assert len(verdict.lumps) == 6
    assert verdict.lumps[["identified", "low", "high"]].isna().all(axis=None)


def test_run_that_found_nothing_ends_with_status_3(metaid: Callable[..., Finished]) -> None:
    """When all trials are spent, and not before; `show` ends with 0."""
    changes = ("estimate.enabled=false", "sampler=random", "trials=20")
    metaid("study", "create", "three-link-coast", *(f"--set={change}" for change in changes))
    assert metaid("study", "run", "three-link-coast", "--quiet", "--trials", "10").status == 0
    done = metaid("study", "run", "three-link-coast", "--quiet")
    assert done.status == 3
    assert done.verdict[0].startswith("NOT FOUND: the best value, ")
    shown = metaid("study", "show", "three-link-coast", "--json")
    assert shown.status == 0
    assert json.loads(shown.out)["verdict"] == "not found"


@pytest.mark.parametrize("sampler", ["cmaes", "tpe"])
def test_noisy_angles_beside_exact_speeds_leave_the_truth_in_the_intervals(sampler: str, tmp_path: Path) -> None:
    """`spectral` with a milliradian of noise: by the estimate from the readings, every lump within 1 %."""
    spec = load_study("three-link-coast", {"sampler": sampler, "trials": 12})
    assert isinstance(spec.plant, PlantSettings)
    faults = FaultSettings(angle_noise=1e-3)
    spec = spec.model_copy(update={"plant": spec.plant.model_copy(update={"faults": faults})})
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, spec, "study")
    run_study(store, "study")
    verdict = read_snapshot(store, "study").verdict
    assert (verdict.word, verdict.source) == ("found", "estimate")
    lumps = verdict.lumps
    assert lumps["error"].abs().max() < 0.01
    assert (np.abs(lumps["identified"] - lumps["true"]) < 4.0 * lumps["sd"]).all()


COUNTED = {"trials": 4, "search.probes": 4, "episode.steps": 4000}


def test_whole_counts_are_a_result_with_the_extent_of_what_counts_the_same(tmp_path: Path) -> None:
    """The misfit is the number of counts that differ, none; no standard deviation; the truth lies in every extent."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, load_study("two-link-counted", COUNTED), "study")
    run_study(store, "study")
    shown = summary(store, "study")
    assert (shown["verdict"], shown["source"], shown["misfit"]) == ("found", "estimate", 0.0)
    assert shown["estimate"]["counts"] == 4 * 4 * 20 * 2
    assert shown["max_error"] < 0.02
    for lump in shown["lumps"]:
        assert lump["sd"] is None
        assert lump["low"] <= lump["true"] <= lump["high"]


def test_counts_that_no_model_shows_are_not_found(tmp_path: Path) -> None:
    """Where a wrong length is believed to be exact, some counts differ; it is said how many, and no lump is given."""
    changes = {
        **COUNTED,
        "trials": 2,
        "search.probes": 2,
        "episode.steps": 2000,
        "estimate.lengths": "exact",
        "nominal": "longer.toml",
    }
    text = (Path("studies") / "two-link-counted.toml").read_text(encoding="utf-8")
    links = text[text.index("[[nominal.links]]") :].replace("nominal.links", "links")
    (tmp_path / "longer.toml").write_text(links.replace("length = 0.42", "length = 0.5"))
    changes["nominal"] = str(tmp_path / "longer.toml")
    verdict = verdict_of(tmp_path, changes, "two-link-counted")
    assert (verdict.word, verdict.source) == ("not found", "estimate")
    assert knows_nothing(verdict)
    assert "of 320 counts differ" in verdict.reasons[0]


def test_counts_are_not_compared_on_a_noisy_plant() -> None:
    """One line says so, and what to do."""
    with pytest.raises(StudyError, match="compare: 'count' needs a plant without noise"):
        load_study("noisy-three-link", {"estimate.compare": "count"})


# One link as it is and as it is believed to be: length, mass, centre of mass, inertia.
LONG = (0.562, 1.08, 0.379, 0.0153), (0.562, 1.35, 0.324, 0.0121)
SHORT = (0.223, 1.46, 0.137, 0.00399), (0.223, 1.34, 0.131, 0.00496)


def of_a_noisy_link(
    folder: Path, numbers: tuple[tuple[float, ...], tuple[float, ...]], trials: int, **more: float
) -> Verdict:
    """The verdict of a study by cmaes of one link on a noisy plant, which has something more than the model knows."""
    keys = "length", "mass", "com", "inertia"
    true, nominal = ((LinkSettings(**dict(zip(keys, each, strict=True))),) for each in numbers)
    faults = {"angle_noise": 1e-3, "speed_sensor": False, "push_noise": 0.02}
    settings: dict[str, Any] = {"sampler": "cmaes", "trials": trials, "seed": 7, "episode": {"measure": "smoothed"}}
    with closing(Store(str(folder / "metaid.db"), create=True)) as store:
        create_study(store, chain_study((true, nominal), faults, more, **settings))
        run_study(store, "chain")
        return read_snapshot(store, "chain").verdict


def test_intervals_hold_what_a_force_that_is_hinted_at_would_change(tmp_path: Path) -> None:
    """Dry friction of 0.005 N m in one link, too little to be seen beside noise: it moved gravity by ten deviations."""
    verdict = of_a_noisy_link(tmp_path, LONG, trials=12, frictionloss=0.005)
    assert verdict.word == "found"
    assert "the trials hint at dry friction, 0.0" in verdict.reasons[-1]
    assert ((verdict.lumps["low"] < verdict.lumps["true"]) & (verdict.lumps["true"] < verdict.lumps["high"])).all()


def test_force_that_trials_cannot_show_is_in_the_systematic_deviation(tmp_path: Path) -> None:
    """A spring of 0.2 N m/rad in one link: gravity is wrong by many deviations, and by few systematic ones."""
    gravity = of_a_noisy_link(tmp_path, SHORT, trials=4, stiffness=0.2).lumps.iloc[0]
    error = abs(gravity["identified"] - gravity["true"])
    assert 3.0 * gravity["sd"] < error < 2.0 * gravity["sd_systematic"]


def test_force_that_the_model_has_not_is_named_with_its_size_and_what_to_do(tmp_path: Path) -> None:
    """A spring of 0.5 N m/rad in one link, of which the misfit says nothing: it passes for noise. Intervals hold what
    it would change.
    """
    judged = of_a_noisy_link(tmp_path, SHORT, trials=29, stiffness=0.5)
    reasons, gravity = "; ".join(judged.reasons), judged.lumps.iloc[0]
    assert judged.word == "approximate"
    assert gravity["low"] < gravity["true"] < gravity["high"]
    assert not gravity["determined"]
    assert re.search(r"shows a force that the model has not, a spring, 0\.5\d N m/rad or one like it", reasons)
    assert "take it off" in reasons
    misfit, least = re.findall(r"misfit ([\d.]+) \(explained: below ([\d.]+)\)", reasons)[0]
    assert float(misfit) < float(least)


def test_trials_that_all_fall_in_their_first_push_say_so_and_what_to_do(tmp_path: Path) -> None:
    """Motors that hold no link: nothing after the first push is ever seen."""
    faults = {"angle_noise": 1e-3, "speed_sensor": False, "torque_limit": 0.01}
    with closing(Store(str(tmp_path / "metaid.db"), create=True)) as store:
        create_study(store, chain_study(random_chain(3, 1), faults, trials=2), "study")
        run_study(store, "study")
        verdict = read_snapshot(store, "study").verdict
    assert verdict.word == "not found"
    assert verdict.reasons[0].startswith("every trial fell in its first push: push less (episode.peak_speed)")
