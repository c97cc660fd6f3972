"""Faults of the plant are found beside the lumps: by readings of the plant behind them, which the twin never saw."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from slopes import assert_slopes
from watched import GRAVITY, NOISE, TIMESTEP, raised, some_torque, watched

from metaid.estimation import FoundFaults, LogUnknowns, Readings, ReadTrial, SearchedFaults, fit, searched_faults
from metaid.estimation.faults.searched import late
from metaid.estimation.noisy import Innovations, take_up, unmodelled_forces
from metaid.estimation.twin.driven import watch_readings
from metaid.models import Array
from metaid.plant import FAULT_UNITS, FaultSettings, fault_names, true_faults
from metaid.study.estimates import StudyEstimate

NOISY: dict[str, Any] = {"angle_noise": NOISE, "speed_sensor": False}


@pytest.mark.parametrize(
    ("kinds", "faults", "joints"),
    [
        (("delay",), {"delay": 4}, {}),
        (("tilt",), {"tilt": 0.03}, {}),
        (("viscous",), {}, {"damping": 0.02}),
        (("spring",), {}, {"springs": (0.3, 0.3)}),
        (("gain",), {"torque_gain": (1.0, 1.05)}, {}),
        (
            ("delay", "offset", "viscous", "gain"),
            {"delay": 2, "encoder_offset": (0.02, -0.01), "torque_gain": (1.0, 1.2)},
            {"damping": 0.02},
        ),
    ],
)
def test_faults_are_found_beside_the_lumps(
    kinds: tuple[str, ...], faults: dict[str, Any], joints: dict[str, Any]
) -> None:
    """Within four deviations each, and within a hundredth of their size."""
    seen = watched(2, 1, faults=FaultSettings(**NOISY, **faults), longer=2.0, **joints)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    searched = searched_faults(kinds, unknowns, seen.starts)
    trials = [seen.read_trial(raised(seen.nominal.lumps, factor)) for factor in (1.2, 1.5)]
    estimate = fit(Readings(trials, unknowns, faults=searched), restarts=0)
    error = estimate.unknowns - unknowns.log_factors(seen.plant.chain.lumps)
    found, true = estimate.faults, true_faults(seen.plant, kinds)
    assert found is not None
    assert estimate.misfit < 1.3
    assert found.determined.all()
    assert (np.abs(error) < 4.0 * estimate.deviations + 1e-6).all()
    assert np.abs(error).max() < 0.01
    assert (np.abs(found.values - true) < 4.0 * found.deviations).all()
    assert found.values == pytest.approx(true, rel=0.01)


def test_torques_that_come_late_are_means_of_what_is_held() -> None:
    """Whole steps move them, and parts of a step mix two; none acts before the first, and the last goes on."""
    torques = np.arange(1.0, 6.0).reshape(1, 5, 1)
    assert late(torques, 2.0)[0].ravel().tolist() == [0.0, 0.0, 1.0, 2.0, 3.0]
    assert late(torques, 1.25)[0].ravel().tolist() == [0.0, 0.75, 1.75, 2.75, 3.75]
    assert late(torques, -1.0)[0].ravel().tolist() == [2.0, 3.0, 4.0, 5.0, 5.0]


@pytest.mark.parametrize("kind", ["delay", "lag"])
def test_torque_that_changes_within_a_step_moves_a_body_as_far_as_it_does(kind: str) -> None:
    """A free mass, integrated with 400 steps in each: torques of one size a step lead where these do."""
    period, late_by, nstep, fine = 2e-3, 2.6e-3, 40, 400
    sent = np.minimum(np.arange(nstep), 4.0).reshape(1, nstep, 1)
    trial = ReadTrial(
        period,
        np.zeros((1, nstep + 1, 1)),
        sent,
        np.array([nstep]),
        np.zeros((1, 2, 1)),
        None,
        np.ones(1),
        is_continuous=True,
    )
    lumps = watched(1, 1).nominal.lumps
    searched = replace(searched_faults((kind,), LogUnknowns(lumps, GRAVITY), np.ones((1, 1))), scales=np.ones(1))
    unknown = late_by if kind == "delay" else np.log(late_by / 2e-3)
    steps = searched.delivered(trial, np.array([unknown]))[0, :, 0]
    times = (np.arange(nstep * fine) + 0.5) * period / fine
    if kind == "delay":
        row = np.floor((times - late_by) / period).astype(int)
        true = np.where(row >= 0, sent[0, np.maximum(row, 0), 0], 0.0)
    else:
        left = np.exp(-period / fine / late_by)
        true = lfilter([0.5 * (1.0 - left)] * 2, [1.0, -left], np.repeat(sent[0, :, 0], fine))

    def ends(torques: Array) -> Array:
        """Where the mass is and how fast, after torques that are held for a step each."""
        own = period * nstep / len(torques)
        speeds = np.cumsum(torques) * own
        return np.array([np.sum(speeds - 0.5 * torques * own) * own, speeds[-1]])

    np.testing.assert_allclose(ends(steps), ends(true), rtol=1e-5)


@pytest.mark.parametrize("is_led", [False, True])
@pytest.mark.parametrize("is_continuous", [False, True])
@pytest.mark.parametrize("kinds", [tuple(kind for kind in FAULT_UNITS if kind != "tilt"), ("tilt", "viscous")])
def test_slopes_by_faults_are_those_of_the_residuals(kinds: tuple[str, ...], is_continuous: bool, is_led: bool) -> None:
    """Away from the truth, for every kind, against central differences of the residuals themselves, whether a filter
    leads the twin or none.
    """
    seen = watched(2, 3, faults=FaultSettings(**NOISY))
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    searched = searched_faults(kinds, unknowns, seen.starts, teeth=14)
    trial = replace(seen.read_trial(raised(seen.nominal.lumps, 1.5)), is_continuous=is_continuous)
    readings: Readings | None = Readings([trial], unknowns, faults=searched)
    random = np.random.default_rng(0)
    point = 0.1 * random.standard_normal(len(readings.spreads))
    if is_led:
        readings = Innovations([trial], unknowns, faults=searched).led(point, some_torque(seen))
        assert readings is not None
    assert_slopes(readings, point)


def test_fault_that_is_searched_is_no_force_that_the_model_has_not() -> None:
    """Nor is another seen, nor does the replay of the trial differ from its readings by more than noise."""
    seen = watched(1, 1, damping=0.02, faults=FaultSettings(**NOISY, delay=2), longer=2.0)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    searched = searched_faults(("delay", "viscous"), unknowns, seen.starts)
    trials = [seen.read_trial(raised(seen.nominal.lumps, factor)) for factor in (1.2, 1.5)]
    readings = Readings(trials, unknowns, faults=searched)
    estimate = fit(readings, restarts=0)
    forces = list(unmodelled_forces(readings, estimate))
    assert [force.kind for force in forces] == ["spring", "coulomb"]
    assert not any(force.is_seen for force in forces)
    replay = readings.replay(1, estimate.point)
    assert np.sqrt(np.nanmean((replay.simulated - replay.seen) ** 2)) < 1.2 * NOISE


def test_fault_that_is_left_out_of_a_joint_is_none_there_and_looked_for_as_a_force() -> None:
    """That of the other joint is found, and is no force that the model has not."""
    seen = watched(2, 1, faults=FaultSettings(**NOISY), longer=2.0, springs=(0.0, 0.3))
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    searched = searched_faults(("spring",), unknowns, seen.starts).without(np.array([True, False]))
    trials = [seen.read_trial(raised(seen.nominal.lumps, factor)) for factor in (1.2, 1.5)]
    readings = Readings(trials, unknowns, faults=searched)
    estimate = fit(readings, restarts=0)
    found, force = estimate.faults, next(iter(unmodelled_forces(readings, estimate)))
    assert estimate.is_explained
    assert found is not None
    assert found.determined.tolist() == [False, True]
    assert found.values == pytest.approx([0.0, 0.3], rel=0.01)
    assert np.isnan(found.deviations).tolist() == [True, False]
    assert force.kind == "spring"
    assert force.deviations[0] > 0.0
    assert force.sizes[1] == force.deviations[1] == 0.0


def test_fit_goes_on_from_the_faults_that_it_found() -> None:
    """Begun at the estimate of the same trials, it has the same faults; what a fit begins at has them behind lumps."""
    seen = watched(1, 1, faults=FaultSettings(**NOISY, delay=2), longer=2.0)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    searched = searched_faults(("delay",), unknowns, seen.starts)
    readings = Readings([seen.read_trial(raised(seen.nominal.lumps, 1.5))], unknowns, faults=searched)
    first = fit(readings, restarts=0)
    again = fit(readings, first.start, restarts=0)
    assert first.faults is not None
    assert again.faults is not None
    assert first.start.tolist() == [*first.unknowns, *first.faults.unknowns]
    assert again.faults.values[0] == pytest.approx(first.faults.values[0], abs=0.01 * TIMESTEP)
    assert replace(first, faults=None).start.tolist() == first.unknowns.tolist()


def test_faults_compile_no_loop_anew() -> None:
    """What a loop is given is laid out alike, whatever is searched."""
    seen = watched(2, 1, faults=FaultSettings(**NOISY))
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    trial = seen.read_trial(raised(seen.nominal.lumps, 1.2))
    compiled = []
    for kinds in ((), ("delay",), ("spring", "gain"), tuple(FAULT_UNITS)):
        readings = Readings([trial], unknowns, faults=searched_faults(kinds, unknowns, seen.starts, 4))
        assert readings.residuals(np.zeros(len(readings.spreads) + readings.extras), 1) is not None
        compiled.append(len(watch_readings.whole.signatures))
    assert len(set(compiled)) == 1


def test_names_of_faults_are_by_joint() -> None:
    """But for those of the whole plant; gains are relative to the first motor."""
    assert fault_names(("delay", "dry", "gain"), 3) == ["delay", "dry_1", "dry_2", "dry_3", "gain_2", "gain_3"]


def test_spring_that_pushes_away_explains_nothing() -> None:
    """The fit finds it, the verdict names it, and it is not proposed."""
    seen = watched(1, 1, faults=FaultSettings(angle_noise=NOISE, speed_sensor=False), longer=2.0, springs=(-0.5,))
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    trials = [seen.read_trial(raised(seen.nominal.lumps, law)) for law in (1.5, 1.2)]
    readings = Readings(trials, unknowns)

    def search(kinds: tuple[str, ...]) -> SearchedFaults:
        return searched_faults(kinds, unknowns, seen.starts)

    found = fit(replace(readings, faults=search(("spring",))), restarts=0)
    assert found.is_explained
    assert found.faults is not None
    assert found.faults.impossible == ["spring_1"]
    trials_of: Any = None  # nothing is asked of the trials where a fault refutes the estimate
    shown = StudyEstimate(found, unknowns.kinds, len(trials), trials_of)
    assert not shown.explains
    assert shown.description.startswith("what was seen is explained only with spring_1 below 0, which no plant has: ")
    kept, _ = take_up(readings, fit(readings, restarts=0))
    assert kept.faults is None or "spring" not in kept.faults.searched.kinds


def test_small_friction_may_be_below_0_by_what_noise_tells() -> None:
    """Its interval is that of the fit, which no bound cuts."""
    searched = SearchedFaults(("viscous",), 2, np.array([1.0, 1.0]))
    small = FoundFaults(searched, np.array([-0.01, -0.05]), np.full(2, 0.01), np.zeros(2), np.full(2, True))
    assert small.impossible == ["viscous_2"]


def test_bounded_faults_are_never_negative() -> None:
    """Far above 0 they are what they are without a bound, and their deviations are, too; a tilt has no bound."""
    free = SearchedFaults(("tilt", "spring"), 1, np.array([0.1, 2.0]))
    bounded = replace(free, is_bounded=True)
    above, below = np.array([-1.0, 1.0]), np.array([-1.0, -1.0])
    assert np.allclose(bounded.values(above), free.values(above), rtol=1e-6)
    assert np.allclose(bounded.deviations(above, above**2), free.deviations(above, above**2), rtol=1e-6)
    assert bounded.values(below)[0] == free.values(below)[0] == -0.1
    assert 0.0 <= bounded.values(below)[1] < 1e-6
    assert 0.0 <= bounded.deviations(below, below**2)[1] < 1e-5


@pytest.mark.parametrize("kinds", [tuple(FAULT_UNITS), ("spring",), ("offset", "viscous")])
def test_faults_that_change_torques_are_those_by_which_delivered_torques_change(kinds: tuple[str, ...]) -> None:
    """Derivatives by the others are made with the torques as they are."""
    names, random = fault_names(kinds, 2), np.random.default_rng(0)
    faults = SearchedFaults(kinds, 2, np.full(len(names), 0.1), teeth=5, limits=np.full(2, 0.5))
    readings, torques = random.normal(size=(1, 9, 2)), random.normal(size=(1, 8, 2))
    trial = ReadTrial(0.02, readings, torques, np.array([8]), np.zeros((1, 2, 2)), None, np.full(2, NOISE))
    here, step = np.full(len(names), 0.3), 0.1 * np.eye(len(names))
    before = faults.delivered(trial, here)
    changes = [(faults.delivered(trial, here + each) != before).any() for each in step]
    assert faults.is_of_torque.tolist() == changes
