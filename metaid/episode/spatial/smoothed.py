"""The measure of an arm with noisy sensors: differences of readings are no accelerations, so curves are fitted."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre

from metaid.episode.spatial.arm_episode import ArmEpisode
from metaid.episode.spatial.arm_record import ArmRecord
from metaid.models.tree import Tree, joint_mass_matrix

DEGREE = 5  # of the polynomial in time that a joint's readings after a push are smoothed by
LOOKS = 20  # times in a push at which the curves are looked at
FEWEST = 3 * (DEGREE + 1)  # readings of a push that are worth a curve


def smoothed_arm_frequency(record: ArmRecord, episode: ArmEpisode, nominal: Tree) -> float:
    """Rice's frequency in the kinetic metric, in Hz, of curves through the readings of noisy sensors. It has the floor
    that noise has; infinite where no push was seen for long enough.  Eq. 44.

    Args:
        record: what was seen; it has readings.
        episode: what was done.
        nominal: whose mass matrix is the metric.
    """
    assert record.readings is not None, "noisy sensors were read"
    energies = np.zeros(2)
    for push, count in enumerate(record.readings.counts.tolist()):
        if count < FEWEST:
            continue
        basis = legendre.legvander(np.linspace(-1.0, 1.0, count), DEGREE)
        curve = np.linalg.lstsq(basis, record.readings.angles[push, :count], rcond=None)[0]
        horizon, when = record.timestep * (count - 1), np.linspace(-1.0, 1.0, LOOKS)
        angles, speeds, accelerations = (
            legendre.legval(when, legendre.legder(curve, order)).T * (2.0 / horizon) ** order for order in range(3)
        )
        accelerations = accelerations + episode.stiffness[push] * (angles - episode.starts[push].pose)
        metric = joint_mass_matrix(nominal, angles)
        for number, motion in enumerate((speeds, accelerations)):
            energies[number] += horizon * float(np.einsum("ti,tij,tj->t", motion, metric, motion).mean())
    return float(np.sqrt(energies[1] / energies[0]) / (2.0 * np.pi)) if energies[0] > 0.0 else np.inf
