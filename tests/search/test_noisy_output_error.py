"""The output-error sampler on plants whose sensors, pushes and torques are not exact."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chain_studies import chain_study, random_chain
from pandas.testing import assert_frame_equal

from metaid import results
from metaid.episode import SensorReadings
from metaid.estimation import Experiment
from metaid.results import read_snapshot
from metaid.store import Store
from metaid.study import Problem, SearchSettings, StudySpec, create_study, run_study
from metaid.study.settings import EstimateSettings

pytestmark = pytest.mark.slow

NOISE = {"angle_noise": 1e-3, "speed_sensor": False}


def spec_of(
    nlink: int, seed: int, faults: dict[str, Any], trials: int = 2, link: dict[str, Any] | None = None, **more: Any
) -> StudySpec:
    """A study of a random chain whose nominal model is wrong by up to 30 %; its links have something more hidden."""
    episode = {"measure": "smoothed", **more.pop("episode", {})}
    return chain_study(random_chain(nlink, seed), faults, link, trials=trials, episode=episode, **more)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """An empty study DB."""
    return Store(str(tmp_path / "metaid.db"), create=True)


def shown(store: Store, spec: StudySpec) -> dict[str, Any]:
    """What a study shows that has been run."""
    create_study(store, spec)
    run_study(store, spec.name)
    return results.summary(store, spec.name)


@pytest.mark.parametrize(
    ("nlink", "faults"),
    [
        (2, NOISE),
        (3, {**NOISE, "push_noise": 0.02}),
        (5, NOISE),
        (3, {"angle_noise": 1e-3, "speed_noise": 0.03}),
        (3, {"encoder_step": 3e-3, "speed_sensor": False}),
        (3, {**NOISE, "control_every": 3, "delay": 2}),
    ],
)
def test_all_lumps_are_found_within_their_intervals_by_two_noisy_trials(
    nlink: int, faults: dict[str, Any], store: Store
) -> None:
    """Within a percent and four deviations each, inertia lumps too, with residuals of the size of the noise."""
    found = shown(store, spec_of(nlink, 1, faults))
    assert found["source"] == "estimate"
    assert 0.8 < found["misfit"] < 1.2
    assert found["max_error"] < 0.01
    for lump in found["lumps"]:
        assert lump["low"] <= lump["identified"] <= lump["high"]
        assert abs(lump["identified"] - lump["true"]) < 4.0 * lump["sd"]


def test_law_that_looks_ahead_is_known_too(store: Store) -> None:
    """What was commanded follows from the readings and the lead."""
    found = shown(store, spec_of(3, 2, {**NOISE, "delay": 4}, episode={"lead": 0.009}))
    assert 0.8 < found["misfit"] < 1.2
    assert found["max_error"] < 0.01


ROUGH = {"angle_noise": 1e-4, "speed_sensor": False, "push_noise": 0.02, "torque_noise": 0.3}


def test_every_other_law_swings_the_chain_hard_where_torques_are_noisy(store: Store) -> None:
    """So inertia lumps, which a chain that coasts does not show, are known as well as the others."""
    spec = spec_of(2, 1, ROUGH, trials=4, episode={"count": 21})
    found = shown(store, spec)
    factors = results.trials_frame(store, spec.name)[["gravity_1", "gravity_2"]].to_numpy()
    assert (factors[[1, 3]] > 3.0 * factors[2]).all()
    assert found["verdict"] == "found"
    assert max(lump["sd"] / lump["identified"] for lump in found["lumps"]) < 0.0015  # 0.3 % with laws that coast


@pytest.mark.parametrize(
    ("more", "high"),
    [
        ({}, [8.0, 8.0, 2.0]),
        ({"search": SearchSettings(high=2.0)}, [2.0, 2.0, 2.0]),
        ({"sampler": "cmaes"}, [2.0, 2.0, 2.0]),
        ({"faults": {"torque_limit": 9.0}}, [2.0, 2.0, 2.0]),
        ({"estimate": EstimateSettings(torque_limit=9.0)}, [2.0, 2.0, 2.0]),
    ],
)
def test_laws_may_over_compensate_much_where_torques_are_noisy(more: dict[str, Any], high: list[float]) -> None:
    """Up to eight times the nominal gravity lumps, unless the study says otherwise or drives have a limit."""
    assert Problem(spec_of(2, 1, {**ROUGH, **more.pop("faults", {})}, **more)).high.tolist() == high


@pytest.mark.parametrize(
    ("faults", "link"), [({}, {"damping": 0.02}), ({}, {"stiffness": 0.2}), ({"torque_limit": 2.5}, {})]
)
def test_misfit_tells_what_the_twin_does_not_know(faults: dict[str, Any], link: dict[str, Any], store: Store) -> None:
    """Hidden friction, a spring, drives that are too weak: then no lump is known, nor is it approximate, for parts of
    the pushes contradict each other.
    """
    create_study(store, spec_of(2, 3, {**NOISE, **faults}, trials=1, link=link))
    run_study(store, "chain")
    snapshot = read_snapshot(store, "chain")
    assert snapshot.estimate is not None
    assert snapshot.estimate.estimate.misfit > 4.0
    verdict = snapshot.verdict
    assert verdict.word == "not found"
    assert verdict.lumps[["sd", "low", "high"]].isna().all(axis=None)
    assert "pushes that were left out have a misfit of " in verdict.reasons[-1]


def test_tilted_base_leaves_lumps_that_are_known_as_badly_as_their_intervals_say(store: Store) -> None:
    """Thirty milliradians: approximate, and wrong by at most twice the half-width of an interval."""
    found = shown(store, spec_of(2, 3, {**NOISE, "tilt": 0.03}))
    assert found["verdict"] == "approximate"
    assert found["misfit"] > 4.0
    assert all(abs(lump["identified"] - lump["true"]) < lump["high"] - lump["low"] for lump in found["lumps"])


@pytest.mark.parametrize("limits", [6.0, (6.0, 2.0, 1.0)])
def test_torques_that_are_cut_off_do_no_harm_where_the_study_says_it(
    limits: float | tuple[float, ...], store: Store
) -> None:
    """The twin gets no more than the motors give."""
    faults = {**NOISE, "torque_limit": limits}
    found = shown(store, spec_of(3, 1, faults, estimate=EstimateSettings(torque_limit=limits)))
    assert 0.8 < found["misfit"] < 1.2
    assert found["max_error"] < 0.001


def test_torque_limit_that_is_said_wrong_shows_in_the_misfit(store: Store) -> None:
    """Motors that give a tenth less than was said."""
    faults, said = {**NOISE, "torque_limit": 5.4}, EstimateSettings(torque_limit=6.0)
    found = shown(store, spec_of(2, 1, faults, trials=1, estimate=said))
    assert found["verdict"] != "found"
    assert found["misfit"] > 4.0


def test_lengths_that_are_wrong_by_two_percent_show_in_the_misfit(store: Store) -> None:
    """Where they are taken as exact."""
    spec = spec_of(2, 4, NOISE, trials=1, estimate=EstimateSettings(lengths="exact"))
    assert 0.8 < shown(store, spec)["misfit"] < 1.2
    links = [
        link.model_copy(update={"length": link.length * wrong})
        for link, wrong in zip(spec.nominal, (0.98, 1.02), strict=True)
    ]
    wrong = spec.model_copy(update={"nominal": tuple(links), "name": "wrong"})
    assert shown(store, wrong)["misfit"] > 2.0


def test_table_is_the_same_for_any_workers_and_however_often_it_was_stopped(store: Store) -> None:
    """Bit for bit, the estimate with its intervals too."""
    spec = spec_of(3, 5, {**NOISE, "push_noise": 0.02}, trials=3)
    for name, workers, stops in (("one", 1, (3,)), ("two", 2, (3,)), ("stopped", 3, (1, 2, 3))):
        create_study(store, spec, name)
        for stop in stops:
            run_study(store, name, trials=stop, workers=workers)
    trials = [results.trials_frame(store, name) for name in ("one", "two", "stopped")]
    lumps = [results.lumps_frame(store, name) for name in ("one", "two", "stopped")]
    assert len(trials[0]) == 3
    for table in (trials, lumps):
        assert_frame_equal(table[0], table[1], check_exact=True)
        assert_frame_equal(table[0], table[2], check_exact=True)


def test_trials_end_where_intervals_stop_shrinking(store: Store) -> None:
    """The widest interval shrinks as one over the root of the trials at best, so a dozen or so are enough."""
    create_study(store, spec_of(2, 6, NOISE, trials=40))
    assert 2 < run_study(store, "chain").trials < 20


def test_size_of_the_noise_is_not_read_from_the_plant_file(store: Store) -> None:
    """It is that of the plant at rest, to a percent."""
    experiment = Problem(spec_of(2, 7, NOISE)).experiment()
    noise = experiment.loop.noise  # type: ignore[union-attr]
    assert noise == pytest.approx(np.full(2, 1e-3), rel=0.01)
    assert (noise != 1e-3).all()


@pytest.mark.parametrize("faults", [NOISE, {"angle_noise": 1e-3, "speed_noise": 0.03}])
def test_compiled_and_stepwise_loops_keep_the_same_readings(faults: dict[str, Any]) -> None:
    """Of the same noise; speeds are kept where a sensor reads them."""
    from metaid.episode import run_stepwise

    objective = Problem(spec_of(2, 8, faults)).make_objective()
    lumps = objective.nominal
    compiled = objective.record(np.ones(3)).readings
    stepwise = run_stepwise(objective._loop.plant, lumps, objective._loop.episode)[0].readings
    assert isinstance(compiled, SensorReadings)
    assert isinstance(stepwise, SensorReadings)
    assert compiled.counts.tolist() == stepwise.counts.tolist()
    assert np.allclose(compiled.angles, stepwise.angles, atol=1e-9)
    assert (compiled.speeds is None) == (stepwise.speeds is None) == (not faults.get("speed_sensor", True))
    if compiled.speeds is not None and stepwise.speeds is not None:
        assert np.allclose(compiled.speeds, stepwise.speeds, atol=1e-9)


@pytest.mark.parametrize(("nlink", "horizons"), [(1, 2.0), (3, 2.0), (4, 1.5), (5, 1.2), (10, 1.0)])
def test_noisy_pushes_are_longer_and_stronger_the_fewer_links_there_are(nlink: int, horizons: float) -> None:
    """As many times as those of another sampler, whose horizon is that of a rich push."""
    ours = Problem(spec_of(nlink, 0, NOISE))
    other = Problem(spec_of(nlink, 0, NOISE, sampler="random"))
    assert ours.episode.steps == pytest.approx(horizons * other.episode.steps, abs=1)
    assert ours.episode.pushes == pytest.approx(horizons * other.episode.pushes, rel=1e-9)
    assert ours.episode.fall_rule.limit == pytest.approx(horizons * other.episode.fall_rule.limit)
    assert other.episode.readings_steps == other.episode.steps


def test_laws_over_compensate_again_where_that_tells_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A law near the truth shows next to nothing of inertia: four trials know it far better as if all but the first
    had such laws.
    """
    deviations = []
    for only_estimates in (False, True):
        if only_estimates:
            monkeypatch.setattr(Experiment, "is_to_probe", lambda *_: False)
        store = Store(str(tmp_path / f"{only_estimates}.db"), create=True)
        found = shown(store, spec_of(5, 0, {**NOISE, "push_noise": 0.02}, trials=4))
        assert found["verdict"] == "found"
        deviations.append([lump["sd"] / lump["identified"] for lump in found["lumps"] if "inertia" in lump["name"]])
    assert max(deviations[0]) < 0.6 * max(deviations[1])
