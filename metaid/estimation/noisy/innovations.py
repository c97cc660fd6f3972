"""What a fit compares where torques are noisy: the innovations of a filter that leads the twin by the readings."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import Filtered
from metaid.estimation.estimate import Found
from metaid.estimation.noisy.readings import Readings
from metaid.estimation.twin import Filter
from metaid.models import Array

NOTHING = 1e-2  # of cost: a seventh of a standard deviation, beside noise whose size is found, too


@dataclass(frozen=True, eq=False)
class Innovations(Readings):
    """The innovations of all `trials`, whitened, in the polynomials of Eq. 33, by a filter with given `gains` of each.
    A step of a fit that promises less than `least_gain` of cost is not made.

    A twin that is led by its readings does not lose the plant, so windows need not grow: the longest is the first.
    """

    gains: tuple[Filtered, ...] = field(default=(), kw_only=True)
    least_gain: float = field(default=NOTHING, kw_only=True)

    @property
    def stages(self) -> int:
        return 1

    def _longest(self, number: int, windows: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return super()._longest(number, super().stages)

    def _gains(self, number: int) -> Filtered | None:
        return self.gains[number]

    def motion(self, number: int) -> tuple[Array, Array]:
        """As the filter has it: what noise of a torque does is seen in later readings alone. Were it in the speed of
        its own step already, as it is in speeds that later readings smooth, it would look like friction.
        """
        states, (npush, readings, n) = self.gains[number].states, self.trials[number].readings.shape
        joints = states.reshape(npush, readings, 2, n)[:, :-1]
        going = (np.arange(readings - 1) < self.trials[number].steps[:, None])[..., None]
        return joints[:, :, 0] * going, joints[:, :, 1] * going

    def led(self, point: Array, torque_noise: Array) -> Innovations | None:
        """The same with the gains at a `point`, where torques of the joints have noise of these standard deviations
        (njoint), in N m; None where the twin cannot follow from there.
        """
        gains = tuple(each.gains(torque_noise) for each in self.filters(point))
        return replace(self, gains=gains) if all(np.isfinite(each.likelihood) for each in gains) else None

    def likelihood(self, point: Array, torque_noise: Array, pushes: int) -> float:
        """The logarithm of the likelihood of the readings of about so many `pushes`, but for a constant, at a `point`,
        where torques of the joints have noise of these standard deviations (njoint), in N m.  Eq. 37.
        """
        return sum(each.gains(torque_noise).likelihood for each in self.filters(point, pushes))

    def filters(self, point: Array, most: int | None = None) -> list[Filter]:
        """The filter of each trial at a `point`. Where it is said of about how many pushes at `most` of all trials, it
        is for their likelihood: then their start speeds are not those of the point, to which the noise of the torques
        has already led, but any.
        """
        each = None if most is None else -(-most // len(self.trials))
        return [self._filter(number, point, each) for number in range(len(self.trials))]

    def _filter(self, number: int, point: Array, most: int | None) -> Filter:
        """That of a trial."""
        trial, n = self.trials[number], len(self.trials[number].noise)
        pushes = np.flatnonzero(trial.steps > 0)
        if most is not None:
            trial = trial.only(pushes[:: -(-len(pushes) // most) or 1])
            pushes = np.arange(len(trial.steps))
        posed, begins = self._posed_at(number, point, trial, most is None), np.zeros((len(trial.steps), 2 * n, 2 * n))
        if most is not None and trial.start_spread is not None:
            own = posed.starts.shape[1] * n - trial.start_spread.shape[-1]
            moved = trial.start_spread[:, : 2 * n - own]  # without what friction begins with
            begins[:, own:, own:] = moved @ moved.swapaxes(1, 2)
        return posed.twin.lead(posed.trial, posed.starts, begins, pushes, posed.joints)


def led_by(readings: Readings) -> Innovations:
    """The same, of which a filter leads the twin."""
    own = {each.name: getattr(readings, each.name) for each in fields(Readings)}
    return Innovations(**own)


def compared_at(readings: Readings, estimate: Found) -> Readings | None:
    """What of the `readings` is compared with the twin at an `estimate`, which a filter leads where torques are noisy
    there; None where it cannot follow.
    """
    if estimate.torque_noise is None:
        return readings
    return led_by(readings).led(estimate.point, estimate.torque_noise)
