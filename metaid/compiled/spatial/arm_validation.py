"""The loop of a validation of an arm, compiled: computed torque along a motion."""

from __future__ import annotations

import numpy as np

from metaid.compiled.decorator import compiled
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.spatial.dynamics import (
    accelerating_torques,
    fill_mass_matrix,
    frames_of,
    new_space,
)
from metaid.compiled.stages import fastest_step, forget, step_plant
from metaid.models import Array
from metaid.plant import ArmPlant


def track_arm(
    plant: ArmPlant, laws: tuple[Array, Array], desired: tuple[Array, Array, Array], bandwidth: float, lost: float
) -> Array:
    """Drives an arm from rest along a motion with computed torque.

    Args:
        plant: it is brought to rest where the motion begins first.
        laws: parameters (njoint x 13 each) of the feedforward, and of the arm whose mass matrix weighs the feedback.
        desired: joint coordinates in rad or m, speeds and accelerations of them, each (nsteps x njoint).
        bandwidth: of the feedback, in rad/s.
        lost: the error of a joint, in rad or m, beyond which control is lost.

    Returns:
        Joint coordinates (nseen x njoint), up to where control was lost.
    """
    law, metric = (np.array(parameters, order="C") for parameters in laws)  # copies, all of one layout
    models, step = (frames_of(plant.tree), law, metric), fastest_step(plant)
    positions, speeds, accelerations = (np.ascontiguousarray(part) for part in desired)
    seen, work = np.zeros(positions.shape), (new_space(plant.njoint), np.zeros((2, plant.njoint)))
    with quiet_mujoco():
        count = _track(step, models, (positions, speeds, accelerations), bandwidth, lost, work, seen)
    return seen[:count]


@compiled
def _track(plant, models, motion, bandwidth, lost, work, seen):  # type: ignore[no-untyped-def]
    """Fills in what was `seen` (nsteps x njoint); returns the steps before control was lost.

    τ = M̃(q) q̈_d + h̃ + g̃ + M̄(q) (k_p e + k_d ė), the `models` being those of M̃ and M̄. Friction and Coriolis forces
    are those at the wanted speeds: where a joint sticks, its own tell nothing of the torque that it needs to move.
    """
    (frames, law, metric), (positions, speeds, accelerations), (space, vectors) = models, motion, work
    torque, correction = vectors[0], vectors[1]
    n = seen.shape[1]
    forget(plant)
    for i in range(n):
        plant.qpos[i], plant.qvel[i] = positions[0, i], 0.0
    for step in range(seen.shape[0]):
        for i in range(n):
            error = positions[step, i] - plant.qpos[i]
            if not abs(error) <= lost:
                return step
            seen[step, i] = plant.qpos[i]
            rate = speeds[step, i] - plant.qvel[i]
            correction[i] = bandwidth * bandwidth * error + 2.0 * bandwidth * rate
        accelerating_torques(frames, law, plant.qpos, speeds[step], accelerations[step], space, torque)
        fill_mass_matrix(frames, metric, space)
        for i in range(n):
            for j in range(i):
                torque[i] += space.mass_matrix[i, j] * correction[j]
                torque[j] += space.mass_matrix[i, j] * correction[i]
            torque[i] += space.mass_matrix[i, i] * correction[i]
        for i in range(n):
            plant.torque[i] = torque[i]
        step_plant(plant)
    return seen.shape[0]
