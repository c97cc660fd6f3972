"""What metaid is compared with: least squares with a filter and weights that are tuned on what is then predicted,
figaroh's recipe, and instrumental variables.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

from benchmarks.real.judging import Log, Motion, Rows, motion_of
from metaid.models import Array
from metaid.recorded import LinearModel

MOVES = 0.01  # rad/s: rows in which some joint is faster are fitted
RECIPE, STRIDE = 100.0, 10  # Hz of the filter and rows of which one is taken, in figaroh's example
WEIGHTS = ("", "by joint", "across joints")
ROUNDS = 4


def solve(rows: Array, torques: Array, weigh: str) -> Array:
    """Unknowns (nparam) from rows (nrow x njoint x nparam) that explain torques (nrow x njoint): weighted not at all,
    `by joint`, or by the covariance `across joints`.
    """
    njoint = torques.shape[1]
    whitening = np.eye(njoint)
    for _ in range(ROUNDS if weigh else 1):
        flat = np.einsum("ij,njp->nip", whitening, rows).reshape(-1, rows.shape[-1])
        scale = np.sqrt((flat**2).sum(axis=0))
        scale[scale == 0.0] = 1.0
        solved = np.linalg.lstsq(flat / scale, (torques @ whitening.T).ravel(), rcond=1e-10)[0] / scale
        left = torques - rows @ solved
        covariance = left.T @ left / len(left)
        kept = covariance if weigh == "across joints" else np.diag(np.diag(covariance))
        whitening = np.linalg.inv(np.linalg.cholesky(kept))
    return np.asarray(solved, dtype=np.float64)


@dataclass(frozen=True)
class Prepared:
    """A motion with the torque for a unit of each unknown of the bodies (nrow x njoint x nbody), and the state of dry
    friction (nrow x nmotor).
    """

    model: LinearModel
    motion: Motion
    bodies: Array
    sliding: Array

    def design(self, rigid: Array) -> Array:
        """The torque for a unit of each unknown (nrow x njoint x nparam), where friction that grows with the load does
        so with the torques `rigid` of the bodies (nrow x njoint).
        """
        motion = self.motion
        friction = self.model.friction_columns(motion.angles, motion.speeds, motion.accelerations, self.sliding, rigid)
        return np.concatenate([self.bodies, friction], axis=-1)

    def rigid(self, values: Array) -> Array:
        """The torques of the bodies (nrow x njoint) by unknowns (nparam)."""
        return np.asarray(self.bodies @ values[: self.model.nbody], dtype=np.float64)

    def predicted(self, values: Array) -> Array:
        """All torques (nrow x njoint) by unknowns (nparam)."""
        return np.asarray(self.design(self.rigid(values)) @ values, dtype=np.float64)


def prepared(model: LinearModel, motion: Motion) -> Prepared:
    """What a model needs of a motion."""
    bodies = model.bodies(motion.angles, motion.speeds, motion.accelerations)
    sliding = model.sliding.along(motion.angles, motion.speeds)
    return Prepared(model, motion, bodies, sliding)


def fitted(parts: Sequence[Prepared], kept: Sequence[Rows], weigh: str) -> Array:
    """Unknowns (nparam) that explain the rows of motions that are `kept` (nrow each); the load that friction grows with
    is that of the last round, in the first one the measured torque.
    """
    torques = np.concatenate([part.motion.torques[rows] for part, rows in zip(parts, kept, strict=True)])
    loads = [part.motion.torques for part in parts]
    for _ in range(ROUNDS if "load" in parts[0].model.friction else 1):
        rows = [part.design(load)[own] for part, load, own in zip(parts, loads, kept, strict=True)]
        values = solve(np.concatenate(rows), torques, weigh)
        loads = [part.rigid(values) for part in parts]
    return values


def tuned(model: LinearModel, logs: Sequence[Log], cutoffs: Sequence[float]) -> Iterator[tuple[str, Array]]:
    """Name and unknowns of every filter and weight, from the rows in which some joint moves."""
    for cutoff in cutoffs:
        parts = [prepared(model, motion_of(log, cutoff, finest=0.002)) for log in logs]
        kept = [np.asarray((np.abs(part.motion.speeds) > MOVES).any(axis=1), dtype=np.bool_) for part in parts]
        for weigh in WEIGHTS:
            yield f"{cutoff:g} Hz" + (f", weighted {weigh}" if weigh else ""), fitted(parts, kept, weigh)


def recipe(model: LinearModel, logs: Sequence[Log], weigh: str) -> Array:
    """Unknowns (nparam) by what figaroh's example does: a Butterworth filter, differences, every tenth row."""
    rows, torques = [], []
    for log in logs:
        motion = motion_of(log, RECIPE)
        rows.append(signal.decimate(prepared(model, motion).design(motion.torques), STRIDE, axis=0, zero_phase=True))
        sent = np.stack([np.interp(motion.times, log.times, column) for column in log.torques.T], axis=1)
        torques.append(signal.decimate(sent, STRIDE, axis=0, zero_phase=True))
    return solve(np.concatenate(rows), np.concatenate(torques), weigh)


def instrumental(model: LinearModel, logs: Sequence[Log], references: Sequence[Log], cutoff: float) -> Array:
    """Unknowns (nparam) by instrumental variables: rows of the motions that were asked for, which no noise of the
    encoders reaches, in place of those that were measured.
    """
    measured = [prepared(model, motion_of(log, cutoff, finest=0.002)) for log in logs]
    asked = [prepared(model, motion_of(log, cutoff, finest=0.002)) for log in references]
    rows, instruments = (
        np.concatenate([part.design(part.motion.torques) for part in each]) for each in (measured, asked)
    )
    torques = np.concatenate([part.motion.torques for part in measured])
    scale = np.sqrt((rows**2).sum(axis=(0, 1)))
    scale[scale == 0.0] = 1.0
    weight = np.ones(torques.shape[1])
    for _ in range(ROUNDS):
        weighed = np.einsum("njp,j->njp", instruments / scale, weight)
        cross = np.einsum("njp,njq->pq", weighed, rows / scale)
        values = np.linalg.pinv(cross, rcond=1e-8) @ np.einsum("njp,nj->p", weighed, torques) / scale
        weight = 1.0 / ((torques - rows @ values) ** 2).mean(axis=0)
    return np.asarray(values, dtype=np.float64)
