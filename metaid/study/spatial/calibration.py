"""What is measured at a rig that is an arm when a study of it is created: the noise of its sensors at rest, and how its
pushes begin.
"""

from __future__ import annotations

import numpy as np

from metaid.errors import PlantError
from metaid.models import Array
from metaid.models.tree import Tree, joint_torque
from metaid.plant import ArmStart, SocketPlant
from metaid.study.loops import QUIETEST_RIG
from metaid.study.resting import FEWEST_READINGS, REPEATS, noise_at_rest
from metaid.study.spatial.settings import ArmPushedSettings

AWAY = 0.3  # rad or m, and a share of the fastest joint: how far from what it was asked a push may begin


def calibrate_arm(plant: SocketPlant, nominal: Tree, starts: tuple[ArmStart, ...]) -> ArmPushedSettings:
    """What is measured at a rig of its sensors and of how its pushes begin.

    Args:
        plant: the rig; it is held once under the nominal law, and brought to each start REPEATS times.
        nominal: the arm whose law holds it.
        starts: of the study's pushes.

    Raises:
        PlantError: a push begins elsewhere than it was asked to.
        LostPlant: it does not answer.
    """
    angle_noise, speed_noise = noise_at_rest(_held(plant, nominal, starts[0]))
    seen = np.array([[_begun(plant, start, push) for push, start in enumerate(starts)] for _ in range(REPEATS)])
    noise = np.stack([angle_noise, speed_noise])
    variance = ((seen - seen.mean(axis=0)) ** 2).sum(axis=0).mean(axis=0) / (REPEATS - 1) - noise**2
    spread = np.sqrt(np.maximum(variance, 0.0))
    poses, speeds = seen.mean(axis=0).swapaxes(0, 1)
    return ArmPushedSettings(
        poses=poses.tolist(),
        speeds=speeds.tolist(),
        pose_spread=spread[0].tolist(),
        speed_spread=spread[1].tolist(),
        angle_noise=angle_noise.tolist(),
        speed_noise=speed_noise.tolist(),
    )


def start_spread_of_arm(pushed: ArmPushedSettings) -> Array:
    """A root of the covariance (npush x 2 njoint x 2 njoint) of the coordinates and speeds with which a push begins,
    about those that were measured. A coordinate is known no better than QUIETEST_RIG:
    an encoder that shows no noise has steps.
    """
    noise = np.concatenate([np.maximum(pushed.angle_noise, np.sqrt(REPEATS) * QUIETEST_RIG), pushed.speed_noise])
    spread = np.concatenate([pushed.pose_spread, pushed.speed_spread])
    deviations = np.sqrt((1.0 + 1.0 / REPEATS) * spread**2 + noise**2 / REPEATS)
    return np.tile(np.diag(deviations), (len(pushed.poses), 1, 1))


def _begun(plant: SocketPlant, start: ArmStart, push: int) -> tuple[Array, Array]:
    """Joint coordinates and speeds (njoint each) with which a push begins."""
    try:
        plant.push(start)
        pose, speeds = plant.states()
    finally:
        plant.stop()
    fastest = max(AWAY, AWAY * float(np.abs(start.speeds).max()))
    asked = ("is at", "rad", pose, start.pose, AWAY), ("turns at", "rad/s", speeds, start.speeds, fastest)
    for what, unit, seen, wanted, most in asked:
        for joint in np.flatnonzero(~(np.abs(seen - wanted) <= most))[:1]:
            raise PlantError(
                f"plant {plant.name}: push {push + 1} was to begin elsewhere: joint {joint + 1} {what} "
                f"{seen[joint]:.4g} {unit} (allowed: {wanted[joint]:.4g} ± {most:.2g} {unit})"
            )
    return pose, speeds


def _held(plant: SocketPlant, nominal: Tree, start: ArmStart) -> Array:
    """Joint coordinates and speeds (nreading x 2 x njoint) of a rig at rest that the nominal law holds."""
    seen: list[tuple[Array, Array]] = []
    try:
        plant.push(ArmStart(start.pose, np.zeros(plant.njoint)))
        for _ in range(FEWEST_READINGS):
            pose, speeds = plant.states()
            seen.append((pose, speeds))
            plant.apply_torque(joint_torque(nominal, pose, np.zeros(plant.njoint), np.zeros(plant.njoint)))
            plant.step()
    finally:
        plant.stop()
    return np.array(seen)
