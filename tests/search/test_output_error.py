"""The output-error sampler: a handful of trials, for every chain, whoever evaluates them and however often stopped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chain_studies import Links, chain_study, random_chain
from conftest import Finished, best_error
from pandas.testing import assert_frame_equal

from metaid import results
from metaid.errors import StudyError
from metaid.estimation import Estimate, Experiment, SeenTrial
from metaid.plant import LinkSettings, PlantSettings
from metaid.store import Store
from metaid.study import (
    MOST_TRIALS,
    EpisodeSettings,
    SearchSettings,
    StudySpec,
    create_study,
    load_study,
    run_study,
)
from metaid.study.settings import EstimateSettings

OSCILLATION = EpisodeSettings(measure="crossing", pushes="tip", steps=3000)


def spec_of(nlink: int, seed: int, link: dict[str, float] | None = None, **settings: Any) -> StudySpec:
    """A study of a random chain whose nominal model is wrong by up to 30 %; its links have something more hidden."""
    return chain_study(random_chain(nlink, seed), None, link, **{"trials": 8, **settings})


def scaled(links: Links, masses: Sequence[float], lengths: Sequence[float]) -> Links:
    """Links with masses and lengths times these factors (nlink each); centres of mass and inertias follow."""

    def one(link: LinkSettings, mass: float, length: float) -> LinkSettings:
        powers = {"length": (0, 1), "mass": (1, 0), "com": (0, 1), "inertia": (1, 2)}
        sizes = {key: getattr(link, key) * mass**p * length**q for key, (p, q) in powers.items()}
        return link.model_copy(update=sizes)

    return tuple(map(one, links, masses, lengths))


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """An empty study DB."""
    return Store(str(tmp_path / "metaid.db"), create=True)


@pytest.mark.parametrize(("nlink", "seed"), [(1, 3), (2, 4), (3, 5), (5, 6), (7, 7)])
def test_all_lumps_and_all_inertia_lumps_are_found_in_a_handful_of_trials(nlink: int, seed: int, store: Store) -> None:
    """To rounding, by the second trial (one link: the third), which coasts, so the study ends there."""
    create_study(store, spec_of(nlink, seed))
    progress = run_study(store, "chain")
    assert progress.trials <= 2 + (nlink == 1)
    shown = results.summary(store, "chain")
    assert shown["source"] == "estimate"
    assert shown["misfit"] < 1.0
    assert [lump["name"] for lump in shown["lumps"]][-1] == f"inertia_{nlink}"
    assert shown["max_error"] < 1e-9
    for lump in shown["lumps"]:
        assert lump["determined"]
        assert lump["sd"] > 0.0
        assert lump["low"] <= lump["identified"] <= lump["high"]


def test_first_law_over_compensates_and_nothing_falls(store: Store) -> None:
    """So the first trial shows the mass matrix, and a rig is not at risk."""
    create_study(store, spec_of(3, 1))
    run_study(store, "chain")
    trials = results.trials_frame(store, "chain")
    assert (trials.loc[0, ["gravity_1", "gravity_2", "gravity_3"]] == 1.5).all()
    assert (trials["state"] == "COMPLETE").all()


def test_small_oscillations_alone_give_the_full_dynamics(store: Store) -> None:
    """The paper's own experiment: a small push, frequencies per joint, and never a fall."""
    create_study(store, spec_of(3, 2, episode=OSCILLATION))
    run_study(store, "chain")
    shown = results.summary(store, "chain")
    assert shown["trials"]["total"] <= 8
    assert shown["trials"]["pruned"] == 0
    assert shown["max_error"] < 1e-6


@pytest.mark.slow
def test_trial_that_coasts_does_not_lead_the_estimate_astray(store: Store) -> None:
    """From the nominal model the frequencies of ten links, of which the last trial's are nothing, end in a wrong
    minimum; the fit begins where the probes lead, as that of the search did.
    """
    create_study(store, load_study("ten-link-oscillation"))
    assert run_study(store, "ten-link-oscillation").trials == 3
    shown = results.summary(store, "ten-link-oscillation")
    assert shown["misfit"] < 1.0
    assert shown["max_error"] < 1e-6
    assert shown["trials"]["pruned"] == 0


def test_exact_lengths_give_coriolis_lumps_that_follow_from_gravity(store: Store) -> None:
    """With `lengths = "exact"` there are two unknowns a link, and all lumps are shown all the same."""
    create_study(store, spec_of(3, 8, estimate=EstimateSettings(lengths="exact")))
    run_study(store, "chain")
    lumps = results.lumps_frame(store, "chain").set_index("name")
    assert len(lumps) == 9
    assert lumps["error"].abs().max() < 1e-9
    share = lumps["sd"] / lumps["identified"]
    assert share["coriolis_1_3"] == pytest.approx(share["gravity_3"])


def test_table_is_the_same_for_any_workers_and_however_often_it_was_stopped(store: Store) -> None:
    """The estimate before each trial follows from the DB alone, bit for bit."""
    spec = spec_of(4, 9, episode=EpisodeSettings(steps=40))
    for name, workers, stops in (("one", 1, (8,)), ("two", 2, (8,)), ("stopped", 3, (1, 2, 8))):
        create_study(store, spec, name)
        for stop in stops:
            run_study(store, name, trials=stop, workers=workers)
    one, two, stopped = (results.trials_frame(store, name) for name in ("one", "two", "stopped"))
    assert len(one) > 1
    assert_frame_equal(one, two, check_exact=True)
    assert_frame_equal(one, stopped, check_exact=True)
    lumps = [results.lumps_frame(store, name) for name in ("one", "two", "stopped")]
    assert_frame_equal(lumps[0], lumps[1], check_exact=True)
    assert_frame_equal(lumps[0], lumps[2], check_exact=True)


def test_estimate_never_sees_the_truth(store: Store) -> None:
    """A plant that keeps its truth to itself gives the same trials and the same lumps."""
    open_spec = spec_of(2, 10)
    assert isinstance(open_spec.plant, PlantSettings)
    closed = open_spec.model_copy(update={"plant": open_spec.plant.model_copy(update={"truth_known": False})})
    for name, spec in (("open", open_spec), ("closed", closed)):
        create_study(store, spec, name)
        run_study(store, name)
    columns = ["name", "identified", "sd", "low", "high"]
    assert_frame_equal(
        results.lumps_frame(store, "open")[columns], results.lumps_frame(store, "closed")[columns], check_exact=True
    )
    assert results.lumps_frame(store, "closed")["error"].isna().all()


@pytest.mark.slow
def test_hidden_friction_is_told_by_the_misfit_and_no_lump_is_known(store: Store) -> None:
    """A model that cannot explain what was seen says of no lump how well it is known."""
    create_study(store, spec_of(3, 11, {"damping": 0.05}, trials=2))
    run_study(store, "chain")
    shown = results.summary(store, "chain")
    assert shown["misfit"] > 100.0
    for lump in shown["lumps"]:
        assert lump["sd"] is lump["low"] is lump["high"] is None
        assert not lump["determined"]


@pytest.mark.slow
def test_what_no_model_explains_is_matched_ever_more_seldom_and_ends_when_no_more_is_kept(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Hidden friction, and 200 trials to spend: nine fits, not two hundred, and the first trial without motion is the
    last.
    """
    fitted: list[int] = []
    estimate = Experiment.estimate

    def counted(self: Experiment, trials: list[SeenTrial], *more: Any, **named: Any) -> Estimate | None:
        fitted.append(len(trials))
        return estimate(self, trials, *more, **named)

    monkeypatch.setattr(Experiment, "estimate", counted)
    create_study(store, spec_of(1, 3, {"damping": 0.05}, trials=200))
    assert run_study(store, "chain").trials == MOST_TRIALS + 1
    assert fitted == [1, 2, 3, 4, 6, 9, 14, 21, 32, 1, 32], "the last two are of the estimate that is kept"
    assert results.summary(store, "chain")["verdict"] == "not found"


@pytest.mark.slow
@pytest.mark.parametrize("sampler", ["cmaes", "tpe", "random"])
def test_trials_of_every_sampler_give_the_same_estimate_beside_the_best_trial(sampler: str, store: Store) -> None:
    """It is a property of a study's trials, not of the sampler that proposed them."""
    create_study(store, load_study("three-link-coast", {"sampler": sampler, "trials": 20}))
    run_study(store, "three-link-coast")
    shown = results.summary(store, "three-link-coast")
    assert (shown["verdict"], shown["source"]) == ("found", "estimate")
    assert shown["estimate"]["known_from"] <= 2
    assert len(shown["lumps"]) == 9
    assert shown["max_error"] < 1e-9 < 1e-3 < shown["best"]["max_error"]


def fast(spec: StudySpec) -> StudySpec:
    """The same study of a plant with steps of a millisecond: a short chain, and one with a heavy tip, is fast."""
    return spec.model_copy(update={"plant": spec.plant.model_copy(update={"timestep": 0.001})})


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.25, 7.5])
def test_small_and_large_chains_are_identified_alike(scale: float, store: Store) -> None:
    """Chains of 10 cm and of 3 m links: the pushes follow the chain's own time and need no setting."""
    true, nominal = (scaled(links, [1.0] * 3, [scale] * 3) for links in random_chain(3, 1))
    create_study(store, fast(chain_study((true, nominal), trials=8)))
    run_study(store, "chain")
    assert results.summary(store, "chain")["max_error"] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("masses", "lengths", "wrong"),
    [
        ([1, 1, 1, 1, 1, 30], [1] * 6, 1.0),
        ([1] * 6, np.geomspace(2.0, 0.2, 6).tolist(), 1.0),
        ([1] * 6, [1] * 6, 1.6),
    ],
    ids=["heavy tip", "lengths 10:1", "nominal 60 % off"],
)
def test_hard_chains_are_found_with_default_settings(
    masses: list[float], lengths: list[float], wrong: float, store: Store
) -> None:
    """Six links: two whose measure has long curved valleys, and one that is believed to be very different."""
    true, nominal = (scaled(links, masses, lengths) for links in random_chain(6, 1002))
    nominal = scaled(nominal, [wrong, 1 / wrong] * 3, [1] * 6)
    create_study(store, fast(chain_study((true, nominal), trials=12)))
    assert run_study(store, "chain").trials <= 5
    assert best_error(store, "chain") < 1e-6


def test_study_without_anything_to_match_is_refused(store: Store) -> None:
    """In one line, before any trial."""
    with pytest.raises(StudyError, match="needs an estimate"):
        create_study(store, spec_of(2, 1, estimate=EstimateSettings(enabled=False)))
    assert store.names() == []


def test_bounds_hold_for_the_laws_that_are_sent(store: Store) -> None:
    """A law is moved to the nearest bound; the estimate itself has none."""
    create_study(store, spec_of(3, 12, trials=3, search=SearchSettings(low=0.9, high=1.1)))
    run_study(store, "chain")
    factors = results.trials_frame(store, "chain").filter(regex="^(gravity|coriolis)_").to_numpy()
    assert factors.min() >= 0.9
    assert factors.max() <= 1.1
    assert results.summary(store, "chain")["max_error"] < 1e-6
    assert np.isfinite(factors).all()


def test_validation_of_an_estimate_does_not_say_that_inertia_was_not_searched(metaid: Callable[..., Finished]) -> None:
    """It is found with the other lumps."""
    metaid("study", "create", "three-link-coast", "--set", "sampler=output-error", "--set", "trials=3")
    metaid("study", "run", "three-link-coast", "--quiet")
    assert "not searched" not in metaid("study", "validate", "three-link-coast", "--pushes", "1").out
