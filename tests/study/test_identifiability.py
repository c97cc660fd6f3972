"""What can be determined is known before any trial, and is what the trials then show."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chain_studies import SMALL_PUSHES, chain_study, random_chain
from conftest import Finished

from metaid import results
from metaid.plant import PlantSettings
from metaid.results.lump_tables import best_table
from metaid.store import Store
from metaid.study import Problem, create_study, identifiability, load_study, run_study

Metaid = Callable[..., Finished]


@pytest.mark.parametrize("study", ["three-link-coast", "two-link-tpe"])
def test_spectral_with_rich_pushes_determines_every_lump(study: str) -> None:
    """All lumps to better than 1 %."""
    found = identifiability(Problem(load_study(study)))
    assert all(found.determined)
    assert found.resolution.max() < 0.01
    assert found.combinations == ()


def test_count_after_a_push_at_the_tip_determines_no_coriolis_lump() -> None:
    """Gravity lumps of two links to about a hundredth, the Coriolis lump not at all."""
    found = identifiability(Problem(load_study("two-link-tpe", {"episode.measure": "count"})))
    assert found.undetermined_names == ["coriolis_1_2"]
    assert found.resolution[:2].max() < 0.02
    assert np.isinf(found.resolution[2])


@pytest.mark.parametrize(("bound", "factor"), [("low", 0.999), ("high", 1.001)])
def test_lump_whose_bound_the_count_does_not_notice_is_not_determined(bound: str, factor: float) -> None:
    """Either bound of the study: the search may go as far, and no trial there would be worse."""
    changes = {"episode.measure": "count", "search.start": 1.0, f"search.{bound}": {"gravity_1": factor}}
    found = identifiability(Problem(load_study("two-link-tpe", changes)))
    assert np.isinf(found.resolution[0])
    assert found.resolution[1] < 0.02


@pytest.mark.parametrize(("low", "high"), [(0.5, 1.0), (1.0, 2.0), (0.5, 0.9), (1.1, 2.0)])
def test_bounds_on_one_side_of_the_nominal_model_leave_the_other_side_out(low: float, high: float) -> None:
    """The nominal model may be a bound or be out of bounds; what is left is found as finely."""
    changes = {"episode.measure": "count", "search.start": 0.5 * (low + high), "search.low": low, "search.high": high}
    found = identifiability(Problem(load_study("two-link-tpe", changes)))
    assert found.resolution[:2].max() < 0.02


def test_one_push_at_the_tip_leaves_combinations_that_cannot_be_told() -> None:
    """Spectral with too poor a push: some lumps are not determined, and moving along such a combination is not
    noticed.
    """
    changes = {"episode.pushes": [[0.0, 0.0, 0.05]], "episode.steps": 150, "search.coordinates": "plain"}
    problem = Problem(load_study("three-link-coast", changes))
    found = identifiability(problem)
    assert found.undetermined_names
    exact = problem.open_plant().chain.lumps.vector / problem.nominal.lumps.vector
    rich = Problem(load_study("three-link-coast")).make_objective()
    poor = problem.make_objective()
    moved = exact * (1 + 0.05 * np.array([found.combinations[0].get(name, 0.0) for name in problem.names]))
    assert poor.evaluate(moved).value < 0.02 * rich.evaluate(moved).value


@pytest.mark.slow
def test_resolution_is_the_range_that_the_trials_show(tmp_path: Path) -> None:
    """The range of trials as good as the best is about as wide as was foreseen, for every lump."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, load_study("three-link-coast", {"trials": 1500, "estimate.enabled": False}), "study")
    run_study(store, "study")
    lumps = results.lumps_frame(store, "study")
    foreseen = identifiability(Problem(load_study("three-link-coast"))).resolution
    width = ((lumps["high"] - lumps["low"]) / (2 * lumps["identified"])).to_numpy()
    assert (width < 2.5 * foreseen).all()
    assert (width > 0.1 * foreseen).all()


def test_check_and_create_say_what_cannot_be_found(metaid: Metaid) -> None:
    """`study check` names the lumps before any trial; `study create` warns in one line, and only if there is
    something to say.
    """
    assert metaid("study", "check", "three-link-coast").status == 0
    checked = json.loads(metaid("study", "check", "two-link-tpe", "--set", "episode.measure=count", "--json").out)
    assert {lump["name"]: lump["determined"] for lump in checked["lumps"]} == {
        "gravity_1": True,
        "gravity_2": True,
        "coriolis_1_2": False,
    }
    assert metaid("study", "create", "three-link-coast").err == ""
    warned = metaid("study", "create", "two-link-tpe", "--set", "episode.measure=count")
    assert warned.status == 0
    assert warned.err.count("\n") == 1
    assert "cannot determine coriolis_1_2" in warned.err


@pytest.mark.slow
def test_what_the_pushes_cannot_tell_is_not_determined_by_the_best_trial(tmp_path: Path) -> None:
    """A study may run all the same, and say so of its best trial; matched, the same pushes determine every lump."""
    changes = {"episode.pushes": [[0.0, 0.0, 0.05]], "episode.steps": 150, "search.coordinates": "plain", "trials": 60}
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, load_study("three-link-coast", changes), "study")
    run_study(store, "study")
    missed = identifiability(Problem(load_study("three-link-coast", changes))).undetermined_names
    by_best_trial = best_table(results.read_snapshot(store, "study")).set_index("name")
    assert missed
    assert not by_best_trial["determined"][missed].any()
    shown = results.summary(store, "study")
    assert (shown["verdict"], shown["source"]) == ("found", "estimate")
    assert shown["max_error"] < 1e-6


def test_estimate_is_checked_by_its_own_covariance_and_not_by_the_measure(metaid: Callable[..., Finished]) -> None:
    """Frequencies that are minimised do not determine Coriolis lumps; matched, they determine inertia lumps too,
    whichever sampler proposed the candidates.
    """
    for sampler in ("output-error", "cmaes"):
        found = identifiability(Problem(load_study("three-link-oscillation", {"sampler": sampler})))
        assert found.names[-1] == "inertia_3"
        assert max(found.resolution) < 1e-6
    alone = {"sampler": "cmaes", "estimate.enabled": False}
    minimised = identifiability(Problem(load_study("three-link-oscillation", alone)))
    assert minimised.undetermined_names == ["coriolis_1_2", "coriolis_1_3", "coriolis_2_3"]
    created = metaid("study", "create", "three-link-oscillation")
    assert created.status == 0
    assert created.err == ""
    checked = metaid("study", "check", "three-link-oscillation")
    assert "the estimate with these pushes" in " ".join(checked.out.split())
    assert "under 0.01%" in checked.out


def test_estimate_is_checked_on_the_nominal_model_whatever_the_plant_is() -> None:
    """The check of a study whose plant is its nominal model says the same, for the start speeds are the same."""
    spec = load_study("three-link", SMALL_PUSHES)
    assert isinstance(spec.plant, PlantSettings)
    alike = spec.model_copy(update={"plant": spec.plant.model_copy(update={"links": spec.nominal})})
    found, expected = identifiability(Problem(spec)).resolution, identifiability(Problem(alike)).resolution
    assert found == pytest.approx(expected, rel=1e-3)


def test_noise_sets_what_the_estimate_promises() -> None:
    """On a noisy plant the promise is an interval of some tenths of a percent, wider with more noise."""
    quiet = identifiability(Problem(load_study("noisy-three-link")))
    assert all(quiet.determined)
    assert 1e-4 < max(quiet.resolution) < 1e-2


def test_noise_of_the_plant_is_counted_in() -> None:
    """With a milliradian on the angles and exact speeds `spectral` promises less than without."""
    noisy, ideal = (
        identifiability(Problem(chain_study(random_chain(2, 1), faults, sampler="cmaes", trials=400)))
        for faults in ({"angle_noise": 1e-3}, {})
    )
    assert (noisy.resolution > 1.5 * ideal.resolution).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sampler", "measure", "faults"),
    [
        ("cmaes", "spectral", {}),
        ("cmaes", "spectral", {"angle_noise": 1e-3}),
        ("cmaes", "smoothed", {"angle_noise": 1e-3, "speed_sensor": False, "push_noise": 0.02}),
        ("output-error", "spectral", {}),
    ],
    ids=["cmaes", "exact speeds", "pushes that differ", "estimate"],
)
def test_what_is_promised_is_found(sampler: str, measure: str, faults: dict[str, Any], tmp_path: Path) -> None:
    """No lump of two links is further from the truth."""
    is_matched = sampler == "output-error"
    settings: dict[str, Any] = {"episode": {"measure": measure}, "estimate": {"enabled": is_matched}, "seed": 1}
    spec = chain_study(random_chain(2, 1), faults, sampler=sampler, trials=6 if is_matched else 400, **settings)
    promised = identifiability(Problem(spec))
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, spec)
    run_study(store, "chain")
    table = results.lumps_frame(store, "chain") if is_matched else best_table(results.read_snapshot(store, "chain"))
    errors = np.abs(table["error"].to_numpy()) / promised.resolution
    known = errors[np.array(promised.determined)]
    assert len(known) >= 3
    assert known.max() < 1.0


def test_check_says_what_the_bounds_exclude(metaid: Metaid) -> None:
    """The least and the largest value of each lump; an estimate has no bounds."""
    shown = metaid("study", "check", "three-link-coast").out
    assert "a lump beyond from and to is excluded by the bounds: one that holds the search back is moved away" in shown
    narrow = "--set", "search.high=1.5", "--set", "search.widen=false"
    lumps = json.loads(metaid("study", "check", "three-link-coast", *narrow, "--json").out)["lumps"]
    assert (lumps[0]["low"], lumps[0]["high"]) == pytest.approx((0.5 * 0.9695, 1.5 * 0.9695))
    assert (
        "excluded by the bounds (search.low, search.high)" in metaid("study", "check", "three-link-coast", *narrow).out
    )
    matched = json.loads(metaid("study", "check", "three-link-coast", "--set", "sampler=output-error", "--json").out)[
        "lumps"
    ]
    assert matched[0]["high"] is None
