"""The measure of an arm: Rice's frequency in the metric of the nominal mass matrix."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial import legendre

from metaid.episode.episode import Episode
from metaid.episode.readings import SensorReadings
from metaid.episode.record import Record
from metaid.models import Array
from metaid.models.tree import kinetic_squares

DEGREE = 5  # of the polynomial in time that a joint's readings after a push are smoothed by
LOOKS = 20  # times in a push at which the curves are looked at
FEWEST = 3 * (DEGREE + 1)  # readings of a push that are worth a curve


def kinetic_hz(record: Record, episode: Episode) -> float:
    """√(∫ q̈ᵀ M̄ q̈ dt / ∫ q̇ᵀ M̄ q̇ dt) / 2π of all pushes, in Hz, with q̈ beyond what the law is to bring about; infinite
    where nothing moved.  Eq. 57.

    With noisy sensors, which are read, it is that of smooth curves through what they read, for differences of readings
    are no accelerations. It has the floor that noise has.
    """
    if record.readings is None:
        moving, accelerated = float(record.speed_energy.sum()), float(record.acceleration_energy.sum())
    else:
        moving, accelerated = _smooth_energies(record, record.readings, episode)
    return float(np.sqrt(accelerated / moving) / (2.0 * np.pi)) if moving > 0.0 else np.inf


def _smooth_energies(record: Record, readings: SensorReadings, episode: Episode) -> Array:
    """∫ q̇ᵀ M̄ q̇ dt, in J s, and ∫ (q̈ + k (q − q₀))ᵀ M̄ (q̈ + k (q − q₀)) dt, in J/s, of curves through readings."""
    arm: Any = episode.kind
    energies, springs, poses = np.zeros(2), episode.springs, episode.states[:, 0]
    for push, count in enumerate(readings.counts.tolist()):
        if count < FEWEST:
            continue
        basis = legendre.legvander(np.linspace(-1.0, 1.0, count), DEGREE)
        curve = np.linalg.lstsq(basis, readings.angles[push, :count], rcond=None)[0]
        horizon, when = record.timestep * (count - 1), np.linspace(-1.0, 1.0, LOOKS)
        angles, speeds, accelerations = (
            legendre.legval(when, legendre.legder(curve, order)).T * (2.0 / horizon) ** order for order in range(3)
        )
        accelerations = accelerations + springs[push] * (angles - poses[push])
        for number, motion in enumerate((speeds, accelerations)):
            energies[number] += horizon * float(kinetic_squares(arm.nominal, angles, motion).mean())
    return energies
