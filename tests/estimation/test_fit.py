"""A fit finds the chain that shows what was seen, from a wrong nominal model; and says where it did not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from watched import GRAVITY, TIMESTEP, raised, watched

from metaid.estimation import Estimate, LogUnknowns, Motions, Quantity, fit
from metaid.estimation.descent import Residuals, descend, place_at
from metaid.models import Array, Lumps

FULL_WITH_DAMPING = ("gravity", "coriolis", "damping", "inertia")


def worst(estimate: Estimate, truth: Lumps) -> float:
    """The largest relative error of any lump."""
    kinds = ("gravity", "coriolis", "inertia")
    return float(np.abs(estimate.lumps.vector_of(kinds) / truth.vector_of(kinds) - 1.0).max())


@pytest.mark.parametrize("nlink", [2, 3, 5, 7])
def test_one_trial_at_the_nominal_law_gives_all_lumps(nlink: int) -> None:
    """Gravity, Coriolis and inertia lumps, no length assumed."""
    seen = watched(nlink)
    estimate = fit(Motions([seen.trial(seen.nominal.lumps)], LogUnknowns(seen.nominal.lumps, GRAVITY)))
    assert worst(estimate, seen.plant.chain.lumps) < 1e-9
    assert estimate.misfit < 1.0


@pytest.mark.parametrize("compared", ["frequency", "both"])
def test_frequencies_of_one_over_compensated_trial_give_all_lumps(compared: Quantity) -> None:
    """Where every joint is driven back, squares of its motion are enough."""
    seen = watched(3)
    trial = seen.trial(raised(seen.nominal.lumps, 2.0))
    estimate = fit(Motions([trial], LogUnknowns(seen.nominal.lumps, GRAVITY), compared))
    assert worst(estimate, seen.plant.chain.lumps) < 1e-9


def test_small_oscillations_under_two_laws_give_all_lumps() -> None:
    """Two small pushes, two over-compensated candidates, frequencies alone: no Coriolis force is large enough to be
    seen, and all lumps are known through the mass matrix.
    """
    seen = watched(3)
    episode = replace(seen.episode, pushes=0.03 * seen.episode.pushes[:2], steps=2000)
    seen = replace(seen, episode=episode, starts=0.03 * seen.starts[:2])
    trials = [seen.trial(raised(seen.nominal.lumps, factor), windows=7) for factor in (1.6, 2.4)]
    estimate = fit(Motions(trials, LogUnknowns(seen.nominal.lumps, GRAVITY), "frequency"))
    assert worst(estimate, seen.plant.chain.lumps) < 1e-9


def test_mirror_images_of_frequencies_show_in_the_misfit_and_restarts_leave_them() -> None:
    """Near exact compensation squares do not say which way a joint is driven."""
    seen = watched(2)
    motions = Motions([seen.trial(seen.nominal.lumps)], LogUnknowns(seen.nominal.lumps, GRAVITY), "frequency")
    stuck, found = fit(motions, restarts=0), fit(motions, restarts=10)
    assert stuck.misfit > 1e3
    assert worst(stuck, seen.plant.chain.lumps) > 0.01
    assert found.misfit < 1.0
    assert worst(found, seen.plant.chain.lumps) < 1e-9


def test_windows_before_a_fall_are_used() -> None:
    """A law that lets the chain fall in every trial still gives all lumps."""
    seen = watched(2, longer=4.0)
    trials = [seen.trial(raised(seen.nominal.lumps, factor)) for factor in (0.2, 0.4)]
    assert all(not trial.seen(len(trial.ends)).all() for trial in trials)
    estimate = fit(Motions(trials, LogUnknowns(seen.nominal.lumps, GRAVITY)))
    assert worst(estimate, seen.plant.chain.lumps) < 1e-7


def test_one_link_needs_two_laws() -> None:
    """Under one law its gravity and its inertia share a scale, and the covariance says so; a second law separates
    them.
    """
    seen, truth = watched(1), watched(1).plant.chain.lumps
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    trials = [seen.trial(seen.nominal.lumps)]
    once = fit(Motions(trials, unknowns))
    assert once.misfit < 1.0
    assert once.deviations.max() > 0.1
    trials.append(seen.trial(once.lumps))
    assert worst(fit(Motions(trials, unknowns)), truth) < 1e-9


def test_replay_has_the_plants_angles_beside_the_twins() -> None:
    """At the end of every window that was seen they agree; the twin is there in between too, and nothing after a
    fall.
    """
    seen = watched(2, longer=4.0)
    trials = [seen.trial(raised(seen.nominal.lumps, factor)) for factor in (1.5, 0.2)]
    motions = Motions(trials, LogUnknowns(seen.nominal.lumps, GRAVITY))
    estimate = fit(motions)
    for number, trial in enumerate(trials):
        replay = motions.replay(number, estimate.point)
        known = trial.seen(len(trial.ends))
        assert known.all() == (number == 0)
        assert np.count_nonzero(~np.isnan(replay.seen)) == 2 * known.sum()
        at_ends = np.isin(replay.times, TIMESTEP * trial.ends)
        assert np.array_equal(replay.seen[:, at_ends][known], trial.windows.angles[known])
        assert np.nanmax(np.abs(replay.simulated - replay.seen)) < 1e-9
        last = TIMESTEP * np.append(0, trial.ends)[trial.windows.seen]
        assert (np.isnan(replay.simulated[..., 0]) == (replay.times > last[:, None] + 1e-9)).all()
        assert len(replay.times) >= 100


def test_exact_lengths_leave_two_unknowns_a_link() -> None:
    """Coriolis lumps then follow from gravity lumps."""
    seen = watched(4)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY, lengths=seen.nominal.length)
    estimate = fit(Motions([seen.trial(seen.nominal.lumps)], unknowns))
    assert len(estimate.names) == 8
    assert worst(estimate, seen.plant.chain.lumps) < 1e-9


def test_viscous_friction_is_found_where_it_is_unknown() -> None:
    """From a nominal value that is half of it."""
    seen = watched(3, damping=0.04)
    nominal = replace(seen.nominal.lumps, damping=np.full(3, 0.02))
    estimate = fit(Motions([seen.trial(seen.nominal.lumps)], LogUnknowns(nominal, GRAVITY, FULL_WITH_DAMPING)))
    assert np.allclose(estimate.lumps.of("damping"), 0.04, rtol=1e-8)
    assert worst(estimate, seen.plant.chain.lumps) < 1e-8


def test_hidden_friction_shows_in_the_misfit_and_in_the_residuals() -> None:
    """A model without friction cannot explain it, from whatever start."""
    seen = watched(2, damping=0.01)
    trials = [seen.trial(raised(seen.nominal.lumps, factor)) for factor in (1.0, 1.5)]
    estimate = fit(Motions(trials, LogUnknowns(seen.nominal.lumps, GRAVITY)), restarts=1)
    assert estimate.misfit > 1e4
    assert [table.shape for table in estimate.residuals] == [(4, 2), (4, 2)]
    assert all((table > 1.0).all() for table in estimate.residuals)


def test_the_same_trials_give_the_same_estimate() -> None:
    """To the last bit, restarts included."""
    seen = watched(2)
    trials = [seen.trial(seen.nominal.lumps)]

    def once() -> Array:
        return fit(Motions(trials, LogUnknowns(seen.nominal.lumps, GRAVITY), "frequency")).unknowns

    assert np.array_equal(once(), once())


def test_a_lump_that_is_unknown_needs_a_nominal_value() -> None:
    """There is no factor of nothing."""
    with pytest.raises(ValueError, match="nominal damping_1 is 0"):
        LogUnknowns(watched(2).nominal.lumps, GRAVITY, FULL_WITH_DAMPING)


def test_trials_that_showed_nothing_are_refused() -> None:
    """Every push fell within its shortest window."""
    seen = watched(2)
    trial = seen.trial(seen.nominal.lumps)
    nothing = replace(trial.windows, seen=0 * trial.windows.seen)
    with pytest.raises(ValueError, match="nothing to compare"):
        Motions([replace(trial, windows=nothing)], LogUnknowns(seen.nominal.lumps, GRAVITY))


class Gorge:
    """A curved valley between walls that no step may cross: y = x² to within a hair, lowest at (1, 1)."""

    spreads, stages, extras = np.full(2, 10.0), 2, 0

    def least_cost(self, point: Array, windows: int) -> float:
        """Nothing less than the residuals tells it."""
        return 0.0

    def residuals(self, point: Array, windows: int) -> Residuals | None:
        """Those of Rosenbrock's function; None beyond the walls."""
        x, y = point
        if abs(y - x * x) > 2e-5:
            return None
        values, slopes = np.array([1e3 * (y - x * x), 1.0 - x]), np.array([[-2e3 * x, 1e3], [-1.0, 0.0]])
        return Residuals(values, slopes, 0.5 * float(values @ values), 2, np.empty((0, 3)))


def test_descent_ends_where_a_step_promises_less_than_is_asked_for() -> None:
    """Where residuals are noise, the least hundredths of their cost are not worth a simulation."""
    gorge = Gorge()
    place = place_at(gorge, np.array([0.99, 0.99**2]), 1)
    assert place is not None
    steps = [descend(gorge, place, 1, 1e-9, 30, least_gain=each).iterations for each in (1e-3, 1e-6)]
    assert steps[0] == 0 < steps[1]


def test_descent_in_short_steps_goes_on_if_asked_to() -> None:
    """Where walls cut each step it is not at its end; a fit that grows windows may leave it there all the same."""
    gorge = Gorge()
    place = place_at(gorge, np.zeros(2), 1)
    assert place is not None
    ended, went_on = (descend(gorge, place, 1, 1e-2, 30, ends_when_cut=each) for each in (True, False))
    assert ended.converged
    assert ended.place.point[0] < 0.01
    assert not went_on.converged
    assert went_on.place.point[0] > 0.05
