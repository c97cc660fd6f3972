"""A study's experiment as the estimate needs it: how the plant is pushed, what is unknown of it, what is compared."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from metaid.episode import Outcome
from metaid.estimation.approximation import HeldOut
from metaid.estimation.counting import Counts, match_counts
from metaid.estimation.estimate import Comparison, Found, fit
from metaid.estimation.faults import NO_FAULTS, Proposal, SearchedFaults, TakenUp, Unmodelled
from metaid.estimation.noisy import (
    Innovations,
    Loop,
    Readings,
    fit_with_torque_noise,
    hold_out,
    led,
    led_by,
    proposed_faults,
    take_up,
    unmodelled_forces,
)
from metaid.estimation.trials import Replay
from metaid.models import Array

RESTARTS = 3  # of a fit that explains nothing, from elsewhere
SOME = 0.03  # of what the joints need: noise of torques that stands for what the model has not, to begin with


class Experiment(ABC):
    """What is the same in all trials of a study, of a chain or of an arm."""

    @abstractmethod
    def trial(self, factors: Array, outcome: Outcome) -> Any:
        """A trial whose law had these `factors`, and what was seen of it; None where nothing of it is known."""

    leads_on: ClassVar[bool] = False
    """Whether all trials lead on in a step or two from where the first of them led."""

    scale: ClassVar[float] = 1.0
    """What the unknowns are multiples of."""

    @property
    def counts(self) -> bool:
        """Whether half periods are counted, and no motion compared."""
        return False

    @property
    @abstractmethod
    def probes(self) -> int:
        """How many trials that over-compensate an estimate needs."""

    @abstractmethod
    def probe(self, start: Array, random: np.random.Generator | None) -> Array:
        """Factors of a law that shows much, from those of the `start`: the first time the same, then at `random`."""

    @abstractmethod
    def factors(self, estimate: Any) -> Array:
        """The factors of the law that an `estimate` has."""

    def is_to_probe(self, trials: int, is_settled: bool) -> bool:
        """Whether the law after so many `trials` is another than that of the estimate: where intervals have stopped
        shrinking, for one that coasts shows no more.
        """
        return is_settled

    @abstractmethod
    def is_coasting(self, value: float) -> bool:
        """Whether a trial with this `value` of the measure coasts."""

    @abstractmethod
    def is_settled(self, before: Any, after: Any) -> bool:
        """Whether intervals have stopped shrinking from the estimate `before` the last trial to the one `after` it."""

    @abstractmethod
    def _comparison(self, trials: Sequence[Any]) -> Any:
        """What is compared with the twin.  Raises ValueError where `trials` show nothing."""

    def estimate(self, trials: Sequence[Any], start: Found | None = None, thorough: bool = True) -> Any:
        """What all `trials` say; None where they showed nothing, or no chain shows what they did.

        A `start` that explained the trials before is where the fit begins. Where that explains nothing, a
        `thorough` fit begins elsewhere RESTARTS times.
        """
        begin = start.start if start is not None and start.is_explained else None
        try:
            compared = self._comparison(trials)
            return self._fit(compared, begin, RESTARTS if thorough else 0)
        except ValueError:
            return None

    def _fit(self, compared: Comparison | Counts, begin: Array | None, restarts: int) -> Found:
        """What is compared says of the robot.  Raises ValueError where no robot shows what was seen."""
        if isinstance(compared, Counts):
            return match_counts(compared, begin, restarts)
        found: Found = fit(compared, begin, restarts)
        return found

    def unmodelled(self, trials: Sequence[Any], estimate: Found) -> list[Unmodelled]:
        """Forces that the model has not, as far as the `trials` show them beside an `estimate` of them. Without noise
        there are none: the misfit says all.
        """
        return []

    def taken_up(self, trials: Sequence[Any], estimate: Found) -> tuple[Any, TakenUp | None]:
        """What the `trials` say with the faults that explain them, where an experiment takes up faults by itself, and
        what speaks for these; else the `estimate`.
        """
        return estimate, None

    def searching(self, estimate: Found) -> Any:
        """The same where the faults that an `estimate` has taken up are searched from the first trial on."""
        return self

    def proposed(self, trials: Sequence[Any], estimate: Found) -> Proposal | None:
        """Faults that would explain what an `estimate` of the `trials` does not, if they were searched, too. None where
        none does, or no readings were kept to try it.
        """
        return None

    def held_out(self, trials: Sequence[Any], estimate: Found) -> HeldOut | None:
        """How well fits to some of the pushes of the `trials` predict the others, from an `estimate` on. None without
        noise, where a model that leaves more than rounding is wrong, and where there are too few pushes.
        """
        return None

    def replay(self, trials: Sequence[Any], estimate: Found, number: int) -> Replay:
        """What was seen of one of the `trials` that an `estimate` is made of, and what the twin at the estimate shows
        in its place; `number` is that of its table in `estimate.residuals`.
        """
        replay: Replay = self._comparison(trials).replay(number, estimate.point)
        return replay


class OfReadings(Experiment):
    """One with noise, whose trials are the readings of sensors.

    Attributes:
        faults: that are searched beside what is unknown of the robot.
        takes_up: whether faults are searched, too, once nothing explains the trials without them.
        torque_noise: what the noise of each joint's torque (njoint) is said to be, in N m; None where torques have
            none. How large it is, is found.
        loop: how the plant is controlled and read; None where sensors are exact.
    """

    faults: SearchedFaults
    takes_up: bool
    torque_noise: Array | None
    loop: Loop | None

    @abstractmethod
    def _search(self, kinds: tuple[str, ...]) -> SearchedFaults:
        """Faults of these `kinds` as unknowns."""

    @property
    @abstractmethod
    def _some_torque(self) -> Array:
        """What the noise of each joint's torque (njoint) may be that stands for what the model has not, in N m."""

    def _fit(self, compared: Comparison | Counts, begin: Array | None, restarts: int) -> Found:
        if self.torque_noise is None or not isinstance(compared, Innovations):
            return super()._fit(compared, begin, restarts)
        return fit_with_torque_noise(compared, begin, self.torque_noise)

    def unmodelled(self, trials: Sequence[Any], estimate: Found) -> list[Unmodelled]:
        tried = estimate.led_misfit is not None and (self.takes_up or estimate.faults is not None)
        compared = None if tried else self._led(trials, estimate)
        return [] if compared is None else list(unmodelled_forces(compared, estimate))

    def estimate(self, trials: Sequence[Any], start: Found | None = None, thorough: bool = True) -> Any:
        if start is not None and start.faults is not None and self.takes_up:
            found = self._searching(start.faults.searched).estimate(trials, start, thorough)
            if found is None or found.is_explained:
                return found
        else:
            found = super().estimate(trials, start, thorough=False)
        if found is None or found.is_explained or self.torque_noise is not None:
            return found
        compared = self._comparison(trials)
        if not isinstance(compared, Readings):
            return found
        if start is None and self.takes_up:
            return take_up(compared, found, self._search, self._some_torque)[0]
        faulty = replace(compared, faults=NO_FAULTS if found.faults is None else found.faults.searched)
        begin = found if found.torque_noise is not None else replace(found, torque_noise=self._some_torque)
        return led(faulty, begin) or found

    def taken_up(self, trials: Sequence[Any], estimate: Found) -> tuple[Any, TakenUp | None]:
        compared = self._comparison(trials) if self.takes_up else None
        if not isinstance(compared, Readings) or (estimate.is_explained and estimate.faults is None):
            return estimate, None
        return take_up(compared, estimate, self._search, self._some_torque)

    def searching(self, estimate: Found) -> Any:
        return self._searching(estimate.faults.searched) if self.takes_up and estimate.faults is not None else self

    def proposed(self, trials: Sequence[Any], estimate: Found) -> Proposal | None:
        if self.takes_up or self.torque_noise is not None or self.loop is None:
            return None  # none of them explains the trials; or gains of a filter that are those without it
        compared = self._comparison(trials)
        if not isinstance(compared, Readings):
            return None  # without noise the misfit says all
        return proposed_faults(compared, estimate, self._search, self._some_torque, self.loop.declared_delay)

    def held_out(self, trials: Sequence[Any], estimate: Found) -> HeldOut | None:
        fitted, compared = self._led(trials, estimate), self._comparison(trials)
        if fitted is None:
            return None
        return hold_out(fitted, estimate.point, compared if estimate.led_misfit is not None else None)

    def step_error(self, factors: Array, outcome: Outcome) -> Array | None:
        """How far (njoint), in rad or m, the nominal twin of a trial moves elsewhere with steps of half the size; None
        where it cannot follow the trial, which had these `factors` and this `outcome`.
        """
        shown = []
        for parts in (1, 2):
            assert self.loop is not None, "there are readings"
            finer = replace(self.loop, timestep=self.loop.timestep / parts, substeps=self.loop.substeps * parts)
            experiment = replace(self, loop=finer)  # type: ignore[type-var]
            compared = experiment._comparison([experiment.trial(factors, outcome)])
            nominal = np.zeros(len(compared.spreads) + compared.extras)
            shown.append(compared.replay(0, nominal).simulated)
        moved = np.abs(shown[1] - shown[0])
        return None if np.isnan(moved).all() else np.asarray(np.nanmax(moved, axis=(0, 1)))

    def _searching(self, faults: SearchedFaults) -> Any:
        """The same where these `faults` are searched from the first trial on."""
        return replace(self, faults=faults, takes_up=False)  # type: ignore[type-var]

    def _led(self, trials: Sequence[Any], estimate: Found) -> Readings | None:
        """What is compared at an `estimate`; None where the twin cannot follow, and without noise."""
        compared = self._comparison(trials)
        if not isinstance(compared, Readings):
            return None
        if estimate.torque_noise is None:
            return compared
        innovations = compared if isinstance(compared, Innovations) else led_by(compared)
        return innovations.led(estimate.point, estimate.torque_noise)
