"""Faults that an estimate takes up by itself, and what speaks against that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from watched import GRAVITY, NOISE, Watched, raised, watched

from metaid.estimation import (
    Estimate,
    LogUnknowns,
    Readings,
    ReadTrial,
    SearchedFaults,
    TakenUp,
    fit,
    searched_faults,
)
from metaid.estimation.noisy import predicted, take_up, unmodelled_forces
from metaid.plant import FaultSettings

pytestmark = pytest.mark.slow

LAWS = (1.2, 1.5)


@pytest.fixture(scope="module")
def late() -> Watched:
    """Two links whose torques come 8 ms late."""
    return watched(2, 1, faults=FaultSettings(angle_noise=NOISE, speed_sensor=False, delay=4), longer=2.0)


def taken_up(seen: Watched, readings: Readings, begun_with: tuple[str, ...] = ()) -> tuple[Estimate, TakenUp | None]:
    """What is taken up, begun from the estimate with some faults that a study has got to by its first trial."""

    def search(kinds: tuple[str, ...]) -> SearchedFaults:
        return searched_faults(kinds, readings.unknowns, seen.starts)

    begun = replace(readings, trials=readings.trials[:1], faults=search(begun_with)) if begun_with else readings
    return take_up(readings, fit(begun, restarts=0))


def read_again(trial: ReadTrial, noise: float) -> ReadTrial:
    """A trial with further `noise` on its readings, so many times as large as theirs."""
    more = noise * NOISE * np.random.default_rng(1).standard_normal(trial.readings.shape)
    return replace(trial, readings=trial.readings + more)


def test_fault_that_predicts_other_pushes_holds(late: Watched) -> None:
    """Its misfit there is that of noise, and the lumps are the true ones."""
    unknowns = LogUnknowns(late.nominal.lumps, GRAVITY)
    trials = [late.read_trial(raised(late.nominal.lumps, law)) for law in LAWS]
    readings = Readings(trials, unknowns)
    estimate, taken = taken_up(late, readings, ("delay",))
    assert estimate.faults is not None
    prediction = predicted(replace(readings, faults=estimate.faults.searched), estimate)
    error = estimate.unknowns - unknowns.log_factors(late.plant.chain.lumps)
    assert taken is not None
    assert (taken.kinds, taken.rivals) == (("delay",), ())
    assert prediction is not None
    assert 0.5 < prediction.misfit < prediction.below
    assert (np.abs(error) < 4.0 * estimate.deviations + 1e-6).all()


def test_cost_without_derivatives_is_that_of_the_residuals(late: Watched) -> None:
    """At the nominal model and elsewhere: a descent that asks for it first steps as if it did not."""
    unknowns = LogUnknowns(late.nominal.lumps, GRAVITY)
    trials = [late.read_trial(raised(late.nominal.lumps, law)) for law in LAWS]
    readings = Readings(trials, unknowns, faults=searched_faults(("delay", "tilt"), unknowns, late.starts))
    point = np.zeros(len(readings.spreads) + readings.extras)
    for each in (point, point + 0.02):
        for windows in (1, readings.stages):
            residuals = readings.residuals(each, windows)
            assert residuals is not None
            assert readings.least_cost(each, windows) == pytest.approx(residuals.cost, rel=1e-9)


def test_fault_that_a_later_trial_refutes_explains_nothing(late: Watched) -> None:
    """Where torques of the second trial were cut, it may predict better than none, and is no finding."""
    unknowns = LogUnknowns(late.nominal.lumps, GRAVITY)
    trials = [late.read_trial(raised(late.nominal.lumps, law)) for law in LAWS]
    cut = replace(trials[1], torques=1.1 * trials[1].torques)
    estimate, taken = taken_up(late, Readings([trials[0], cut], unknowns), ("delay",))
    assert not estimate.is_explained
    assert estimate.led_misfit is not None
    assert taken is None or taken.after > 3.0


def test_estimate_that_does_not_predict_the_last_trial_does_not_hold(late: Watched) -> None:
    """Though all trials together are explained."""
    unknowns = LogUnknowns(late.nominal.lumps, GRAVITY)
    trials = [late.read_trial(raised(late.nominal.lumps, law)) for law in (*LAWS, 1.1, 1.4)]
    noisier = [*trials[:3], read_again(trials[3], 1.5)]
    readings = Readings(noisier, unknowns)
    estimate, _ = taken_up(late, readings, ("delay",))
    assert estimate.is_explained
    assert estimate.faults is not None
    prediction = predicted(replace(readings, faults=estimate.faults.searched), estimate)
    assert prediction is not None
    assert not prediction.holds
    assert "but not pushes that were held out: their misfit is " in prediction.description


def test_spring_that_short_trials_cannot_tell_is_not_explained_away() -> None:
    """Of one link in two short trials a wrong gravity lump explains as much: no fault is taken up, a force is seen."""
    seen = watched(1, 1, faults=FaultSettings(angle_noise=NOISE, speed_sensor=False), springs=(0.5,), chain=4)
    trials = [seen.read_trial(raised(seen.nominal.lumps, law)) for law in (1.5, 1.2)]
    readings = Readings(trials, LogUnknowns(seen.nominal.lumps, GRAVITY))
    estimate, taken = taken_up(seen, readings)
    assert taken is None
    assert any(force.is_seen for force in unmodelled_forces(readings, estimate))


def test_spring_in_a_joint_that_pushes_left_out_do_not_have_is_left_out_there() -> None:
    """The gravity lump of that joint hangs on it; that of the other joint all pushes have, and it is found."""
    one, other = (
        watched(2, 1, faults=FaultSettings(angle_noise=NOISE, speed_sensor=False), longer=2.0, springs=(each, 1.0))
        for each in (1.0, 0.0)
    )
    trials = []
    for number, factor in enumerate(LAWS):
        law = raised(one.nominal.lumps, factor)
        trial, without = one.read_trial(law), other.read_trial(law)
        is_left_out = (np.arange(len(trial.steps)) + number) % 3 == 1
        for own in ("readings", "torques", "steps"):
            getattr(trial, own)[is_left_out] = getattr(without, own)[is_left_out]
        trials.append(trial)
    estimate, taken = taken_up(one, Readings(trials, LogUnknowns(one.nominal.lumps, GRAVITY)))
    assert taken is not None
    assert estimate.faults is not None
    assert taken.kinds == ("spring",)
    assert estimate.faults.searched.is_left_out.tolist() == [True, False]
    assert estimate.faults.values == pytest.approx([0.0, 1.0], rel=0.01)


@pytest.mark.parametrize(("second", "kind"), [(0.0, "tilt"), (3e-4, "offset")])
def test_offsets_are_taken_up_where_lumps_would_be_elsewhere_with_a_tilt(second: float, kind: str) -> None:
    """A tilt, which is an offset of the first encoder, explains both plants and has fewer unknowns."""
    faults = FaultSettings(angle_noise=NOISE, speed_sensor=False, tilt=0.01, encoder_offset=(0.0, second))
    seen = watched(2, 1, faults=faults)
    trials = [seen.read_trial(raised(seen.nominal.lumps, law)) for law in LAWS]
    _, taken = taken_up(seen, Readings(trials, LogUnknowns(seen.nominal.lumps, GRAVITY)), ("tilt",))
    assert taken is not None
    assert (taken.kinds, taken.rivals) == ((kind,), ()), taken.description


def test_limit_of_one_motor_is_found_wherever_it_lies() -> None:
    """A joint that falls is commanded ever more: of that its motor gives a thirtieth, and the others all."""
    faults = FaultSettings(angle_noise=NOISE, speed_sensor=False, torque_limit=(1000.0, 0.3, 1000.0))
    seen = watched(3, 1, faults=faults)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    trials = [seen.read_trial(raised(seen.nominal.lumps, law)) for law in LAWS]
    estimate, taken = taken_up(seen, Readings(trials, unknowns))
    assert taken is not None
    assert taken.kinds == ("limit",)
    assert estimate.is_explained
    assert np.abs(estimate.unknowns - unknowns.log_factors(seen.plant.chain.lumps)).max() < 1e-3


def test_fault_that_was_taken_up_says_what_the_misfit_is_without_it() -> None:
    """In one sentence."""
    taken = TakenUp(("delay", "tilt"), ("8 ms", "30 mrad"), 41.0, 1.1, (), np.zeros((0, 5)))
    assert taken.description == (
        "the study took up a delay of 8 ms and a tilt of 30 mrad: with that the misfit falls from 41 to 1.1"
    )


def test_fault_that_explains_as_much_is_named() -> None:
    """With what to do about it."""
    taken = TakenUp(("tilt",), ("10 mrad",), 26.0, 0.7, ("encoder offsets of up to 75 mrad",), np.zeros((1, 5)))
    assert taken.description == (
        "the study took up a tilt of 10 mrad: with that the misfit falls from 26 to 0.7, as it does with encoder "
        "offsets of up to 75 mrad: intervals hold both, so name in [estimate] faults what is there"
    )


def test_fault_is_taken_up_where_sensors_are_exact() -> None:
    """A rough last step, enough for windows that are to grow, leaves far more than exact sensors do."""
    seen = watched(1, 4, faults=FaultSettings(tilt=0.003))
    exact = [replace(seen.read_trial(raised(seen.nominal.lumps, law)), noise=np.full(1, 1e-9)) for law in LAWS]
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    readings = Readings(exact, unknowns)
    searched = searched_faults(("tilt",), unknowns, seen.starts)
    estimate = fit(replace(readings, faults=searched), restarts=0)
    assert estimate.is_explained
    assert estimate.faults is not None
    assert estimate.faults.values == pytest.approx([0.003])
