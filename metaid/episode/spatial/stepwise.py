"""An episode of an arm, step by step in plain Python: what the compiled loop is compared with."""

from __future__ import annotations

import numpy as np

from metaid.episode.noise import noise_of
from metaid.episode.readings import SensorReadings, told_times
from metaid.episode.spatial.arm_episode import ArmEpisode
from metaid.episode.spatial.arm_record import ArmRecord
from metaid.episode.stepwise import again_if_lost
from metaid.episode.windows import QUANTITIES, Windows
from metaid.errors import ImplausiblePlant
from metaid.models import Array
from metaid.models.tree import Tree, joint_mass_matrix, joint_torque
from metaid.plant import ArmPlant, FaultyPlant, SocketPlant

AWAY, OTHER_SPEED = 0.1, 0.2  # rad or m, and a share of the fastest joint: a start farther off is another


def run_arm_stepwise(
    plant: ArmPlant | FaultyPlant | SocketPlant, law: Tree, nominal: Tree, episode: ArmEpisode, number: int = 0
) -> ArmRecord:
    """One episode.

    Args:
        plant: that moves, a rig too; a FaultyPlant shows what its sensors read.
        law: the candidate, whose torque it is sent.
        nominal: whose mass matrix is the metric.
        episode: what is done.
        number: of the trial, which its noise depends on.

    Raises:
        ImplausiblePlant: a push of a rig does not begin as when it was calibrated.
    """
    if isinstance(plant, FaultyPlant):
        plant.begin(noise_of(plant, episode, number))
    n, dt = plant.njoint, plant.timestep
    low, high, allowed = episode.bounds(nominal)
    ends = np.array(episode.window_ends, dtype=np.int64)
    motion = np.zeros((episode.npush, len(ends), QUANTITIES, n))
    angles, speeds = np.zeros((2, episode.npush, episode.steps + 1, n))
    steps, fell = np.zeros(episode.npush, np.int64), np.zeros(episode.npush, np.bool_)
    energies, times = np.zeros((episode.npush, 2)), list[Array | None]()
    for push, start in enumerate(episode.starts):
        stiffness, sums = float(episode.stiffness[push]), np.zeros((2, n))

        def read(step: int, push: int = push) -> tuple[Array, Array]:
            angles[push, step], speeds[push, step] = plant.states()
            return angles[push, step].copy(), speeds[push, step].copy()

        plant.push(start)
        position, speed = read(0)
        if episode.begun is not None:
            _check_start(plant.name, push, episode.begun[push], position, speed)
        for step in range(1, episode.steps + 1):
            ahead = position + episode.lead * speed
            pull = -stiffness * (ahead - start.pose)
            plant.apply_torque(joint_torque(law, ahead, speed, pull))
            plant.step()
            metric, before = joint_mass_matrix(nominal, ahead), speed
            position, speed = read(step)
            steps[push] = step
            inside = (low <= position) & (position <= high) & (np.abs(speed) <= allowed)
            if not inside.all():
                fell[push] = True
                break
            jump = speed - before - dt * pull
            sums += [before**2, jump**2]
            energies[push] += [dt * before @ metric @ before, jump @ metric @ jump / dt]
            for window in np.flatnonzero(ends == step):
                motion[push, window] = position, speed, dt * sums[0], sums[1] / dt
        plant.stop()
        times.append(plant.times if isinstance(plant, SocketPlant) else None)
    whole = steps - fell
    seen = (ends <= whole[:, None]).sum(axis=1)
    windows = Windows(ends, seen, motion, np.zeros((episode.npush, len(ends), n), dtype=np.int64))
    sensed = not isinstance(plant, FaultyPlant) or plant.faults.speed_sensor
    kept = SensorReadings(whole + 1, angles, speeds if sensed else None) if episode.keeps_readings else None
    kept = None if kept is None else told_times(times, kept)
    for push in range(episode.npush):
        angles[push, whole[push] + 1 :] = speeds[push, whole[push] + 1 :] = 0.0
    return ArmRecord(dt, steps, fell, energies[:, 0], energies[:, 1], windows, kept)


class StepwiseArmLoop:
    """Episodes on a rig that is an arm.

    Args:
        plant: that moves.
        nominal: the nominal arm; its mass matrix is the metric.
        episode: what is done to it with every candidate.
    """

    def __init__(self, plant: SocketPlant, nominal: Tree, episode: ArmEpisode) -> None:
        self.plant, self.nominal, self.episode = plant, nominal, episode

    def run(self, parameters: Array, number: int = 0) -> ArmRecord:
        """What an episode shows with the law of a candidate (njoint x 13), again if the plant was lost in it.  Raises
        as `again_if_lost` does.
        """
        law = self.nominal.with_parameters(parameters)
        return again_if_lost(lambda: run_arm_stepwise(self.plant, law, self.nominal, self.episode, number))


def _check_start(plant: str, push: int, begun: Array, position: Array, speed: Array) -> None:
    """Raises ImplausiblePlant where a push begins otherwise than it was seen to (2 x njoint)."""
    allowed = (AWAY, max(AWAY, OTHER_SPEED * float(np.abs(begun[1]).max())))
    for what, unit, seen, known, most in zip(
        ("is at", "turns at"), ("rad", "rad/s"), (position, speed), begun, allowed, strict=True
    ):
        for joint in np.flatnonzero(~(np.abs(seen - known) <= most))[:1]:
            raise ImplausiblePlant(
                f"plant {plant}: push {push + 1}: joint {joint + 1} {what} {seen[joint]:.4g} {unit} at its start "
                f"(allowed: {known[joint]:.4g} ± {most:.2g} {unit}, as when the study was created)"
            )
