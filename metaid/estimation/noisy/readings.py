"""What a fit compares on a noisy plant: the readings of each push, against a twin that is driven by what was commanded
and whose start speeds are unknown within what pushes differ by.

Compared are coefficients in polynomials, on windows that grow. What is unknown of each push alone is eliminated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache, partial
from typing import ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from metaid.compiled import Filtered, share_out
from metaid.estimation.descent import Residuals
from metaid.estimation.faults import NO_FAULTS, SearchedFaults
from metaid.estimation.noisy.polynomials import (
    POLYNOMIALS,
    STRIDE,
    Compared,
    PolynomialWindows,
    eliminated,
    explained_by_noise,
    in_polynomials,
    polynomial_windows,
    together,
)
from metaid.estimation.trials import NOTHING_FURTHER, Coefficients, Further, Joints, ReadTrial, Replay, started
from metaid.estimation.twin import Twin, twin_of
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array

DEGREE = 9  # of the polynomials that smooth the angles of a push
DRAWN = 100  # readings of a push that a replay keeps
SOME = 0.03  # of what the joints need: noise of torques that stands for what the model has not, to begin with

Seen = TypeVar("Seen")


class Posed(NamedTuple):
    """A `trial` of that `number` with the torques that acted, and the `twin` that is driven through it: with the joint
    coordinates and speeds of its `starts` (npush x 2 x njoint), and where the plant moves continuously the shares with
    which dry friction begins (npush x 3 x njoint); what `joints` have beside the parameters, None for nothing; and the
    unknowns that all of this is with, `faults` (nfault), and what each push has alone, `whitened` (npush x nextra).
    """

    number: int
    trial: ReadTrial
    starts: Array
    twin: Twin
    joints: Joints | None
    faults: Array
    whitened: Array

    def of(self, twin: Twin) -> Posed:
        """The same of a `twin` of which nothing is unknown, nor of the starts."""
        return self._replace(trial=replace(self.trial, start_spread=None), twin=twin)


@dataclass(frozen=True, eq=False)
class Readings:
    """All `trials` of a noisy study, in polynomials on windows that grow (Eq. 33). The unknowns of all pushes are those
    of the robot, and behind them the `faults` that are searched.
    """

    trials: Sequence[ReadTrial]
    unknowns: Unknowns
    faults: SearchedFaults = field(default=NO_FAULTS, kw_only=True)

    stride: ClassVar[int] = STRIDE  # windows grow to twice their length at once, where that leads nowhere by less

    def __post_init__(self) -> None:
        if not any(windows.are_reached(trial.steps).any() for trial, windows in self._each):
            raise ValueError("no push of any trial was seen to the end of its shortest window: nothing to compare")

    @property
    def spreads(self) -> Array:
        own = np.full(len(self.unknowns.names), self.unknowns.spread)
        return np.append(own, np.ones(len(self.faults.names)))

    @property
    def stages(self) -> int:
        return max(len(windows.ends) for windows in self._windows)

    @property
    def rough_stages(self) -> int:
        """All but the last."""
        return self.stages - 1

    @property
    def least_gain(self) -> float:
        return self.unknowns.least_gain

    @property
    def explained_below(self) -> float:
        """A misfit below this is explained by noise."""
        pushes = sum(int(np.count_nonzero(windows.are_reached(trial.steps))) for trial, windows in self._each)
        return explained_by_noise(pushes * POLYNOMIALS * self.trials[0].torques.shape[2])

    @property
    def extras(self) -> int:
        """How many unknowns concern one push alone: start speeds, and coordinates."""
        return sum(trial.extras for trial in self.trials)

    @property
    def some_torque(self) -> Array:
        """What the noise of each joint's torque (njoint) may be that stands for what the model has not, in N m."""
        fastest = float(np.abs(self.trials[0].start_speeds).max())
        return SOME * np.asarray(self.unknowns.torques(fastest))

    @property
    def _each(self) -> Iterator[tuple[ReadTrial, PolynomialWindows]]:
        """Each trial with its windows."""
        return zip(self.trials, self._windows, strict=True)

    @cached_property
    def _windows(self) -> list[PolynomialWindows]:
        """Those of each trial."""
        return [polynomial_windows(trial.torques.shape[1]) for trial in self.trials]

    def residuals(self, point: Array, windows: int) -> Residuals | None:
        """Those of the longest of the first `windows` windows, what a push alone has eliminated push by push."""
        return self._eliminated(point, windows, self._compare)

    def residuals_alone(self, point: Array) -> Residuals | None:
        """Those on all windows where nothing is unknown but what a push alone has."""
        count = len(self.unknowns.names)
        alone = replace(self, unknowns=self.unknowns.alone(point[:count]))
        return alone._eliminated(point[count:], self.stages, partial(alone._compare, by_faults=False))

    def residuals_with(
        self, point: Array, torques: Sequence[Array], moved: Sequence[Unknowns] = ()
    ) -> Residuals | None:
        """Those on all windows with further joint `torques` of each trial (ntorque x npush x nstep x njoint), in N m,
        whose sizes are unknowns, too, behind the others. Behind those is how far the robot is on the way to each of the
        `moved` ones, of which nothing is unknown.
        """

        def _compared(posed: Posed, windows: int) -> Compared | None:
            own = torques[posed.number]
            compared = self._compare(posed, windows, own)
            beside = None if compared is None else self._compare_moved(posed, compared[0], moved)
            if compared is None or beside is None:
                return None
            values, slopes = compared
            count = len(self.spreads) + len(own)
            return values, np.concatenate([slopes[..., :count], beside, slopes[..., count:]], axis=-1)

        return self._eliminated(point, self.stages, _compared)

    def least_cost(self, point: Array, windows: int) -> float:
        """All of it, by the twin without derivatives."""

        def cost(number: int) -> float | None:
            posed = self._posed_at(number, point)
            values = self._shown(posed.of(posed.twin.alone), windows)
            return None if values is None else 0.5 * float((values**2).sum() + (posed.whitened**2).sum())

        costs = self._of_each(cost)
        return np.inf if costs is None else sum(costs)

    def by_joint(self, point: Array) -> tuple[Array, ...]:
        """Root mean square of the residuals of each trial (npush x njoint) on the longest window seen, scaled by the
        noise; NaN where a push was not seen.
        """
        tables = []
        for number, (trial, windows) in enumerate(self._each):
            posed = self._posed_at(number, point)
            values = self._shown(posed.of(posed.twin.alone), self.stages)
            table = np.full(trial.torques.shape[::2], np.nan)
            if values is not None:
                seen = windows.are_reached(trial.steps)
                table[seen] = np.sqrt((values.reshape(*table.shape, -1)[seen] ** 2).mean(axis=-1))
            tables.append(table)
        return tuple(tables)

    def motion(self, number: int) -> tuple[Array, Array]:
        """Angles, in rad, and speeds, in rad/s, of the joints at each step of a trial (npush x nstep x njoint), as far
        as a polynomial of each push has them; zeros after a fall.
        """
        trial = self.trials[number]
        angles, speeds = np.zeros_like(trial.torques), np.zeros_like(trial.torques)
        for push, steps in enumerate(trial.steps.tolist()):
            if steps < 2:
                continue
            times, horizon = np.linspace(-1.0, 1.0, steps + 1), steps * trial.timestep * trial.substeps
            fitted = legendre.legfit(times, trial.readings[push, : steps + 1], min(DEGREE, steps // 2))
            angles[push, :steps] = legendre.legval(times[:-1], fitted).T
            speeds[push, :steps] = legendre.legval(times[:-1], legendre.legder(fitted)).T * (2.0 / horizon)
        return angles, speeds

    def replay(self, number: int, point: Array) -> Replay:
        """The trial of that `number`, some of its readings left out, and the twin at a `point` in its place."""
        trial, posed = self.trials[number], self._posed_at(number, point)
        (npush, nreading, _), last = trial.readings.shape, self._windows[number].ends[-1]
        kept = np.unique(np.linspace(0, last, min(last, DRAWN) + 1).round().astype(int))
        basis = np.zeros((nreading, len(kept)))
        basis[kept, np.arange(len(kept))] = 1.0  # each coefficient is the angle at one reading
        steps, bare = np.minimum(trial.steps, last), posed.of(posed.twin.alone)
        motion = bare.twin.drive(bare.trial, bare.starts, steps, np.tile(basis, (npush, 1, 1)), bare.joints)
        shown = (kept <= steps[:, None]) & (steps[:, None] > 0)
        seen = np.where(shown[..., None], trial.readings[:, kept], np.nan)
        simulated = np.full_like(seen, np.nan)
        if motion is not None:
            simulated[shown] = motion.values.swapaxes(1, 2)[shown]
        return Replay(trial.period * kept, seen, simulated, trial.noise, self.unknowns.joints)

    def _compare(
        self, posed: Posed, windows: int, torques: Array | None = None, by_faults: bool = True
    ) -> Compared | None:
        """A trial on the longest of the first `windows` windows of each push; None where the twin
        cannot follow.

        Args:
            posed: the trial; derivatives by what each push has alone are the last.
            windows: of which the longest is compared.
            torques: further ones (ntorque x npush x nstep x njoint), whose sizes are unknown, too: derivatives by them
                are behind those by the unknowns.
            by_faults: whether there are derivatives by the faults among the unknowns.
        """
        further, columns = NOTHING_FURTHER, np.empty(0, dtype=np.intp)
        if by_faults:
            further, columns = self._further(posed, torques)
        left = self._left(posed, windows, further)
        if left is None:
            return None
        npush, count, spread = len(posed.starts), len(self.unknowns.names), posed.trial.start_spread
        slopes = left.slopes.reshape(npush, left.values[0].size, -1)
        if spread is not None:
            slopes[..., count + further.size :] = slopes[..., count + further.size :] @ spread
        slopes[..., count : count + further.size] = slopes[..., count + columns]
        return left.values.reshape(npush, -1), slopes

    def _further(self, posed: Posed, torques: Array | None) -> tuple[Further, NDArray[np.intp]]:
        """What the faults and the sizes of further `torques` change in a trial as it is `posed`, and where of each in
        turn it stands.
        """
        further = self.faults.further(self.trials[posed.number], posed.faults, posed.trial.torques)
        is_of_torque = self.faults.is_of_torque
        first, last = np.flatnonzero(is_of_torque), np.flatnonzero(~is_of_torque)
        if torques is not None:
            further = further._replace(torques=np.concatenate([further.torques, np.moveaxis(torques, 0, -1)], axis=-1))
            first = np.append(first, len(is_of_torque) + np.arange(len(torques)))
        return further, np.argsort(np.concatenate([first, last]))

    def _shown(self, bare: Posed, windows: int) -> Array | None:
        """What a robot of which nothing is unknown shows in a trial on the longest of the first `windows` windows
        (npush x nvalue); None where its twin cannot follow.
        """
        left = self._left(bare, windows)
        return None if left is None else left.values.reshape(len(bare.starts), -1)

    def _left(self, posed: Posed, windows: int, further: Further = NOTHING_FURTHER) -> Coefficients | None:
        """What a twin shows less what was read, on the longest of the first `windows` windows, scaled by the noise, and
        its derivatives, also by what is `further` unknown; where it is led by what was read, its whitened innovations.
        None where it cannot follow.
        """
        number = posed.number
        chosen, steps = self._longest(number, windows)
        basis, led = [self._windows[number].basis[window] for window in chosen], self._gains(number)
        driven = posed.twin.drive(posed.trial, posed.starts, steps, basis, posed.joints, further, led)
        if driven is None or led is not None:
            return driven
        unit = 1.0 / posed.trial.noise[None, :, None]
        return Coefficients(unit * (driven.values - self._read(number, windows)), unit[..., None] * driven.slopes)

    @cached_property
    def _read(self) -> Callable[[int, int], Array]:
        """What was read of a trial, by its number, on the longest of so many windows, in their polynomials."""

        def coefficients(number: int, windows: int) -> Array:
            chosen, steps = self._longest(number, windows)
            return in_polynomials(self.trials[number].readings, steps, self._windows[number].basis[chosen])

        return cache(coefficients)

    def _longest(self, number: int, windows: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Which of the first `windows` windows is the longest that was seen of each push of a trial (npush), -1 where
        none was, and its steps (npush).
        """
        steps, ends = self.trials[number].steps, self._windows[number].ends
        chosen = np.minimum((ends[None] <= steps[:, None]).sum(axis=1), windows) - 1
        return chosen, np.where(chosen >= 0, ends[chosen], 0)

    def _gains(self, number: int) -> Filtered | None:
        """Of the filter that leads the twin through a trial; None where nothing does."""
        return None

    @cached_property
    def _last_twin(self) -> Callable[[bytes], Twin]:
        """The robot by its log factors (nunknown); what follows from these alone is worked out once."""
        return lru_cache(maxsize=1)(lambda log_factors: twin_of(self.unknowns, np.frombuffer(log_factors).copy()))

    def _posed_at(self, number: int, point: Array, trial: ReadTrial | None = None, is_moved: bool = True) -> Posed:
        """A trial at a `point`, or some pushes of it alone, another `trial`; see `started` for how pushes begin."""
        whole, count, joints = self.trials[number], len(self.unknowns.names), None
        first = len(self.spreads) + sum(each.extras for each in self.trials[:number])
        whitened = point[first : first + whole.extras].reshape(len(whole.steps), -1)
        trial = whole if trial is None else trial
        faults, starts = point[count : len(self.spreads)], started(trial, whitened, is_moved)
        if self.faults.names:
            trial = replace(trial, torques=self.faults.delivered(trial, faults))
            joints = self.faults.joints(faults)
        return Posed(number, trial, starts, self._last_twin(point[:count].tobytes()), joints, faults, whitened)

    def _compare_moved(self, posed: Posed, values: Array, moved: Sequence[Unknowns]) -> Array | None:
        """What the `values` of a trial on its longest windows change by (npush x nvalue x nmoved) with each robot that
        is `moved`. None where its twin cannot follow.
        """
        changes = np.zeros((*values.shape, len(moved)))
        for column, robot in enumerate(moved):
            shown = self._shown(posed.of(twin_of(robot, np.empty(0))), self.stages)
            if shown is None:
                return None
            changes[..., column] = shown - values
        return changes

    def _eliminated(
        self, point: Array, windows: int, compare: Callable[[Posed, int], Compared | None]
    ) -> Residuals | None:
        """The residuals of all trials by what `compare` finds of each."""

        def of_one(number: int) -> Residuals | None:
            posed = self._posed_at(number, point)
            compared = compare(posed, windows)
            if compared is None:
                return None
            reached = self._windows[number].are_reached(self.trials[number].steps)
            return eliminated(compared, posed.whitened, int(np.count_nonzero(reached)))

        parts = self._of_each(of_one)
        return None if parts is None else together(parts)

    def _of_each(self, look: Callable[[int], Seen | None]) -> list[Seen] | None:
        """What `look` finds of each trial, by its number, on several threads; None where it finds nothing of one."""
        found: list[Seen | None] = [None] * len(self.trials)

        def run(numbers: Iterator[int]) -> None:
            for number in numbers:
                found[number] = look(number)

        share_out(run, len(found), sum(trial.torques.size for trial in self.trials) * len(self.spreads))
        every = [each for each in found if each is not None]
        return every if len(every) == len(found) else None
