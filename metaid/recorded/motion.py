"""Short simulations from states of a log, under the torques that were logged: how well a model predicts motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.models import Array
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.smoothed import Smoothed

AHEAD = 0.3  # s that are simulated
APART = 0.05  # s between two starts
STEP = 0.004  # s, of the simulation at most
SLIGHT = 1e-4  # rad/s or m/s, for the derivative of friction by the speed
RUNAWAY = 1e4  # rad/s or m/s: no simulation that is faster comes back
LOST = 10.0  # rad or m: an angle that is farther off is off by this


@dataclass(frozen=True)
class Motion:
    """Errors of simulations that are `seconds` long: of the `angle` at their end (nstart x njoint), in rad or m, and of
    what a `constant_speed` would make of it.
    """

    seconds: float
    angle: Array
    constant_speed: Array


def starts_of(own: Smoothed, which: NDArray[np.bool_], most: int) -> NDArray[np.intp]:
    """Rows of a grid from which AHEAD s can be simulated, all of them among `which` (nrow), at most so many."""
    reach = round(AHEAD / own.period)
    inside = np.convolve(which, np.ones(reach + 1), mode="valid") > reach + 0.5
    rows = np.flatnonzero(inside)
    stride = max(1, round(APART / own.period))
    rows = rows[rows % stride == 0]
    chosen = np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(np.intp)
    return np.asarray(rows[chosen], dtype=np.intp)


def simulated(
    model: LinearModel, values: Array, own: Smoothed, zeros: Array, delay: float, starts: NDArray[np.intp]
) -> Motion:
    """How simulations end that begin at rows of a grid.

    Args:
        model: what is unknown.
        values: the unknowns of each simulation (nstart x nparam).
        own: the log.
        zeros: of its encoders (nstart x njoint), in rad.
        delay: by which torques act later than they are logged, in s.
        starts: the rows where simulations begin (nstart).
    """
    n, nbody = model.njoint, model.nbody
    fine = max(1, int(np.ceil(own.period / STEP)))
    step, steps = own.period / fine, round(AHEAD / own.period)
    middles = own.times + 0.5 * own.period - delay  # a step has the torque at its middle
    sent = np.stack([np.interp(middles, own.times, column) for column in own.sent.T], axis=1)
    angles, speeds, sliding = own.coordinates[starts] + zeros, own.speeds[starts], own.states(model)[starts]
    bodies, rubbing = values[:, :nbody], values[:, nbody:]
    units = np.vstack([np.zeros(n), np.eye(n)])
    rest = np.zeros_like(speeds)
    spun = np.zeros((len(starts), n, n))  # by rotors that coupled joints share
    if model.coupled:
        still = np.zeros((n + 1, n + len(model.coupled)))
        columns = model.friction_columns(np.zeros((n + 1, n)), units, still, np.zeros((n + 1, n)))
        spun = np.einsum("kjp,sp->sjk", columns[1:] - columns[:1], rubbing)

    def friction(speeds: Array, rigid: Array) -> Array:
        state = model.sliding_after(sliding, speeds, step)
        columns = model.friction_columns(speeds, rest, state, rigid)
        return np.asarray(np.einsum("sjp,sp->sj", columns, rubbing), dtype=np.float64)

    def rate(angles: Array, speeds: Array, torques: Array, before: Array, after: Array, rigid: Array) -> Array:
        """Accelerations at a state, with friction at the end of a step from the speeds `before` to about those `after`:
        linear between these two, so that no step turns a joint back and forth.

        Args:
            angles: of the joints (nstart x njoint), in rad.
            speeds: of the joints (nstart x njoint), in rad/s.
            torques: that are sent (nstart x njoint), in N m.
            before: speeds at the beginning of the step (nstart x njoint), in rad/s.
            after: about those at its end (nstart x njoint), in rad/s.
            rigid: the torque that loads the joints (nstart x njoint), in N m.
        """
        shape = (len(angles), n + 1, n)
        where, moving = (np.broadcast_to(part[:, None], shape) for part in (angles, speeds))
        columns = model.bodies(where, moving, np.broadcast_to(units, shape))
        needed = np.einsum("skjp,sp->skj", columns, bodies, optimize=True)
        matrices = (needed[:, 1:] - needed[:, :1]).swapaxes(-1, -2) + spun
        present = friction(before, rigid)
        across = np.where(np.abs(after - before) > SLIGHT, after - before, SLIGHT)
        resisting = np.maximum((friction(before + across, rigid) - present) / across, 0.0)
        stiff = matrices + step * resisting[:, :, None] * np.eye(n)
        is_lost = ~(np.isfinite(stiff).all(axis=(1, 2)) & (np.abs(speeds).max(axis=1) < RUNAWAY))
        stiff = np.where(is_lost[:, None, None], np.eye(n), stiff)
        rest_of_torque = torques - needed[:, 0] - present
        return np.asarray(np.linalg.solve(stiff, rest_of_torque[..., None])[..., 0], dtype=np.float64)

    ends = starts + steps
    with np.errstate(all="ignore"):
        for row in range(steps):
            torques = sent[starts + row]
            rigid = np.einsum("sjp,sp->sj", model.bodies(angles, speeds, rest), bodies)  # load, without chatter
            for _ in range(fine):
                faster = rate(angles, speeds, torques, speeds, speeds, rigid)
                half = angles + 0.5 * step * speeds, speeds + 0.5 * step * faster
                faster = rate(*half, torques, speeds, speeds + step * faster, rigid)
                after = speeds + step * faster
                sliding = model.sliding_after(sliding, 0.5 * (speeds + after), step)
                angles, speeds = angles + 0.5 * step * (speeds + after), after
        seen = own.coordinates[ends] + zeros
        missed = np.nan_to_num(angles - seen, nan=LOST, posinf=LOST, neginf=-LOST)
    constant = own.coordinates[starts] + zeros + steps * own.period * own.speeds[starts] - seen
    return Motion(steps * own.period, np.clip(missed, -LOST, LOST), constant)
