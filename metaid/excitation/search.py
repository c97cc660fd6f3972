"""The search for a motion: the best of many random series, and what improves it.

A series is scaled until it keeps the limits of coordinates, speeds and accelerations; one that needs more torque than
the motors have, or meets anything, is made smaller or given up. The criterion is the determinant of the information
that a log of it has of base parameters and friction.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from metaid.errors import PlantError
from metaid.excitation.limits import Limits
from metaid.excitation.series import Series, rest_to_rest
from metaid.models import Array
from metaid.recorded import LinearModel

if TYPE_CHECKING:
    from metaid.excitation.contacts import Contacts  # loads MuJoCo

HARMONICS = 12
SAMPLES = 160  # of a period, for the criterion
LOOKS = 400  # of a period, for contacts and limits while it is searched
FINAL = 0.001  # s between two looks at the end
WITHIN = 0.99  # of each limit: between two looks a motion goes a little farther
SMALLER, TIMES = 0.75, 5  # where torques are too large
DRAWN = 500
IMPROVED = 1500  # tries
GROWS, SHRINKS = 1.5, 0.92  # of the step after a success and a failure: it keeps about one success in five
FIRST, LAST = 0.5, 1e-3  # of the step


@dataclass(frozen=True)
class Shape:
    """What a series is scaled from: coefficients (njoint x nharmonic each) of any size, and where in the range that it
    leaves it moves, from 0 to 1 (njoint).
    """

    sines: Array
    cosines: Array
    place: Array


@dataclass(frozen=True)
class Criterion:
    """How much a log says: the logarithm of the determinant of its information on the unknowns, each scaled by its
    prior deviation.

    Attributes:
        model: what is unknown.
        scales: the prior standard deviations of the unknowns (nparam).
        noise: of the torques (njoint), in N m or N.
        readings: how many independent ones a log has.
        before: information that there is already (nparam x nparam).
    """

    model: LinearModel
    scales: Array
    noise: Array
    readings: float
    before: Array | float = 0.0

    def information(self, series: Series, rows: Array | None = None) -> Array:
        """On the scaled unknowns (nparam x nparam), the prior included; `rows` is the regressor along the series
        where it is there already.
        """
        rows = self.model.regressor(*series.over(SAMPLES)) if rows is None else rows
        flat = (rows * self.scales / self.noise[:, None]).reshape(-1, len(self.scales))
        return np.asarray(self.readings / SAMPLES * flat.T @ flat + np.eye(len(self.scales)), dtype=np.float64)

    def value(self, series: Series, rows: Array | None = None) -> float:
        """Of a series, beside what there is before; `rows` as above."""
        return float(np.linalg.slogdet(self.information(series, rows) + self.before)[1])


@dataclass(frozen=True)
class MotionSearch:
    """What is searched.

    Attributes:
        model: what is unknown.
        nominal: the unknowns beforehand (nparam), friction included.
        limits: of the motion.
        period: of the series, in s.
        contacts: what the robot meets; None where its shapes are not known.
        refused: why series were given up, and how often.
    """

    model: LinearModel
    nominal: Array
    limits: Limits
    period: float
    contacts: Contacts | None
    refused: Counter[str] = field(default_factory=Counter, repr=False, compare=False)

    def torques(self, angles: Array, speeds: Array, accelerations: Array) -> Array:
        """What the nominal robot needs along a motion (nstep x njoint each), in N m or N."""
        return np.asarray(self.model.regressor(angles, speeds, accelerations) @ self.nominal, dtype=np.float64)

    def scaled(self, shape: Shape) -> Series:
        """The largest series of such a shape within coordinates, speeds and accelerations."""
        limits = self.limits
        free = Series(np.zeros(len(shape.place)), shape.sines, shape.cosines, self.period)
        sines, cosines = rest_to_rest(shape.sines, shape.cosines, free.rates)
        free = replace(free, sines=sines, cosines=cosines)
        motion = free.over(LOOKS)
        lowest, highest = motion.angles.min(axis=0), motion.angles.max(axis=0)
        shares = np.stack(
            [
                (highest - lowest) / (limits.high - limits.low),
                np.abs(motion.speeds).max(axis=0) / limits.speed,
                np.abs(motion.accelerations).max(axis=0) / limits.acceleration,
            ]
        )
        by = WITHIN / np.maximum(shares.max(axis=0), 1e-12)
        room = limits.high - limits.low - by * (highest - lowest)
        start = limits.low - by * lowest + np.clip(shape.place, 0.01, 0.99) * room
        return Series(start, by[:, None] * free.sines, by[:, None] * free.cosines, self.period)

    def within_torques(self, series: Series) -> tuple[Series, Array] | None:
        """The same, made smaller about its start until the motors can follow, and the regressor along it; None where
        they cannot.
        """
        for _ in range(TIMES):
            rows = self.model.regressor(*series.over(SAMPLES))
            over = np.abs(rows @ self.nominal).max(axis=0) / self.limits.torque
            if (over < WITHIN).all():
                return series, rows
            series = replace(series, sines=SMALLER * series.sines, cosines=SMALLER * series.cosines)
        self.refused[f"joint {self.model.joints[int(over.argmax())]} needs more torque than it has"] += 1
        return None

    def is_clear(self, series: Series, count: int = LOOKS) -> bool:
        """Whether nothing is met at so many looks."""
        if self.contacts is None:
            return True
        met = self.contacts.met(series.over(count).angles)
        if met is not None:
            self.refused[met] += 1
        return met is None

    def is_allowed(self, series: Series) -> bool:
        """Whether all limits hold and nothing is met, looked at every millisecond."""
        count = round(self.period / FINAL)
        motion, limits = series.over(count), self.limits
        return bool(
            (motion.angles >= limits.low).all()
            and (motion.angles <= limits.high).all()
            and (np.abs(motion.speeds) <= limits.speed).all()
            and (np.abs(motion.accelerations) <= limits.acceleration).all()
            and (np.abs(self.torques(*motion)) <= limits.torque).all()
            and self.is_clear(series, count)
        )


def draws(problem: MotionSearch, seed: int | list[int], count: int) -> Iterator[tuple[Shape, Series, Array]]:
    """Those of so many random series that motors can follow, with the regressor along each."""
    random, n = np.random.default_rng(seed), problem.model.njoint
    size = 1.0 / np.arange(1, HARMONICS + 1)
    for _ in range(count):
        sines, cosines = random.standard_normal((2, n, HARMONICS)) * size
        shape = Shape(sines, cosines, random.uniform(size=n))
        followed = problem.within_torques(problem.scaled(shape))
        if followed is not None:
            yield shape, *followed


def best_of_random(problem: MotionSearch, criterion: Criterion, seed: int, count: int = DRAWN) -> tuple[Shape, Series]:
    """The best of so many random series.

    Args:
        problem: what is searched.
        criterion: what is best.
        seed: of the draws.
        count: of the draws.

    Raises:
        PlantError: none of them is allowed.
    """
    there = [(criterion.value(series, rows), shape, series) for shape, series, rows in draws(problem, seed, count)]
    ranked = sorted(there, key=lambda each: -each[0])
    for _, shape, series in ranked:
        if problem.is_clear(series) and problem.is_allowed(series):
            return shape, series
    why = problem.refused.most_common(1)[0][0] if problem.refused else "none keeps its limits"
    raise PlantError(
        f"no motion was found that keeps its limits among {count}: most often {why} (allowed: wider limits, another "
        "home, or shapes that are not larger than the links)"
    )


def improved(
    problem: MotionSearch,
    criterion: Criterion,
    begun: tuple[Shape, Series],
    seed: int,
    tries: int = IMPROVED,
) -> tuple[Shape, Series]:
    """A series that is at least as good, by small random changes, and what it is scaled from.

    Args:
        problem: what is searched.
        criterion: what is best.
        begun: an allowed series, and what it was scaled from.
        seed: of the changes.
        tries: how many there are.
    """
    random = np.random.default_rng([seed, 1])
    shape, series = begun
    best, step, passed = criterion.value(series), FIRST, [begun]
    for _ in range(tries):
        which = random.uniform(size=problem.model.njoint) < 0.5
        change = random.standard_normal((2, *shape.sines.shape)) / np.arange(1, HARMONICS + 1)
        sines, cosines = step * which[:, None] * change
        place = shape.place + step * which * random.standard_normal(len(shape.place))
        other = Shape(shape.sines + sines, shape.cosines + cosines, np.clip(place, 0.0, 1.0))
        tried = problem.within_torques(problem.scaled(other))
        value = -np.inf if tried is None else criterion.value(*tried)
        if tried is not None and value > best and problem.is_clear(tried[0]):
            shape, best, step = other, value, min(GROWS * step, FIRST)
            passed.append((shape, tried[0]))
        else:
            step = max(SHRINKS * step, LAST)
    return next(each for each in reversed(passed) if problem.is_allowed(each[1]))
