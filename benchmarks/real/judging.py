"""What a written model file predicts, measured as a stranger would: by MuJoCo, by running the law in Python, by scipy.

Nothing here is shared with the code that metaid estimates with.
"""

from __future__ import annotations

import runpy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pandas as pd
from mujoco import rollout
from numpy.typing import NDArray
from scipy import signal

from metaid.models import Array

Rows = NDArray[np.bool_]  # which rows count (nrow)

LAW_STEP = 5e-4  # s, of simulations by the law in Python
ANGLES = 20.0  # Hz, of the filter that angles pass where torques pass one of their own


@dataclass(frozen=True)
class Log:
    """Times (nrow), in s, and angles, torques and perhaps speeds of the joints (nrow x njoint)."""

    name: str
    times: Array
    angles: Array
    torques: Array
    speeds: Array | None = None

    def rows(self, chosen: Any) -> Log:
        """Some of its rows."""
        speeds = None if self.speeds is None else self.speeds[chosen]
        return Log(self.name, self.times[chosen], self.angles[chosen], self.torques[chosen], speeds)

    @property
    def frame(self) -> pd.DataFrame:
        """With the columns that metaid reads."""
        kinds = {"angle": self.angles, "speed": self.speeds, "torque": self.torques}
        columns = {"time": self.times}
        for kind, values in kinds.items():
            if values is not None:
                columns |= {f"{kind}_{joint + 1}": column for joint, column in enumerate(values.T)}
        return pd.DataFrame(columns)

    def write(self, folder: Path) -> Path:
        """A CSV of it in a folder."""
        path = folder / f"{self.name}.csv"
        self.frame.to_csv(path, index=False)
        return path


@dataclass(frozen=True)
class Motion:
    """A log on a regular grid: times (nrow), in s, and of the joints (nrow x njoint) angles through a filter, their
    differences, and torques through a filter.
    """

    times: Array
    angles: Array
    speeds: Array
    accelerations: Array
    torques: Array

    @property
    def period(self) -> float:
        return float(self.times[1] - self.times[0])

    def with_zeros(self, zeros: Array) -> Motion:
        """The same with `zeros` (njoint), in rad, added to the angles."""
        return replace(self, angles=self.angles + zeros)


def low_pass(rows: Array, cutoff: float, period: float) -> Array:
    """Rows (nrow x ncolumn), `period` s apart, through a Butterworth filter of fourth order, forth and back."""
    weights = signal.butter(4, min(2.0 * cutoff * period, 0.95), output="sos")
    return np.asarray(signal.sosfiltfilt(weights, rows, axis=0), dtype=np.float64)


def motion_of(log: Log, cutoff: float, torque_cutoff: float | None = None, finest: float = 0.0) -> Motion:
    """A log whose angles pass a filter at `cutoff` Hz and whose torques pass one at `torque_cutoff` (the same where
    there is none), on a grid of its own usual period, or of `finest` s.
    """
    own = float(np.median(np.diff(log.times)))
    period = max(own, finest)
    dense, grid = (np.arange(log.times[0], log.times[-1], each) for each in (own, period))
    angles = low_pass(_at(dense, log.times, log.angles), cutoff, own)
    angles = angles if period == own else _at(grid, dense, angles)
    speeds = np.gradient(angles, period, axis=0)
    sent = low_pass(_mean_held(log, grid, period), torque_cutoff or cutoff, period)
    return Motion(grid, angles, speeds, np.gradient(speeds, period, axis=0), sent)


def _at(times: Array, known: Array, rows: Array) -> Array:
    return np.stack([np.interp(times, known, column) for column in rows.T], axis=1)


def _mean_held(log: Log, grid: Array, period: float) -> Array:
    """Torques, each held until the next row, averaged over the `period` around each time of a grid."""
    impulse = np.zeros_like(log.torques)
    impulse[1:] = np.cumsum(log.torques[:-1] * np.diff(log.times)[:, None], axis=0)
    edges = np.append(grid - period / 2.0, grid[-1] + period / 2.0)
    mean = np.diff(_at(edges, log.times, impulse), axis=0) / period
    mean[0], mean[-1] = log.torques[0], log.torques[-1]
    return np.asarray(mean, dtype=np.float64)


def held(log: Log, times: Array) -> Array:
    """The torques (... x njoint) that are logged to act at some times (...)."""
    last = np.searchsorted(log.times, times + 1e-9, side="right") - 1
    return log.torques[np.clip(last, 0, len(log.times) - 1)]


def file_torques(path: Path, motion: Motion) -> Array:
    """What a file predicts (nrow x njoint): the law in Python called with all rows in order, MuJoCo's inverse dynamics
    of an MJCF without limits and contacts.
    """
    if path.suffix == ".py":
        law: Callable[..., Any] = runpy.run_path(str(path))["inverse_dynamics"]
        sent = law(motion.angles.tolist(), motion.speeds.tolist(), motion.accelerations.tolist())
        return np.asarray(sent, dtype=np.float64).reshape(motion.angles.shape)
    return mujoco_torques(free_model(path), motion)


def free_model(path: Path) -> Any:
    """The model (mujoco.MjModel) of an MJCF without limits and contacts."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT | mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return model


def mujoco_torques(model: Any, motion: Motion) -> Array:
    """MuJoCo's inverse dynamics (nrow x njoint) of a model (mujoco.MjModel) along a motion."""
    data, torques = mujoco.MjData(model), np.empty(motion.angles.shape)
    for row, state in enumerate(zip(motion.angles, motion.speeds, motion.accelerations, strict=True)):
        data.qpos[:], data.qvel[:], data.qacc[:] = state
        mujoco.mj_inverse(model, data)
        torques[row] = data.qfrc_inverse
    return torques


def simulated(model: Any, angles: Array, speeds: Array, log: Log, starts: Array, seconds: float) -> tuple[Array, Array]:
    """Angles and speeds (nstart x njoint) after some `seconds` of MuJoCo's simulation from states (nstart x njoint) at
    times `starts` (nstart), in s, under the torques of a log.
    """
    angles, speeds = course(model, angles, speeds, log, starts, seconds)
    return angles[:, -1], speeds[:, -1]


def course(model: Any, angles: Array, speeds: Array, log: Log, starts: Array, seconds: float) -> tuple[Array, Array]:
    """The same after each step (nstart x nstep x njoint)."""
    step = float(model.opt.timestep)
    count, n = round(seconds / step), model.nv
    sent = held(log, starts[:, None] + step * np.arange(count))
    whole = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    initial = np.zeros((len(starts), whole))
    initial[:, 1 : 1 + n], initial[:, 1 + n : 1 + 2 * n] = angles, speeds
    applied = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
    states, _ = rollout.rollout(model, mujoco.MjData(model), initial, sent, control_spec=applied)
    return np.asarray(states[..., 1 : 1 + n]), np.asarray(states[..., 1 + n : 1 + 2 * n])


def simulated_by_law(path: Path, motion: Motion, starts: NDArray[np.intp], log: Log, seconds: float) -> Array:
    """Speeds (nstart x njoint) after some `seconds` of a simulation by the law in Python from rows `starts` (nstart) of
    a motion, under the torques of a log. Its pre-sliding follows the motion up to there.
    """
    law = runpy.run_path(str(path))
    slide: Callable[..., Any] = law.get("slide", lambda slip, moved: None)
    slip, slips = None, {}
    for row, moved in enumerate(np.diff(motion.angles[: starts[-1] + 1], axis=0, prepend=motion.angles[:1])):
        slip = slide(slip, moved)
        slips[row] = slip
    count = round(seconds / LAW_STEP)
    return np.array([[v for _, v in law_course(law, motion, row, log, count, slips[row])][-1] for row in starts])


def law_course(
    law: dict[str, Any], motion: Motion, row: int, log: Log, count: int, slip: Any = None
) -> Iterator[tuple[Array, Array]]:
    """Angles and speeds (njoint each) after each step of a simulation by the law in Python.

    Args:
        law: what its file defines.
        motion: from a state of which it begins.
        row: that of the motion.
        log: under whose torques it moves.
        count: of its steps.
        slip: what the law says of pre-sliding there.
    """
    slide: Callable[..., Any] = law.get("slide", lambda slip, moved: None)
    q, v, a = motion.angles[row], motion.speeds[row], motion.accelerations[row]
    for sent in held(log, motion.times[row] + LAW_STEP * np.arange(count)):
        needed = law["inverse_dynamics"](q.tolist(), v.tolist(), a.tolist(), *([] if slip is None else [slip]))
        a = a + np.linalg.solve(law["mass_matrix"](q.tolist()), sent - np.array(needed))
        slip = slide(slip, LAW_STEP * (v + 0.5 * LAW_STEP * a))
        q, v = q + LAW_STEP * (v + 0.5 * LAW_STEP * a), v + LAW_STEP * a
        yield q, v


@dataclass(frozen=True)
class Missed:
    """Sums of squares of what was missed and of what was to be predicted (njoint each)."""

    squares: Array
    whole: Array

    @property
    def relative(self) -> float:
        return float(np.sqrt(self.squares.sum() / self.whole.sum()))

    @property
    def by_joint(self) -> list[float]:
        return np.sqrt(self.squares / self.whole).tolist()  # type: ignore[no-any-return]


def missed(pairs: Sequence[tuple[Array, Array]]) -> Missed:
    """Of pairs of predicted and measured torques (nrow x njoint each)."""
    squares = np.sum([((one - other) ** 2).sum(axis=0) for one, other in pairs], axis=0)
    return Missed(squares, np.sum([(other**2).sum(axis=0) for _, other in pairs], axis=0))
