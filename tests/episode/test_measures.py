"""Measures of signals whose frequency is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from metaid.episode import MEASURES, Episode, Record, crossing_hz, fall_value, get_measure, spectral_hz, whole_periods
from metaid.episode.episode import PLANAR
from metaid.episode.measures import alternation_periods, maxima_periods
from metaid.episode.record import crossings, energies
from metaid.errors import EpisodeError
from metaid.models import Lumps

TIMESTEP = 0.001


def sine(hertz: float, seconds: float, amplitude: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """Angles and speeds (nsteps + 1 x 1) of a joint that swings from the upright."""
    times = TIMESTEP * np.arange(round(seconds / TIMESTEP) + 1)
    omega = 2 * np.pi * hertz
    return amplitude * np.sin(omega * times)[:, None], amplitude * omega * np.cos(omega * times)[:, None]


def record_of(seen: Sequence[Any], *angles: np.ndarray) -> Record:
    """The record of pushes that did not fall, from the four sums that it has of them and their angles."""
    steps = np.array([len(each) - 1 for each in angles])
    return Record(TIMESTEP, steps, np.zeros(len(steps), dtype=np.bool_), *seen, angles=angles)


@pytest.mark.parametrize("hertz", [0.5, 1.0, 3.7, 12.0])
def test_spectral_of_a_sinusoid_is_its_frequency(hertz: float) -> None:
    """Whatever the amplitude, over whole periods, to the accuracy of finite differences."""
    for amplitude in (0.01, 1.0):
        _, speeds = sine(hertz, 10.0, amplitude)
        speed_energy, acceleration_energy = energies(speeds, TIMESTEP)[:, -1]
        assert spectral_hz(acceleration_energy[None], speed_energy[None]) == pytest.approx(hertz, rel=1e-3)


def test_spectral_weighs_joints_and_pushes_by_the_energy_of_their_motion() -> None:
    """Two sinusoids give the root of the mean of their squared frequencies, weighed by mean squared speed."""
    # Mean squared speeds go as (amplitude x frequency)²: 4 to 1, so the mean is (4 x 1² + 7²) / 5.
    parts = [
        energies(sine(hertz, 10.0, amplitude)[1], TIMESTEP)[:, -1] for hertz, amplitude in ((1.0, 1.4), (7.0, 0.1))
    ]
    speed_energy, acceleration_energy = (np.array([part[i] for part in parts]) for i in (0, 1))
    assert spectral_hz(acceleration_energy, speed_energy) == pytest.approx(np.sqrt(53.0 / 5.0), rel=1e-3)
    assert spectral_hz(acceleration_energy.T, speed_energy.T) == pytest.approx(np.sqrt(53.0 / 5.0), rel=1e-3)


def test_constant_speed_has_no_frequency_in_any_measure() -> None:
    """Coasting is zero in every measure."""
    angles, speeds = TIMESTEP * np.arange(1001)[:, None], np.ones((1001, 1))
    half_periods, span = crossings(angles, speeds[0] != 0.0, TIMESTEP)
    seen = half_periods[-1:], span[None], *energies(speeds, TIMESTEP)[:, -1:]
    record, episode = record_of(seen, angles), Episode(np.array([[0.1]]), 1000)
    values = {name: MEASURES[name].value(record, episode) for name in PLANAR.measures}
    assert values == {"count": 0.0, "crossing": 0.0, "spectral": 0.0, "smoothed": pytest.approx(0.0, abs=1e-9)}


def test_count_is_of_whole_periods_and_crossing_of_the_time_they_took() -> None:
    """10.3 s of 1 Hz are 10 whole periods; the interpolated frequency is 1 Hz."""
    angles, speeds = sine(1.0, 10.3)
    half_periods, span = crossings(angles, speeds[0] != 0.0, TIMESTEP)
    assert whole_periods(half_periods[-1:]).tolist() == [10]
    assert crossing_hz(half_periods[-1:], span[None])[0, 0] == pytest.approx(1.0, rel=1e-5)


@pytest.mark.parametrize("name", MEASURES)
def test_every_fall_is_worse_than_every_survivor_and_earlier_falls_are_worse(name: str) -> None:
    """Even the fastest signal that steps can carry, a sign change a step, ranks before the latest fall."""
    measure, steps = MEASURES[name], 1000
    episode = Episode(np.array([[0.1]]), steps)
    angles = np.append(0.0, 0.1 * np.resize([1.0, -1.0], steps))[:, None]
    speeds = np.resize([1.0, -1.0], steps + 1)[:, None]
    half_periods, span = crossings(angles, speeds[0] != 0.0, TIMESTEP)
    seen = half_periods[-1:], span[None], *energies(speeds, TIMESTEP)[:, -1:]
    wild = record_of(seen, angles)
    ceiling = measure.ceiling(episode, TIMESTEP)
    late, early = (fall_value(ceiling, survived, steps) for survived in (steps - 1, 1))
    assert measure.value(wild, episode) <= ceiling < late < early


def test_unknown_measure_names_the_known_ones() -> None:
    """A wrong name tells which are right."""
    with pytest.raises(EpisodeError, match=r"'spectrum'; did you mean 'spectral'.*count, crossing, spectral"):
        get_measure("spectrum")


def test_counting_rules_of_a_swing_and_of_a_revolution() -> None:
    """Of ten swings each rule counts ten; of four revolutions none is complete, three wrap within, and the rule adds
    one.
    """
    swing, _ = sine(1.0, 10.01)
    turning = np.linspace(0.0, 8 * np.pi - 0.1, 5001)[:, None]
    assert get_measure("count", "complete") is MEASURES["count"]
    assert maxima_periods(swing).tolist() == [11]
    assert alternation_periods(swing).tolist() == [10]
    assert maxima_periods(turning).tolist() == [5]
    assert alternation_periods(turning).tolist() == [0]
    assert maxima_periods(np.hstack([swing, -swing])).tolist() == [11, 11]


def test_alternations_do_not_count_what_stays_within_a_quarter_of_the_largest_angle() -> None:
    """Small wiggles between large swings are hysteresis, not periods."""
    large, small = sine(0.5, 4.0, 1.0)[0], sine(5.0, 4.0, 0.2)[0]
    assert alternation_periods(np.vstack([large, small, large])).tolist() == [4]


def test_rules_of_a_record_are_summed_over_pushes() -> None:
    """A rule counts each push by itself, whatever the joints did before."""
    angles = sine(1.0, 10.01)[0]
    record = record_of(np.zeros((4, 2, 1)), angles, angles[:5005])
    assert get_measure("count", "maxima").periods(record).tolist() == [17]
    assert get_measure("count", "maxima").value(record, Episode(np.ones((2, 1)), 1)) == 17.0


@pytest.mark.parametrize(
    ("measure", "rule", "message"),
    [
        ("count", "maximum", r"'maximum'; did you mean 'maxima'.*complete, maxima, alternations"),
        ("spectral", "maxima", "'spectral' has no counting rule"),
    ],
)
def test_rule_that_cannot_be_used_is_refused(measure: str, rule: str, message: str) -> None:
    """Rules belong to `count`; a wrong name tells which are right."""
    with pytest.raises(EpisodeError, match=message):
        get_measure(measure, rule)


@pytest.mark.parametrize(("measure", "coriolis"), [("count", False), ("crossing", False), ("spectral", True)])
def test_measure_says_by_kind_which_of_the_searched_lumps_it_can_find(measure: str, coriolis: bool) -> None:
    """Whatever the order of the kinds: gravity lumps by all, the others by those that see the Coriolis lumps."""
    lumps = Lumps(
        np.ones(3), np.ones((3, 3)) - np.eye(3), damping=np.ones(3), searched=("coriolis", "gravity", "damping")
    )
    assert MEASURES[measure].determined(lumps).tolist() == [coriolis] * 3 + [True] * 3 + [coriolis] * 3
