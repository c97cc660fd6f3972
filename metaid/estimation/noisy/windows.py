"""What a fit compares of readings of noisy sensors, whatever moved them: coefficients in polynomials, on windows that
grow. What is unknown of each push alone is eliminated.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import share_out
from metaid.estimation.descent import Residuals
from metaid.estimation.noisy.polynomials import (
    POLYNOMIALS,
    SHORTEST,
    STRIDE,
    eliminate,
    explained_by_noise,
    polynomial_windows,
)
from metaid.estimation.trials import ReadTrial
from metaid.estimation.unknowns import Unknowns
from metaid.models import Array

Seen = TypeVar("Seen")
# Residuals of a trial (npush x nvalue), scaled by the noise, joint by joint, and their derivatives (npush x nvalue x
# nunknown + nextra), those by what a push alone has last; zeros where a push was not seen.
Compared = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class ReadingsInWindows(ABC):
    """All `trials` of a noisy study, in `polynomials` (Eq. 33). Windows grow from `shortest` of the horizon on."""

    trials: Sequence[ReadTrial]
    unknowns: Unknowns
    polynomials: int = field(default=POLYNOMIALS, kw_only=True)
    shortest: float = field(default=SHORTEST, kw_only=True)

    def __post_init__(self) -> None:
        if not any((trial.steps >= ends[0]).any() for trial, (ends, _) in self._each):
            raise ValueError("no push of any trial was seen to the end of its shortest window: nothing to compare")

    @abstractmethod
    def _compare(self, number: int, unknowns: Array, whitened: Array, windows: int) -> Compared | None:
        """The trial of that `number` on the longest of the first `windows` windows of each push; None where the twin
        cannot follow. `whitened` (npush x nextra) is what a push alone has, scaled by its spread.
        """

    @abstractmethod
    def _compare_alone(self, number: int, unknowns: Array, whitened: Array, windows: int) -> Compared | None:
        """The same, with no derivatives but those by what a push alone has."""

    @property
    def spreads(self) -> Array:
        """Of the unknowns (nunknown), beforehand."""
        return np.full(len(self.unknowns.names), self.unknowns.spread)

    @property
    def stages(self) -> int:
        """How many windows there are."""
        return max(len(ends) for ends, _ in self._windows)

    @property
    def rough_stages(self) -> int:
        """All but the last."""
        return self.stages - 1

    @property
    def stride(self) -> int:
        """Windows grow to twice their length at once, where that leads nowhere by less."""
        return STRIDE

    @property
    def ends_when_cut(self) -> bool:
        """Whether a descent ends with a short step though it was cut, for longer windows may lead on."""
        return self.unknowns.ends_when_cut

    @property
    def least_gain(self) -> float:
        """Of cost; a step that promises less is not made."""
        return self.unknowns.least_gain

    @property
    def explained_below(self) -> float:
        """A misfit below this is explained by noise."""
        pushes = sum(int(np.count_nonzero(trial.steps >= ends[0])) for trial, (ends, _) in self._each)
        return explained_by_noise(pushes * self.polynomials * self.trials[0].torques.shape[2])

    @property
    def extras(self) -> int:
        """How many unknowns concern one push alone: start speeds, and coordinates."""
        return sum(trial.extras for trial in self.trials)

    @property
    def _each(self) -> Iterator[tuple[ReadTrial, tuple[NDArray[np.int64], Array]]]:
        """Each trial with its windows."""
        return zip(self.trials, self._windows, strict=True)

    @cached_property
    def _windows(self) -> list[tuple[NDArray[np.int64], Array]]:
        """Of each trial the ends of its windows, and the polynomials on each (nwindow x nstep + 1 x ncoefficient)."""
        return [polynomial_windows(trial.torques.shape[1], self.polynomials, self.shortest) for trial in self.trials]

    def _longest(self, number: int, windows: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Which of the first `windows` windows is the longest that was seen of each push of a trial (npush), -1 where
        none was, and its steps (npush).
        """
        steps, (ends, _) = self.trials[number].steps, self._windows[number]
        chosen = np.minimum((ends[None] <= steps[:, None]).sum(axis=1), windows) - 1
        return chosen, np.where(chosen >= 0, ends[chosen], 0)

    def residuals(self, point: Array, windows: int) -> Residuals | None:
        """Those of the longest of the first `windows` windows, what a push alone has eliminated push by push."""
        return self._eliminated(point, windows, self._compare, len(self.spreads))

    def residuals_alone(self, point: Array) -> Residuals | None:
        """Those on all windows where nothing is unknown but what a push alone has."""
        return self._eliminated(point, self.stages, self._compare_alone, 0)

    def by_joint(self, point: Array) -> tuple[Array, ...]:
        """Root mean square of the residuals of each trial (npush x njoint) on the longest window seen, scaled by the
        noise; NaN where a push was not seen.
        """
        tables = []
        for number, (trial, (ends, _)) in enumerate(self._each):
            compared = self._compare_alone(number, *self._of_trial(number, point), self.stages)
            table = np.full(trial.torques.shape[::2], np.nan)
            if compared is not None:
                seen = trial.steps >= ends[0]
                table[seen] = np.sqrt((compared[0].reshape(*table.shape, -1)[seen] ** 2).mean(axis=-1))
            tables.append(table)
        return tuple(tables)

    def _of_trial(self, number: int, point: Array) -> tuple[Array, Array]:
        """The unknowns (nunknown) at a `point`, and what each push of a trial has alone (npush x nextra)."""
        count, trial = len(self.spreads), self.trials[number]
        first = count + sum(each.extras for each in self.trials[:number])
        return point[:count], point[first : first + trial.extras].reshape(len(trial.steps), -1)

    def _eliminated(
        self, point: Array, windows: int, compare: Callable[[int, Array, Array, int], Compared | None], count: int
    ) -> Residuals | None:
        """The residuals of all trials by what `compare` finds of each, of which the first `count` unknowns are those of
        all pushes.
        """

        def of_one(number: int) -> Residuals | None:
            unknowns, whitened = self._of_trial(number, point)
            compared = compare(number, unknowns, whitened, windows)
            if compared is None:
                return None
            values, slopes = compared
            cost = 0.5 * float((values**2).sum() + (whitened**2).sum())
            seen = int(np.count_nonzero(self.trials[number].steps >= self._windows[number][0][0])) * values.shape[1]
            left, by_unknowns, following = eliminate(values, slopes, whitened, count)
            return Residuals(left, by_unknowns, cost, seen, following)

        parts = self._of_each(of_one)
        if parts is None:
            return None
        return Residuals(
            np.concatenate([part.values for part in parts]),
            np.concatenate([part.slopes for part in parts]),
            sum(part.cost for part in parts),
            sum(part.count for part in parts),
            np.concatenate([part.following for part in parts]),
        )

    def _of_each(self, look: Callable[[int], Seen | None]) -> list[Seen] | None:
        """What `look` finds of each trial, by its number, on several threads; None where it finds nothing of one."""
        found: list[Seen | None] = [None] * len(self.trials)

        def run(numbers: Iterator[int]) -> None:
            for number in numbers:
                found[number] = look(number)

        share_out(run, len(found), sum(trial.torques.size for trial in self.trials) * len(self.spreads))
        every = [each for each in found if each is not None]
        return every if len(every) == len(found) else None
