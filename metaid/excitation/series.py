"""Fourier series as motions: every joint moves by sines and cosines of a common period, from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from metaid.models import Array, Trajectory


@dataclass(frozen=True)
class Series:
    """A motion that begins and ends at `start` (njoint), with coefficients of `sines` and `cosines` (njoint x
    nharmonic), in rad or m, of a `period` in s.
    """

    start: Array
    sines: Array
    cosines: Array
    period: float

    @property
    def rates(self) -> Array:
        """Of the harmonics (nharmonic), in rad/s."""
        return _rates(self.period, self.sines.shape[1])

    def at(self, times: Any) -> Trajectory:
        """The motion at some times (nstep), in s."""
        return self._of(*_waves(times, self.rates))

    def over(self, count: int) -> Trajectory:
        """The motion at so many times of a period, evenly apart."""
        return self._of(*_waves_of_period(self.period, count, self.sines.shape[1]))

    def _of(self, sine: Array, cosine: Array) -> Trajectory:
        rates = self.rates
        return Trajectory(
            self.start + sine @ self.sines.T + (cosine - 1.0) @ self.cosines.T,
            cosine @ (self.sines * rates).T - sine @ (self.cosines * rates).T,
            -sine @ (self.sines * rates**2).T - cosine @ (self.cosines * rates**2).T,
        )


def _rates(period: float, nharmonic: int) -> Array:
    return np.asarray(2.0 * np.pi / period * np.arange(1, nharmonic + 1), dtype=np.float64)


def _waves(times: Any, rates: Array) -> tuple[Array, Array]:
    """Sines and cosines (nstep x nharmonic each) at some times (nstep), in s."""
    phases = np.outer(times, rates)
    return np.sin(phases), np.cos(phases)


@lru_cache(maxsize=4)
def _waves_of_period(period: float, count: int, nharmonic: int) -> tuple[Array, Array]:
    """The same at so many times of a `period`, in s: of thousands of series that a search tries."""
    return _waves(period / count * np.arange(count), _rates(period, nharmonic))


def rest_to_rest(sines: Array, cosines: Array, rates: Array) -> tuple[Array, Array]:
    """The nearest coefficients (njoint x nharmonic each) of a motion that has neither speed nor acceleration where it
    begins, for harmonics of these `rates` (nharmonic), in rad/s.
    """
    sines = sines - np.outer(sines @ rates, rates) / (rates @ rates)
    return sines, cosines - np.outer(cosines @ rates**2, rates**2) / (rates**2 @ rates**2)
