"""Short simulations from states of a log, under the torques that were logged: how well a model predicts motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.models.tree import JointFriction
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.smoothed import Smoothed, mean_sent

AHEAD = 0.3  # s that are simulated
APART = 0.05  # s between two starts
STEP = 0.004  # s, of the simulation at most
SLIGHT = 1e-4  # rad/s or m/s, for the derivative of friction by the speed
RUNAWAY = 1e4  # rad/s or m/s: no simulation that is faster comes back
LOST = 10.0  # rad or m: an angle that is farther off is off by this


@dataclass(frozen=True)
class Begun:
    """Simulations of a fold that begin at rows `starts` of a log, by the unknowns (nparam) of a model and zeros of the
    log's encoders (njoint).
    """

    fold: int
    model: LinearModel
    own: Smoothed
    starts: NDArray[np.intp]
    values: Array
    zeros: Array

    def sent(self, delay: float, fine: int) -> Array:
        """The torques that act (nstart x nstep x njoint), in N m or N, `delay` in s later than they are logged, each in
        one of so many steps of a period of the grid.
        """
        own = self.own
        edges = own.period / fine * np.arange(fine * _reach(own.period) + 1) - delay
        return mean_sent(own.record, own.times[self.starts][:, None] + edges)


@dataclass(frozen=True)
class Motion:
    """Errors of simulations of a `fold`, AHEAD s after they begin: of the `angle` (nstart x njoint), in rad or m, and
    of what a `constant_speed` would make of it.
    """

    fold: int
    angle: Array
    constant_speed: Array


def _reach(period: float) -> int:
    """How many periods of a grid, in s, are simulated: as many of grids that differ by rounding."""
    return round(AHEAD / round(period, 9))


def starts_of(own: Smoothed, which: NDArray[np.bool_], most: int) -> NDArray[np.intp]:
    """Rows of a grid from which AHEAD s can be simulated, all of them among `which` (nrow), at most so many."""
    reach = _reach(own.period)
    inside = np.convolve(which, np.ones(reach + 1), mode="valid") > reach + 0.5
    rows = np.flatnonzero(inside)
    stride = max(1, round(APART / own.period))
    rows = rows[rows % stride == 0]
    chosen = np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(np.intp)
    return np.asarray(rows[chosen], dtype=np.intp)


def simulated(begun: Sequence[Begun], delay: float) -> list[Motion]:
    """How each of several simulations ends, all of them side by side: on grids of the same period, by models that
    differ in their friction alone, under torques that act by a `delay`, in s, later than they are logged.
    """
    model, period = begun[0].model, begun[0].own.period
    n, nbody = model.njoint, model.nbody
    fine = max(1, int(np.ceil(period / STEP)))
    step, steps = period / fine, _reach(period)
    sizes = [len(each.starts) for each in begun]
    sent = np.concatenate([each.sent(delay, fine) for each in begun])
    zeros = np.repeat([each.zeros for each in begun], sizes, axis=0)
    bodies = np.repeat([each.values[:nbody] for each in begun], sizes, axis=0)
    angles = np.concatenate([each.own.coordinates[each.starts] for each in begun]) + zeros
    speeds = np.concatenate([each.own.speeds[each.starts] for each in begun])
    sliding = np.concatenate([each.own.states(each.model)[each.starts] for each in begun])
    seen = np.concatenate([each.own.coordinates[each.starts + steps] for each in begun]) + zeros
    constant = angles + steps * period * speeds - seen
    rubbing = JointFriction.beside([each.model.friction_at(each.values) for each in begun], sizes)
    dynamics, rest = model.dynamics(bodies), np.zeros_like(speeds)
    spun, springs = rubbing.mass_matrix, rubbing.of("spring")[..., :n]

    def friction(speeds: Array, rigid: Array) -> Array:
        return rubbing.torque(rest, speeds, rest, rigid, rubbing.sliding.after(sliding, speeds, step))

    def resisting(before: Array, after: Array, present: Array, rigid: Array) -> Array:
        """How friction at the end of a step grows with the speeds there (nstart x njoint): linear between those at both
        ends, so that no step turns a joint back and forth.

        Args:
            before: speeds at the beginning of the step (nstart x njoint), in rad/s.
            after: about those at its end (nstart x njoint), in rad/s.
            present: friction at the beginning (nstart x njoint), in N m.
            rigid: the torque that loads the joints (nstart x njoint), in N m.
        """
        across = np.where(np.abs(after - before) > SLIGHT, after - before, SLIGHT)
        return np.maximum((friction(before + across, rigid) - present) / across, 0.0)

    def rate(angles: Array, speeds: Array, torques: Array, growth: Array) -> Array:
        """Accelerations at a state.

        Args:
            angles: of the joints (nstart x njoint), in rad.
            speeds: of the joints (nstart x njoint), in rad/s.
            torques: that friction leaves of those that are sent (nstart x njoint), in N m.
            growth: how friction grows with speed (nstart x njoint), in N m s.
        """
        matrices, bias = dynamics(angles, speeds)
        stiff = matrices + spun + step * growth[:, :, None] * np.eye(n)
        is_lost = ~(np.isfinite(stiff).all(axis=(1, 2)) & (np.abs(speeds).max(axis=1) < RUNAWAY))
        stiff = np.where(is_lost[:, None, None], np.eye(n), stiff)
        left = torques - bias - springs * angles
        return np.asarray(np.linalg.solve(stiff, left[..., None])[..., 0], dtype=np.float64)

    with np.errstate(all="ignore"):
        for torques in sent.swapaxes(0, 1):
            # without accelerations, so that nothing chatters
            rigid = dynamics(angles, speeds)[1] if "load" in rubbing.terms else rest
            present = friction(speeds, rigid)
            left = torques - present
            faster = rate(angles, speeds, left, resisting(speeds, speeds, present, rigid))
            half = angles + 0.5 * step * speeds, speeds + 0.5 * step * faster
            faster = rate(*half, left, resisting(speeds, speeds + step * faster, present, rigid))
            after = speeds + step * faster
            sliding = rubbing.sliding.after(sliding, 0.5 * (speeds + after), step)
            angles, speeds = angles + 0.5 * step * (speeds + after), after
        missed = np.nan_to_num(angles - seen, nan=LOST, posinf=LOST, neginf=-LOST)
    edges = np.cumsum(sizes)[:-1]
    ended = zip(begun, np.split(np.clip(missed, -LOST, LOST), edges), np.split(constant, edges), strict=True)
    return [Motion(each.fold, angle, constant_speed) for each, angle, constant_speed in ended]
