"""What a fit compares on an arm without noise: the windows of each push, against twins under the same laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.spatial import follow_laws
from metaid.estimation.descent import NOTHING, Residuals
from metaid.estimation.faults import NO_FAULTS, SearchedFaults
from metaid.estimation.spatial.unknowns import ArmUnknowns
from metaid.estimation.trials import Replay, WatchedArmTrial
from metaid.models import Array

RESOLUTION = 1e-7  # of the largest speed at a start: more than rounding leaves between two simulations
EXPLAINED = 3.0
# A longer step of an unknown is more often past where a joint begins to stick, a shorter one leaves rounding.
STEP = 1e-7
THREADS = 2


@dataclass(frozen=True, eq=False)
class ArmMotions:
    """All `trials` of a study. Compared is the signed change of each joint's speed from the start to the end of each
    window (Eq. 52), in units of the `resolution`, a share of the fastest start.
    """

    trials: Sequence[WatchedArmTrial]
    unknowns: ArmUnknowns
    resolution: float = RESOLUTION

    def __post_init__(self) -> None:
        if not any(trial.windows.seen.any() for trial in self.trials):
            raise ValueError("no push of any trial was seen to the end of its shortest window: nothing to compare")

    @property
    def spreads(self) -> Array:
        """Of the unknowns (nbase), beforehand."""
        return np.full(len(self.unknowns.names), self.unknowns.spread)

    @property
    def stages(self) -> int:
        """How many windows the longest trial has."""
        return max(len(trial.windows.ends) for trial in self.trials)

    @property
    def rough_stages(self) -> int:
        """All but the last."""
        return self.stages - 1

    @property
    def stride(self) -> int:
        """Windows grow one by one."""
        return 1

    @property
    def ends_when_cut(self) -> bool:
        """As it is for an arm."""
        return self.unknowns.ends_when_cut

    @property
    def least_gain(self) -> float:
        """What rounding leaves."""
        return NOTHING

    @property
    def faults(self) -> SearchedFaults:
        """None: they are searched in readings."""
        return NO_FAULTS

    @property
    def explained_below(self) -> float:
        """A misfit below this says that the model explains what was seen."""
        return EXPLAINED

    @property
    def extras(self) -> int:
        """None: where a push began is known."""
        return 0

    def residuals(self, point: Array, windows: int) -> Residuals | None:
        """Those of the first `windows` windows, or None where no arm has such parameters or it does not get there."""
        count = len(point)
        candidates = self.unknowns.parameters(np.vstack([point, beside(point)]))
        values, slopes = [], []
        for trial in self.trials:
            speeds = self._speeds(trial, candidates, windows)
            if speeds is None:
                return None
            unit, seen = self._unit(trial), _seen(trial, windows)
            values.append(unit * (speeds[0] - trial.windows.speeds[seen]).ravel())
            slopes.append((unit / STEP) * (speeds[1:] - speeds[0]).reshape(count, -1).T)
        together = np.concatenate(values)
        cost = 0.5 * float(together @ together)
        return Residuals(together, np.vstack(slopes), cost, len(together), np.empty((0, 1 + count)))

    def by_joint(self, point: Array) -> tuple[Array, ...]:
        """Root mean square of the residuals of each trial (npush x njoint) over all windows, in units of the
        resolution; NaN where a push was not seen.
        """
        tables = []
        for trial in self.trials:
            seen, table = _seen(trial, self.stages), np.full(trial.starts.shape[::2], np.nan)
            speeds = self._speeds(trial, self.unknowns.parameters(point[None]), self.stages)
            if speeds is not None:
                squares = np.zeros((*seen.shape, trial.law.shape[0]))
                squares[seen] = (self._unit(trial) * (speeds[0] - trial.windows.speeds[seen])) ** 2
                count = trial.windows.seen[:, None]
                table = np.sqrt(np.divide(squares.sum(axis=1), count, out=table, where=count > 0))
            tables.append(table)
        return tuple(tables)

    def replay(self, number: int, point: Array) -> Replay:
        """The trial of that `number`, and the twin at a `point` in its place. Steps are Euler's, so the speeds after
        each are all that there is to know of where the twin is.
        """
        trial, frames, candidates = self.trials[number], self.unknowns.frames, self.unknowns.parameters(point[None])
        ends, seen = trial.windows.ends, np.arange(len(trial.windows.ends)) < trial.windows.seen[:, None]
        last = np.append(0, ends)[trial.windows.seen]
        steps = np.arange(1, ends[-1] + 1)
        twin = follow_laws(
            frames, trial.law, candidates, (trial.starts, trial.stiffness), (steps, last), trial.timestep
        )
        angles = trial.starts[:, 0, None] + trial.timestep * np.cumsum(twin.values[0], axis=1)
        shown = (steps <= last[:, None]) & twin.arrived[0][:, None]
        watched = np.full(angles.shape, np.nan)
        watched[:, ends - 1] = np.where(seen[..., None], trial.windows.angles, np.nan)
        simulated = np.where(shown[..., None], angles, np.nan)
        return Replay(trial.timestep * steps, watched, simulated, np.zeros(self.unknowns.njoint), self.unknowns.joints)

    def _unit(self, trial: WatchedArmTrial) -> float:
        return 1.0 / (self.resolution * float(np.abs(trial.starts[:, 1]).max()))

    def _speeds(self, trial: WatchedArmTrial, candidates: Array, windows: int) -> Array | None:
        """Joint speeds of twins (ncandidate x nseen x njoint) at the windows that were seen."""
        wanted = np.minimum(trial.windows.seen, windows)
        pushes, frames = (trial.starts, trial.stiffness), self.unknowns.frames
        found = follow_laws(
            frames, trial.law, candidates, pushes, (trial.windows.ends, wanted), trial.timestep, THREADS
        )
        if not found.arrived[:, wanted > 0].all():
            return None
        speeds: Array = found.values[:, _seen(trial, windows)]
        return speeds


def beside(point: Array) -> Array:
    """Points (nunknown x nunknown) a STEP from a `point` (nunknown) along each unknown.

    Differences to one side cost half of those to both. What they are wrong by, a STEP's share of the curvature, is less
    than a step of the descent needs to be right by.
    """
    return np.asarray(point + STEP * np.eye(len(point)), dtype=np.float64)


def _seen(trial: WatchedArmTrial, windows: int) -> NDArray[np.bool_]:
    """Which of the first `windows` windows of each push were seen (npush x nwindow)."""
    window = np.arange(len(trial.windows.ends))
    return np.asarray((window < trial.windows.seen[:, None]) & (window < windows))
