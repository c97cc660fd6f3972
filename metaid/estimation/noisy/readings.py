"""What a fit compares on a noisy plant: the readings of each push, against a twin that is driven by what was commanded
and whose start speeds are unknown within what pushes differ by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from metaid.estimation.descent import Residuals
from metaid.estimation.faults import NO_FAULTS, SearchedFaults
from metaid.estimation.noisy.polynomials import before
from metaid.estimation.noisy.smoothed import smoothed
from metaid.estimation.noisy.windows import Compared, ReadingsInWindows
from metaid.estimation.trials import Coefficients, Driven, Gains, Joints, ReadTrial, Replay
from metaid.estimation.twin import Twin
from metaid.estimation.twins import twin_of
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array

DRAWN = 100  # readings of a push that a replay keeps
DIFFERENCE, TINY = 1e-3, 1e-12  # of a further torque, as a share of the largest commanded; and no torque, in N m
STEP = 1e-6  # in an unknown fault, for the derivative by it


@dataclass(frozen=True, eq=False)
class Readings(ReadingsInWindows):
    """All `trials` of a noisy study. The unknowns of all pushes are those of the robot, and behind them the `faults`
    that are searched.
    """

    faults: SearchedFaults = field(default=NO_FAULTS, kw_only=True)

    @property
    def spreads(self) -> Array:
        """Of the log factors and the faults (nunknown), beforehand."""
        return np.append(super().spreads, np.ones(len(self.faults.names)))

    def residuals_with(
        self, point: Array, torques: Sequence[Array], moved: Sequence[Unknowns] = ()
    ) -> Residuals | None:
        """Those on all windows with further joint `torques` of each trial (ntorque x npush x nstep x njoint), in N m,
        whose sizes are unknowns, too, behind the others. Behind those is how far the robot is on the way to each of the
        `moved` ones, of which nothing is unknown.
        """

        def _compared(number: int, unknowns: Array, whitened: Array, windows: int) -> Compared | None:
            compared = self._compare(number, unknowns, whitened, windows)
            if compared is None:
                return None
            further = self._compare_driven(number, unknowns, whitened, compared[0], torques[number])
            beside = self._compare_moved(number, unknowns, whitened, compared[0], moved)
            if further is None or beside is None:
                return None
            return _with_slopes(compared, len(unknowns), np.concatenate([further, beside], axis=-1))

        return self._eliminated(point, self.stages, _compared, len(self.spreads) + len(torques[0]) + len(moved))

    def least_cost(self, point: Array, windows: int) -> float:
        """All of it, by the twin without derivatives."""
        cost = 0.0
        for number in range(len(self.trials)):
            unknowns, whitened = self._of_trial(number, point)
            log_factors, faults = self._parted(unknowns)
            values = self._alone(log_factors)._shown(number, faults, whitened, windows)
            if values is None:
                return np.inf
            cost += 0.5 * float((values**2).sum() + (whitened**2).sum())
        return cost

    @property
    def is_led(self) -> bool:
        """Whether the readings set the twin right."""
        return False

    def motion(self, number: int) -> tuple[Array, Array]:
        """Angles, in rad, and speeds, in rad/s, of the joints at each step of a trial (npush x nstep x njoint), as far
        as its readings tell; zeros after a fall.
        """
        return smoothed(self.trials[number])

    def replay(self, number: int, point: Array) -> Replay:
        """The trial of that `number`, some of its readings left out, and the twin at a `point` in its place."""
        trial, (unknowns, whitened) = self.trials[number], self._of_trial(number, point)
        log_factors, faults = self._parted(unknowns)
        starts = started(trial, whitened)
        (npush, nreading, _), last = trial.readings.shape, self._windows[number][0][-1]
        kept = np.unique(np.linspace(0, last, min(last, DRAWN) + 1).round().astype(int))
        basis = np.zeros((nreading, len(kept)))
        basis[kept, np.arange(len(kept))] = 1.0  # each coefficient is the angle at one reading
        twin, steps = self.unknowns.alone(log_factors), np.minimum(trial.steps, last)
        alike, joints = replace(self._delivered(trial, faults), start_spread=None), self._joints(faults)
        driven = Driven(alike, starts, steps, np.tile(basis, (npush, 1, 1)))
        motion = twin_of(twin, np.empty(0)).drive(driven, joints)
        shown = (kept <= steps[:, None]) & (steps[:, None] > 0)
        seen = np.where(shown[..., None], trial.readings[:, kept], np.nan)
        simulated = np.full_like(seen, np.nan)
        if motion is not None:
            simulated[shown] = motion.values.swapaxes(1, 2)[shown]
        return Replay(trial.timestep * trial.substeps * kept, seen, simulated, trial.noise, self.unknowns.joints)

    def _compare(self, number: int, unknowns: Array, whitened: Array, windows: int) -> Compared | None:
        """What a trial shows; derivatives by the `whitened` start speeds are the last."""
        watched = self._watch(number, unknowns, whitened, windows)
        if watched is None or not self.faults.names:
            return watched
        by_faults = self._compare_faulty(number, unknowns, whitened, watched[0], windows)
        if by_faults is None:
            return None
        values, slopes = _with_slopes(watched, len(self.unknowns.names), by_faults)
        if (hidden := self._hidden(unknowns)) is not None:
            slopes[..., : len(hidden)] -= (slopes[..., : len(hidden)] @ hidden)[..., None] * hidden
        return values, slopes

    def _hidden(self, unknowns: Array) -> Array | None:
        """The direction (nunknown) in which robot and faults move without anything that shows, of length 1. Rounding of
        differences along it, exact sensors would take for knowledge. None where there is none.
        """
        if "offset" not in self.faults.kinds:
            return None
        robot = self.unknowns.hides_offset(self._parted(unknowns)[0])
        if robot is None:
            return None
        last = self.faults.names.index(f"offset_{self.unknowns.njoint}")
        hidden = np.append(robot, np.eye(len(self.faults.names))[last] / self.faults.scales)
        return np.asarray(hidden / np.linalg.norm(hidden), dtype=np.float64)

    def _compare_alone(self, number: int, unknowns: Array, whitened: Array, windows: int) -> Compared | None:
        log_factors, faults = self._parted(unknowns)
        return self._alone(log_factors)._watch(number, faults, whitened, windows)

    def _watch(self, number: int, unknowns: Array, whitened: Array, windows: int) -> Compared | None:
        """The same, without derivatives by faults."""
        log_factors, faults = self._parted(unknowns)
        trial = self._delivered(self.trials[number], faults)
        starts, joints = started(trial, whitened), self._joints(faults)
        left = self._left(number, trial, starts, windows, log_factors, joints)
        if left is None:
            return None
        npush, count = len(starts), len(log_factors)
        slopes = left.slopes.reshape(npush, left.values[0].size, -1)
        if trial.start_spread is not None:
            slopes[..., count:] = slopes[..., count:] @ trial.start_spread
        return left.values.reshape(npush, -1), slopes

    def _shown(
        self,
        number: int,
        faults: Array,
        whitened: Array,
        windows: int,
        acted: ReadTrial | None = None,
        is_rough: bool = False,
    ) -> Array | None:
        """What a robot of which nothing is unknown shows in a trial (npush x nvalue), or None: its twin cannot follow.

        Args:
            number: of the trial.
            faults: the unknown ones (nfault).
            whitened: what each push has alone (npush x nextra).
            windows: of which the longest is watched.
            acted: the trial with the torques that acted; None for those that the faults make of what was commanded.
            is_rough: whether it is to be compared with what others show as roughly.
        """
        trial = self._delivered(self.trials[number], faults) if acted is None else acted
        starts, bare = started(trial, whitened), replace(trial, start_spread=None)
        left = self._left(number, bare, starts, windows, np.empty(0), self._joints(faults), is_rough)
        return None if left is None else left.values.reshape(len(starts), -1)

    def _shown_roughly(
        self, number: int, faults: Array, whitened: Array, windows: int, acted: ReadTrial, values: Array
    ) -> Array | None:
        """The same, to be compared with what others show as roughly; the `values` where a twin has no rough steps."""
        if not (acted.is_continuous and self._only_twin.has_rough_steps):
            return values
        return self._shown(number, faults, whitened, windows, acted, is_rough=True)

    def _left(
        self,
        number: int,
        trial: ReadTrial,
        starts: Array,
        windows: int,
        log_factors: Array,
        joints: Joints | None,
        is_rough: bool = False,
    ) -> Coefficients | None:
        """What the twin shows less what was read, scaled by the noise, and its derivatives; where it is led by what was
        read, its whitened innovations. None where it cannot follow.

        Args:
            number: of the trial.
            trial: with the torques that acted.
            starts: joint coordinates and speeds (npush x 2 x njoint) right after each push.
            windows: of which the longest is watched.
            log_factors: the unknowns (nlump).
            joints: what they have beside the lumps; None for nothing.
            is_rough: whether steps of a lower order do.
        """
        (chosen, steps), (_, basis) = self._longest(number, windows), self._windows[number]
        driven = Driven(trial, starts, steps, basis[chosen], is_rough)
        led = self._gains(number)
        twin = self._twin(log_factors).drive(driven, joints, led=led)
        if twin is None or led is not None:
            return twin
        plants = np.einsum("ptk,ptj->pjk", basis[chosen], trial.readings * before(steps, trial.readings.shape[1]))
        unit = 1.0 / trial.noise[None, :, None]
        return Coefficients(unit * (twin.values - plants), unit[..., None] * twin.slopes)

    def _gains(self, number: int) -> Gains | None:
        """Of the filter that leads the twin through a trial; None where nothing does."""
        return None

    def _twin(self, log_factors: Array) -> Twin:
        """The robot with these `log_factors` (nunknown)."""
        return twin_of(self._on_base, log_factors) if len(log_factors) else self._only_twin

    @cached_property
    def _only_twin(self) -> Twin:
        """The robot of which nothing is unknown."""
        return twin_of(self._on_base, np.empty(0))

    @property
    def _on_base(self) -> Unknowns:
        """What is unknown of the robot, on a base that may be tilted or is level."""
        return self.unknowns if "tilt" in self.faults.kinds else self.unknowns.level

    def _parted(self, unknowns: Array) -> tuple[Array, Array]:
        """The unknowns of the robot (nunknown) and the faults (nfault) among the `unknowns` of all pushes."""
        return unknowns[: len(self.unknowns.names)], unknowns[len(self.unknowns.names) :]

    def _delivered(self, trial: ReadTrial, faults: Array) -> ReadTrial:
        """A `trial` with the torques that acted, with these unknown `faults` (nfault), in place of those commanded."""
        if not self.faults.names:
            return trial
        period = trial.timestep * trial.substeps
        return replace(trial, torques=self.faults.delivered(trial, period, faults))

    def _joints(self, faults: Array) -> Joints | None:
        """What the joints have with these unknown `faults` (nfault); None where none is searched."""
        return self.faults.joints(faults) if self.faults.names else None

    def _alone(self, log_factors: Array) -> Readings:
        """The same with the robot of these `log_factors` (nunknown), of which nothing is unknown any more."""
        return replace(self, unknowns=self.unknowns.alone(log_factors))

    def _compare_faulty(
        self, number: int, unknowns: Array, whitened: Array, values: Array, windows: int
    ) -> Array | None:
        """The derivatives (npush x nvalue x nfault) of the `values` of a trial by the faults that are searched, by
        differences. None where the twin cannot follow.
        """
        log_factors, faults = self._parted(unknowns)
        slopes, alone = np.zeros((*values.shape, len(faults))), self._alone(log_factors)
        acted = self._delivered(self.trials[number], faults)
        here = alone._shown_roughly(number, faults, whitened, windows, acted, values)
        for column, step in enumerate(STEP * np.eye(len(faults))):
            as_before = None if self.faults.is_of_torque[column] else acted
            shown = alone._shown(number, faults + step, whitened, windows, as_before, is_rough=True)
            if here is None or shown is None:
                return None
            slopes[..., column] = (shown - here) / STEP
        return slopes

    def _compare_driven(
        self, number: int, unknowns: Array, whitened: Array, values: Array, torques: Array
    ) -> Array | None:
        """The derivatives (npush x nvalue x ntorque) of the `values` of a trial on its longest windows by the sizes of
        further `torques` (ntorque x npush x nstep x njoint), by differences. None where the twin cannot follow.
        """
        log_factors, faults = self._parted(unknowns)
        largest, alone = np.abs(self.trials[number].torques).max(), self._alone(log_factors)
        slopes, acted = np.zeros((*values.shape, len(torques))), self._delivered(self.trials[number], faults)
        here = alone._shown_roughly(number, faults, whitened, self.stages, acted, values)
        for column, torque in enumerate(torques):
            size = DIFFERENCE * largest / max(float(np.abs(torque).max()), TINY)
            more = replace(acted, torques=acted.torques + size * torque)
            shown = alone._shown(number, faults, whitened, self.stages, more, is_rough=True)
            if here is None or shown is None:
                return None
            slopes[..., column] = (shown - here) / size
        return slopes

    def _compare_moved(
        self, number: int, unknowns: Array, whitened: Array, values: Array, moved: Sequence[Unknowns]
    ) -> Array | None:
        """What the `values` of a trial on its longest windows change by (npush x nvalue x nmoved) with each robot that
        is `moved`. None where its twin cannot follow.
        """
        faults, changes = self._parted(unknowns)[1], np.zeros((*values.shape, len(moved)))
        for column, robot in enumerate(moved):
            shown = replace(self, unknowns=robot)._shown(number, faults, whitened, self.stages)
            if shown is None:
                return None
            changes[..., column] = shown - values
        return changes


def _with_slopes(compared: Compared, count: int, further: Array) -> Compared:
    """What was `compared`, with `further` derivatives (npush x nvalue x nfurther) behind the first `count`."""
    values, slopes = compared
    return values, np.concatenate([slopes[..., :count], further, slopes[..., count:]], axis=-1)


def started(trial: ReadTrial, whitened: Array, is_moved: bool = True) -> Array:
    """Joint coordinates and speeds at the start of each push (npush x 2 x njoint): those it was to have and, where it
    `is_moved`, L u, u being `whitened` (npush x nextra).
    """
    poses = np.zeros_like(trial.start_speeds) if trial.poses is None else trial.poses
    starts = np.stack([poses, trial.start_speeds], axis=1)
    if trial.start_spread is None or not is_moved:
        return starts
    moved = np.einsum("pij,pj->pi", trial.start_spread, whitened)
    flat = starts.reshape(len(starts), -1)
    flat[:, flat.shape[1] - moved.shape[1] :] += moved
    return flat.reshape(starts.shape)
