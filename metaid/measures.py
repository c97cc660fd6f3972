"""From what an episode showed to a frequency: pure functions of arrays.

| measure | value | what it can identify |
| --- | --- | --- |
| `count` | whole periods in the fixed number of steps, an integer, as in the paper | gravity lumps |
| `crossing` | the same from interpolated crossing times, mean over joints and pushes, in Hz | gravity lumps |
| `spectral` | root of the ratio of spectral moments of the joint speeds, in Hz | all lumps, given rich pushes |
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from metaid.chain import Array
from metaid.episode import Episode, Record
from metaid.errors import EpisodeError, unknown

SPEED_RESOLUTION = 1e-3  # relative change of a joint speed over the horizon that still passes for coasting


def whole_periods(half_periods: NDArray[np.int64]) -> NDArray[np.int64]:
    """Complete periods per joint, summed over pushes: (npush x njoint) half periods → (njoint).  Eq. 9."""
    periods: NDArray[np.int64] = (half_periods // 2).sum(axis=0)
    return periods


def crossing_hz(half_periods: NDArray[np.int64], crossing_span: Array) -> Array:
    """Half periods over twice the time they took (npush x njoint), in Hz; zero if it never came back.  Eq. 9."""
    return np.divide(half_periods, 2.0 * crossing_span, out=np.zeros(half_periods.shape), where=crossing_span > 0.0)


def spectral_hz(acceleration_energy: Array, speed_energy: Array) -> float:
    """√(∫ q̈² dt / ∫ q̇² dt, each summed over joints and pushes) / 2π, in Hz: Rice's mean crossing frequency.  Eq. 10.

    Both energies are (npush x njoint). Joints that swing as one sinusoid give its frequency; zero if nothing moves.
    """
    total = float(speed_energy.sum())
    return float(np.sqrt(acceleration_energy.sum() / total)) / (2.0 * np.pi) if total > 0.0 else 0.0


@dataclass(frozen=True)
class Measure:
    """A measure by `name`: its `unit`, its `value` from a record, the `resolution` within which two values are
    equally good in an episode of given timestep (s), and a `ceiling` above every survivor's value, which falls are
    ranked by (Eq. 13)."""

    name: str
    unit: str
    value: Callable[[Record], float]
    resolution: Callable[[Episode, float], float]
    ceiling: Callable[[Episode, float], float]


def _nyquist_hz(_episode: Episode, timestep: float) -> float:
    return 0.5 / timestep


MEASURES = {
    "count": Measure(
        name="count",
        unit="periods",
        value=lambda record: float(whole_periods(record.half_periods).sum()),
        resolution=lambda episode, timestep: 0.5,
        ceiling=lambda episode, timestep: 0.5 * episode.pushes.size * episode.steps,
    ),
    "crossing": Measure(
        name="crossing",
        unit="Hz",
        value=lambda record: float(crossing_hz(record.half_periods, record.crossing_span).mean()),
        resolution=lambda episode, timestep: 0.5 / (episode.steps * timestep),
        ceiling=_nyquist_hz,
    ),
    "spectral": Measure(
        name="spectral",
        unit="Hz",
        value=lambda record: spectral_hz(record.acceleration_energy, record.speed_energy),
        resolution=lambda episode, timestep: SPEED_RESOLUTION / (2.0 * np.pi * episode.steps * timestep),
        ceiling=_nyquist_hz,
    ),
}


def get_measure(name: str) -> Measure:
    """The measure of that name.  Raises EpisodeError, naming the allowed ones."""
    if name not in MEASURES:
        raise EpisodeError(unknown("measure", name, MEASURES))
    return MEASURES[name]


def fall_value(ceiling: float, survived: int, total_steps: int) -> float:
    """The value of a fall: above the `ceiling` of every survivor, and the higher the earlier it came.  Eq. 13."""
    return ceiling * (2.0 - survived / total_steps)
