"""Gains of the drives, from logs with a payload of known mass beside logs without one.

A log alone scales with its torques. A known weight does not: in each joint by itself the torque that it adds says what
a unit of the log is in N m. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.errors import RecordError
from metaid.models import COARSEST, DEVIATIONS, Array, jackknife
from metaid.models.tree import torque_regressor
from metaid.recorded.weak_form.equations import Equations, first_equations
from metaid.recorded.weak_form.folds import THIRDS
from metaid.recorded.weak_form.linear_model import LinearModel
from metaid.recorded.weak_form.normal import FLAT, eliminated_covariance
from metaid.recorded.weak_form.smoothed import Smoothed
from metaid.recorded.weak_form.windows import LogWindows

FRICTION = ("viscous", "coulomb", "root", "offset")
FIRST = 10  # of a body's parameters: mass, first moments, moments of inertia
APART = 0.5  # by which gains of one robot's joints differ beforehand, as a share of them
LEAST_MASS, MOST_MASS = 1e-3, 1e4  # kg


@dataclass(frozen=True)
class Payload:
    """A `log` of the robot with a `mass` in kg on its last link, whose centre is `at` these places of the link's frame,
    in m; where that is not said, anywhere.

    Raises RecordError where that cannot be.
    """

    log: str | Path | pd.DataFrame
    mass: float
    at: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if not LEAST_MASS <= self.mass <= MOST_MASS:
            raise RecordError(f"payload of {self.mass:g} kg (allowed: {LEAST_MASS:g} to {MOST_MASS:g})")
        if self.at is not None and not (len(self.at) == 3 and np.isfinite(self.at).all()):
            raise RecordError(f"payload at {self.at} (allowed: three numbers in m, in the frame of the last link)")


@dataclass(frozen=True)
class Gains:
    """What the torques of a log are to be multiplied with, so that they are in N m or N.

    Attributes:
        joints: their names (njoint).
        values: the gains (njoint).
        relative: standard deviations, as shares of them (njoint).
        is_told: of which (njoint) the payload tells it to a tenth.
    """

    joints: tuple[str, ...]
    values: Array
    relative: Array
    is_told: NDArray[np.bool_]

    @property
    def frame(self) -> pd.DataFrame:
        """One row a joint: its gain, deviation, and the interval of 95 %, whose ends are those of the reciprocal's, NaN
        where there is none.
        """
        reach = DEVIATIONS * self.relative
        near = self.values / (1.0 + reach)
        far = np.where(reach < 1.0, self.values / np.where(reach < 1.0, 1.0 - reach, 1.0), np.nan)
        return pd.DataFrame({
            "joint": self.joints,
            "gain": self.values,
            "sd": np.abs(self.values) * self.relative,
            "low": np.where(self.values > 0.0, near, far),
            "high": np.where(self.values > 0.0, far, near),
            "determined": self.is_told,
        })  # fmt: skip

    @property
    def text(self) -> str:
        """Which joints the payload tells, in a sentence without a full stop."""
        told = [joint for joint, known in zip(self.joints, self.is_told, strict=True) if known]
        rest = [joint for joint, known in zip(self.joints, self.is_told, strict=True) if not known]
        words = f"the payload tells the gains of {', '.join(told)} to {COARSEST:.0%} or better"
        if rest:
            words += f", and not those of {', '.join(rest)}: theirs are taken to be as the others', to a half"
        return words


def drive_gains(unloaded: Sequence[Smoothed], loaded: Sequence[tuple[Smoothed, Payload]], model: LinearModel) -> Gains:
    """The gains of the drives.  Eq. 74.

    Args:
        unloaded: the logs without a payload, on their grids.
        loaded: those with one.
        model: what is unknown of the robot, an arm.

    Raises:
        RecordError: the logs are too short, or the payload tells no gain.
    """
    logs = [*unloaded, *(own for own, _ in loaded)]
    model = model.with_friction(FRICTION)
    equations = first_equations(logs, model)
    if equations is None:
        raise RecordError(
            f"{logs[-1].record.name}: too short for the gains of {model.njoint} joints (allowed: more motion)"
        )
    payloads = [None] * len(unloaded) + [payload for _, payload in loaded]
    shapes = list(dict.fromkeys((each.mass, each.at) for each in payloads if each is not None))
    columns = [_columns(part, model, each, shapes) for part, each in zip(equations.parts, payloads, strict=True)]
    found = np.array([_of_joint(equations, columns, joint) for joint in range(model.njoint)])
    reciprocal, deviation = found.T
    is_told = deviation < COARSEST * np.abs(reciprocal)
    if not is_told.any():
        best = int((deviation / np.maximum(np.abs(reciprocal), 1e-300)).argmin())
        raise RecordError(
            f"payload: no gain is told to {COARSEST:.0%}, that of joint {model.joints[best]} best, to "
            f"{deviation[best] / max(abs(reciprocal[best]), 1e-300):.0%} (allowed: a heavier payload, more motion)"
        )
    common = float(np.median(np.abs(reciprocal[is_told])))
    own, usual = deviation**-2.0, np.where(is_told, 0.0, (APART * common) ** -2.0)
    reciprocal = (own * reciprocal + usual * common) / (own + usual)
    relative = (own + usual) ** -0.5 / np.abs(reciprocal)
    return Gains(model.joints, 1.0 / reciprocal, relative, is_told)


def _columns(
    part: LogWindows,
    model: LinearModel,
    payload: Payload | None,
    shapes: Sequence[tuple[float, tuple[float, ...] | None]],
) -> Array:
    """The averaged torque (nwindow x ntest x njoint x ncolumn): for a unit of each unknown of the bodies, of friction
    without and with a payload, of what is unknown of each payload, and the torque of what is known of it.

    Args:
        part: windows of a log.
        model: of the robot.
        payload: that it carries; None where there is none.
        shapes: mass and place of all payloads.
    """
    rows = part.rows(model, np.zeros_like(part.speeds), np.zeros(model.njoint))  # no friction grows with load
    bodies, friction = np.split(rows, [model.nbody], axis=-1)
    empty = np.zeros_like(friction)
    own = np.zeros((*friction.shape[:-1], len(shapes), FIRST))
    if payload is not None:
        motion = part.coordinates, part.speeds, part.accelerations
        moments = part.averaged(torque_regressor(model.tree, *motion)[..., -1, :FIRST])
        which = shapes.index((payload.mass, payload.at))
        known, unknown = _of_payload(payload)
        own[..., which, 0] = moments @ known
        own[..., which, 1:] = moments[..., 1:] * unknown
    weights = own[..., 0].sum(axis=-1, keepdims=True)
    rubbing = [friction, empty] if payload is None else [empty, friction]
    return np.concatenate([bodies, *rubbing, own[..., 1:].reshape(*friction.shape[:-1], -1), weights], axis=-1)


def _of_payload(payload: Payload) -> tuple[Array, Array]:
    """What is known of the ten parameters of a payload (10), and which of the last nine are unknown beside (9)."""
    known, unknown = np.zeros(FIRST), np.ones(FIRST - 1)
    centre = np.zeros(3) if payload.at is None else np.asarray(payload.at, dtype=np.float64)
    known[0], known[1:4] = 1.0, centre
    known[4:] = (centre @ centre * np.eye(3) - np.outer(centre, centre))[np.triu_indices(3)]
    if payload.at is not None:
        unknown[:3] = 0.0
    return payload.mass * known, unknown


def _of_joint(equations: Equations, columns: Sequence[Array], joint: int) -> tuple[float, float]:
    """The reciprocal of a joint's gain, and its standard deviation: the larger of that of Eq. 70 and the jackknife's.

    The torque as it is logged is linear in the parameters of the robot and its payload, divided by the gain, and the
    torque of the known weight is multiplied by the same.
    """
    from scipy.special import stdtrit  # slow to load

    rows = [each[:, :, joint] for each in columns]
    sent = [torques[:, :, joint] for torques in equations.torques]
    usual = float(np.sqrt(np.mean(np.concatenate([each.ravel() for each in sent]) ** 2)))
    squares = np.sum([(each**2).sum(axis=(0, 1)) for each in rows], axis=0)
    sizes = np.sqrt(squares / sum(each[..., 0].size for each in rows))
    if not usual > 0.0 or not sizes[-1] > 0.0:
        return 0.0, np.inf
    used = sizes > 0.0
    scaled = [each[..., used] * (usual / sizes[used]) for each in rows]
    prior = np.full(used.sum(), FLAT**-2.0)
    variance = usual**2
    blocks = [
        (own[which], torques[which])
        for own, torques in zip(scaled, sent, strict=True)
        for which in np.array_split(np.arange(len(own)), THIRDS)
    ]
    grams = np.array([np.einsum("wap,waq->pq", own, own) for own, _ in blocks])
    moments = np.array([np.einsum("wap,wa->p", own, torques) for own, torques in blocks])

    def solved(gram: Array, moment: Array) -> tuple[Array, Array]:
        inverse = np.linalg.inv(gram / variance + np.diag(prior))
        return inverse, inverse @ moment / variance

    for _ in range(2):
        inverse, values = solved(grams.sum(axis=0), moments.sum(axis=0))
        left = [torques - own @ values for own, torques in zip(scaled, sent, strict=True)]
        variance = max(float(np.mean(np.concatenate([each.ravel() for each in left]) ** 2)), (1e-9 * usual) ** 2)
    scores = [np.einsum("wap,wa->wp", own, missed) / variance for own, missed in zip(scaled, left, strict=True)]
    own_variance = (eliminated_covariance(inverse, scores, equations.lags) + inverse * prior @ inverse)[-1, -1]
    without = np.array([
        solved(grams.sum(axis=0) - gram, moments.sum(axis=0) - moment)[1][-1]
        for gram, moment in zip(grams, moments, strict=True)
    ])  # fmt: skip
    spread = jackknife(without) * stdtrit(len(without) - 1.0, 0.975) / DEVIATIONS  # Student's t: of so few parts
    unit = usual / sizes[-1]
    return float(values[-1] * unit), float(max(np.sqrt(own_variance), spread) * unit)  # Eq. 71
