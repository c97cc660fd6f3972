"""From what an episode showed to a frequency: pure functions of arrays.

| measure | value | what it can identify |
| --- | --- | --- |
| `count` | whole periods in the fixed number of steps, an integer, as in the paper | gravity lumps |
| `crossing` | the same from interpolated crossing times, mean over joints and pushes, in Hz | gravity lumps |
| `spectral` | root of the ratio of spectral moments of the joint speeds, in Hz | all lumps, given rich pushes |
| `smoothed` | the same of smooth curves through the angles, less what noise alone shows, in Hz | the same, with noise |
| `kinetic` | of an arm, `spectral` in the metric of the nominal mass matrix, in Hz | all base parameters |

What a period is, the paper does not say. `count` has a counting rule: `complete` (default), whole periods between
crossings of the upright; `maxima`, local maxima of the wrapped angle, plus one; `alternations`, half the alternations
between beyond +25 % and beyond −25 % of the largest angle, rounded up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from metaid.episode.episode import PLANAR, Episode, Kind
from metaid.episode.kinetic import kinetic_hz
from metaid.episode.record import Record
from metaid.episode.smoothing import smoothed_hz
from metaid.errors import EpisodeError, unknown
from metaid.models import Array, Lumps

NOISE_RESOLUTION = 2.0  # of the noise floor's spread: four standard deviations of the square
SPEED_RESOLUTION = 1e-3  # relative change of a joint speed over the horizon that still passes for coasting

HYSTERESIS = 0.25  # of the largest angle, on either side of the upright, for the rule `alternations`


def whole_periods(half_periods: NDArray[np.int64]) -> NDArray[np.int64]:
    """Complete periods per joint, summed over pushes: (npush x njoint) half periods → (njoint).  Eq. 10."""
    periods: NDArray[np.int64] = (half_periods // 2).sum(axis=0)
    return periods


def maxima_periods(angles: Array) -> NDArray[np.int64]:
    """Local maxima of each joint's angle, wrapped to (−π, π], plus one: (nsteps + 1 x njoint) → (njoint).

    A revolution has a maximum where the angle wraps, so a joint that only turns round has periods by this rule.
    """
    wrapped = np.pi - (np.pi - angles) % (2.0 * np.pi)
    inner = wrapped[1:-1]
    maxima: NDArray[np.int64] = ((inner > wrapped[:-2]) & (inner >= wrapped[2:])).sum(axis=0) + 1
    return maxima


def alternation_periods(angles: Array) -> NDArray[np.int64]:
    """Half the alternations of each joint between beyond +25 % and beyond −25 % of its largest angle, rounded up:
    (nsteps + 1 x njoint) → (njoint).
    """
    threshold = HYSTERESIS * np.abs(angles).max(axis=0)
    beyond = np.where(np.abs(angles) > threshold, np.sign(angles), 0.0)
    alternations = [np.count_nonzero(np.diff(side[side != 0.0])) for side in beyond.T]
    return (np.array(alternations) + 1) // 2


def crossing_hz(half_periods: NDArray[np.int64], crossing_span: Array) -> Array:
    """Half periods over twice the time they took (npush x njoint), in Hz; zero if it never came back.  Eq. 10."""
    return np.divide(half_periods, 2.0 * crossing_span, out=np.zeros(half_periods.shape), where=crossing_span > 0.0)


def spectral_hz(acceleration_energy: Array, speed_energy: Array) -> float:
    """√(∫ q̈² dt / ∫ q̇² dt, each summed over joints and pushes) / 2π, in Hz: Rice's mean crossing frequency.  Eq. 11.

    Both energies are (npush x njoint). Joints that swing as one sinusoid give its frequency; zero if nothing moves.
    """
    total = float(speed_energy.sum())
    return float(np.sqrt(acceleration_energy.sum() / total)) / (2.0 * np.pi) if total > 0.0 else 0.0


def _nyquist_hz(_episode: Episode, timestep: float) -> float:
    return 0.5 / timestep


def _coasting_hz(episode: Episode, timestep: float) -> float:
    return SPEED_RESOLUTION / (2.0 * np.pi * episode.steps * timestep)


@dataclass(frozen=True)
class Measure:
    """A number that an episode's record is turned into.

    Attributes:
        name: of it.
        value: of the record of an episode.
        unit: of its values.
        resolution: within which two values are equally good in an episode of given timestep (s).
        ceiling: above every survivor's value, which falls are ranked by (Eq. 18).
        sees_coriolis: without it, what a search finds of the Coriolis lumps means nothing.
        periods: of each joint (njoint).
        keeps_angles: whether it needs the joint angles.
        is_noisy: whether the best trial is the luckiest of many equals, and their mean is the better estimate.
    """

    name: str
    value: Callable[[Record, Episode], float]
    unit: str = "Hz"
    resolution: Callable[[Episode, float], float] = _coasting_hz
    ceiling: Callable[[Episode, float], float] = _nyquist_hz
    sees_coriolis: bool = True
    periods: Callable[[Record], NDArray[np.int64]] = lambda record: whole_periods(record.half_periods)
    keeps_angles: bool = False
    is_noisy: bool = False

    def determined(self, lumps: Lumps) -> NDArray[np.bool_]:
        """Which of the searched `lumps` (nlump) a search by this measure can find, by their kinds."""
        kinds = [np.full(lumps.of(kind).shape[-1], self.sees_coriolis or kind == "gravity") for kind in lumps.searched]
        return np.concatenate(kinds)


MEASURES = {
    "count": Measure(
        name="count",
        value=lambda record, episode: float(whole_periods(record.half_periods).sum()),
        unit="periods",
        resolution=lambda episode, timestep: 0.5,
        ceiling=lambda episode, timestep: episode.pushes.size * (0.5 * episode.steps + 1.0),
        sees_coriolis=False,
    ),
    "crossing": Measure(
        name="crossing",
        value=lambda record, episode: float(crossing_hz(record.half_periods, record.crossing_span).mean()),
        resolution=lambda episode, timestep: 0.5 / (episode.steps * timestep),
        sees_coriolis=False,
    ),
    "spectral": Measure(
        name="spectral",
        value=lambda record, episode: spectral_hz(record.acceleration_energy, record.speed_energy),
    ),
    "smoothed": Measure(
        name="smoothed",
        value=lambda record, episode: smoothed_hz(np.array(record.angles), record.timestep, record.noise_floor),
        resolution=lambda episode, timestep: max(
            _coasting_hz(episode, timestep), NOISE_RESOLUTION * episode.noise_floor.spread
        ),
        keeps_angles=True,
        is_noisy=True,
    ),
    "kinetic": Measure(
        name="kinetic",
        value=lambda record, episode: min(kinetic_hz(record, episode), 0.5 / record.timestep),
    ),
}
ANGLE_RULES = {"maxima": maxima_periods, "alternations": alternation_periods}
RULES = ("complete", *ANGLE_RULES)


def get_measure(name: str, rule: str | None = None, kind: Kind = PLANAR) -> Measure:
    """The measure of that name, `count` with a counting `rule`.  Raises EpisodeError, naming those that this `kind` of
    robot has.
    """
    if name not in kind.measures:
        raise EpisodeError(unknown("measure", name, kind.measures))
    if rule is None:
        return MEASURES[name]
    if name != "count":
        raise EpisodeError(f"the measure '{name}' has no counting rule (allowed: with the measure 'count')")
    if rule not in RULES:
        raise EpisodeError(unknown("rule", rule, RULES))
    return MEASURES[name] if rule == "complete" else _counted_by(ANGLE_RULES[rule])


def _counted_by(rule: Callable[[Array], NDArray[np.int64]]) -> Measure:
    def periods(record: Record) -> NDArray[np.int64]:
        counted: NDArray[np.int64] = np.sum([rule(angles) for angles in record.angles], axis=0)
        return counted

    return replace(
        MEASURES["count"],
        value=lambda record, episode: float(periods(record).sum()),
        periods=periods,
        keeps_angles=True,
    )


def fall_value(ceiling: float, survived: int, total_steps: int) -> float:
    """The value of a fall: above the `ceiling` of every survivor, and the higher the earlier it came.  Eq. 18."""
    return ceiling * (2.0 - survived / total_steps)
