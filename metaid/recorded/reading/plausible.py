"""What no log of a robot says: refused before anything is computed from it, with the true reason."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from metaid.errors import RecordError
from metaid.models import Array
from metaid.recorded.reading.readings import TURN, LogRun, noise_of

LEAST_ROWS = 100
MANY_TURNS = 25.0  # rad: a hinge that is said to be farther from 0 is probably logged in degrees
SPINNING = 60.0  # rad/s: but one that turns without an end, slower than this, may have turned so far
CALM = 0.05  # of a joint's fastest speed: below it the ratio of two speeds says nothing
ABOVE_NOISE = 5.0  # standard deviations
FAR_FROM_ONE = 1.5  # between a speed and the change of its angle
ALIKE = 0.1  # how much the ratios of several joints differ where their times are wrong
SHAKEN = 0.01  # of how far the farthest joint of a log goes, or a turn: one that goes less is held, and others shake it
DEGREES = 180.0 / np.pi
RADIANS = re.compile(r"(?<![a-z])rad(ians?)?(?![a-z])", re.IGNORECASE)  # in a column's own name


def refuse_few_rows(readings: LogRun) -> None:
    """Raises RecordError where there are too few rows."""
    if len(readings) < LEAST_ROWS:
        repeated = [f", {repair.text}" for repair in readings.repairs if repair.kind == "repeated times"]
        raise RecordError(f"{readings.name}: {len(readings)} rows{''.join(repeated)} (allowed: {LEAST_ROWS} or more)")


def refuse_degrees(
    readings: LogRun, slides: NDArray[np.bool_], endless: NDArray[np.bool_] | bool, radians: frozenset[str]
) -> None:
    """Raises RecordError where angles look like degrees.

    Args:
        readings: what the log holds.
        slides: which joints (njoint) are slides.
        endless: which joints (njoint) turn without an end.
        radians: columns of angles that are surely in radians.

    Raises:
        RecordError: those of a joint do, which is none of these.
    """
    is_said = np.array([name in radians or RADIANS.search(name) is not None for name in readings.names["angle"]])
    stride = max(1, round(0.05 / readings.period))
    moved = np.abs(readings.angles[stride:] - readings.angles[:-stride]).max(axis=0, initial=0.0)
    may_be = endless & (moved < SPINNING * stride * readings.period)
    widest = np.where(slides | is_said | may_be, 0.0, np.abs(readings.angles).max(axis=0))
    joint = int(widest.argmax())
    if widest[joint] > MANY_TURNS:
        raise RecordError(
            f"{readings.name}: {readings.names['angle'][joint]} goes to {widest[joint]:.4g}, which looks like "
            f"degrees (allowed: rad, at most {MANY_TURNS:g}, or more in a column whose name says its unit; --map "
            "OWN=angle:deg takes degrees, OWN=angle:rad radians)"
        )


def refuse_other_speeds(readings: LogRun, rate: float | None) -> None:
    """Raises RecordError where speeds are not how fast the angles change. Where all are as many times that, a `rate`
    that the user says may be wrong.
    """
    ratios = {} if readings.speeds is None else _ratios(readings, readings.speeds)
    for joint, ratio in ratios.items():
        if not 1.0 / FAR_FROM_ONE < ratio < FAR_FROM_ONE:
            is_near = abs(abs(np.log(max(abs(ratio), 1e-9))) - np.log(DEGREES)) < 0.4
            unit = ", which looks like degrees" if is_near else ""
            alike = ratio > 0.0 and all(abs(other / ratio - 1.0) < ALIKE for other in ratios.values())
            other_rate = f", or --rate of about {rate * ratio:.3g}" if rate is not None and alike else ""
            raise RecordError(
                f"{readings.name}: {readings.names['speed'][joint]} is {ratio:.3g} times how fast "
                f"{readings.names['angle'][joint]} changes{unit} (allowed: rad and rad/s; --map "
                f"OWN=speed:rpm takes other units{other_rate})"
            )


def _ratios(readings: LogRun, speeds: Array) -> dict[int, float]:
    """By joint how many times its speed is how fast its angle changes, over a tenth of a second or so. Changes within
    the noise of the sensors say nothing of speeds, nor does a joint that is held.
    """
    times, angles, period = readings.times, readings.angles, readings.period
    stride = max(1, round(0.05 / period))
    noise = np.sqrt(2.0) * noise_of(angles) + np.sqrt(stride) * period * noise_of(speeds)
    mean = np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times)[:, None], axis=0)
    said, seen = mean[stride::stride] - mean[:-stride:stride], angles[1:][stride::stride] - angles[1:][:-stride:stride]
    reach = np.ptp(angles, axis=0)
    ratios = {}
    for joint in np.flatnonzero(reach > SHAKEN * min(reach.max(), TURN)).tolist():
        size, least = np.abs(seen[:, joint]), ABOVE_NOISE * noise[joint]
        moving = size > max(CALM * size.max(), least)
        # where few changes are beyond the noise, these are those that the noise has made larger
        if moving.any() and seen[moving, joint].any() and np.quantile(size, 0.95) >= 2.0 * least:
            ratios[joint] = float(np.median(said[moving, joint] / seen[moving, joint]))
    return ratios
