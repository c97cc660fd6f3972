"""Episodes of a simulated arm at full speed: MuJoCo's step, and between two of them the law of a candidate."""

from __future__ import annotations

import warnings

import numpy as np
from numba.extending import overload

from metaid.compiled.arms.dynamics import Frames, fill_law, frames_of, kinetic_squares, new_space
from metaid.compiled.decorator import compiled
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.stages import (
    DirectStep,
    MujocoStep,
    agrees_with_mj_step,
    direct_step,
    forget,
    mujoco_step,
    step_directly,
    step_with_mujoco,
)
from metaid.compiled.undocumented import class_of
from metaid.episode import QUANTITIES, SensorReadings, Windows
from metaid.episode.arms import ArmEpisode, ArmRecord, run_arm_stepwise, same_arm_record, sensor_noise
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant import slope_weights
from metaid.plant.arms import ArmPlant

CHECKED_STEPS = 12


class ArmLoop:
    """Episodes on a simulated arm; holds its state, so one per thread.

    Where the compiled loop does not agree with the plain one on a short episode, that is used, which is slow.

    Args:
        plant: that moves.
        nominal: what is believed of it; its mass matrix is the metric.
        episode: what is done to it with every candidate.
    """

    def __init__(self, plant: ArmPlant, nominal: Tree, episode: ArmEpisode) -> None:
        self.plant, self.nominal, self.episode = plant, nominal, episode
        self._frames = frames_of(nominal)
        self._space = new_space(plant.njoint)
        self._step = fastest_arm_step(plant)
        self.is_compiled = True
        if not self._agrees():
            self.is_compiled = False
            warnings.warn(
                f"the compiled loop disagrees with the stepwise one on plant {plant.name}; using that, which is slow",
                stacklevel=2,
            )

    def run(self, parameters: Array, number: int = 0) -> ArmRecord:
        """What an episode shows with the law of a candidate.

        Args:
            parameters: of the candidate (njoint x 13), in the order of PARAMETERS.
            number: of the trial, which the noise of the sensors depends on.
        """
        if not self.is_compiled:
            with quiet_mujoco():
                law = self.nominal.with_parameters(parameters)
                return run_arm_stepwise(self.plant, law, self.nominal, self.episode, number)
        return self._compiled(parameters, self.episode, number)

    def _agrees(self) -> bool:
        short = self.episode.shortened(CHECKED_STEPS)
        with quiet_mujoco():
            slow = run_arm_stepwise(self.plant, self.nominal, self.nominal, short)
        return same_arm_record(self._compiled(self.nominal.parameters, short, 0), slow)

    def _compiled(self, parameters: Array, episode: ArmEpisode, number: int) -> ArmRecord:
        plant, faults = self.plant, self.plant.settings.faults
        npush, n = episode.npush, plant.njoint
        ends = np.array(episode.window_ends, dtype=np.int64)
        steps, fell = np.zeros(npush, dtype=np.int64), np.zeros(npush, dtype=np.bool_)
        energies, motion = np.zeros((npush, 2)), np.zeros((npush, len(ends), QUANTITIES, n))
        angles, speeds = np.zeros((2, npush, episode.steps + 1, n))
        sensors = sensor_noise(plant, episode, number), faults.speed_sensor, slope_weights(plant.timestep)
        settings = plant.timestep, episode.steps, ends, *episode.bounds(self.nominal)
        models = self._frames, np.array(parameters, order="C"), np.array(self.nominal.parameters, order="C")
        work = self._space, np.zeros((4, n))
        with quiet_mujoco():
            outputs = steps, fell, energies, motion, angles, speeds
            _run(self._step, models, episode.states, episode.stiffness, sensors, settings, work, outputs)
        whole = steps - fell
        seen = (ends <= whole[:, None]).sum(axis=1)
        windows = Windows(ends, seen, motion, np.zeros((npush, len(ends), n), dtype=np.int64))
        kept = SensorReadings(whole + 1, angles, speeds if faults.speed_sensor else None) if faults.named else None
        return ArmRecord(plant.timestep, steps, fell, energies[:, 0], energies[:, 1], windows, kept)


def fastest_arm_step(plant: ArmPlant) -> MujocoStep | DirectStep:
    """How a compiled loop moves an arm on: MuJoCo's stages one by one, or `mj_step` where these are not the same to the
    last bit.
    """
    with quiet_mujoco():
        make = direct_step if agrees_with_mj_step(plant.model, plant.data) else mujoco_step
    return make(plant.model, plant.data)


def commanded_arm_torques(
    frames: Frames, parameters: Array, episode: ArmEpisode, readings: Array, speeds: Array
) -> Array:
    """The torques that a law made of sensor readings (npush x nstep x njoint), in N m or N.

    Args:
        frames: of the arm.
        parameters: of the law (njoint x 13).
        episode: in which it was sent.
        readings: joint coordinates (npush x nstep + 1 x njoint), in rad or m.
        speeds: of the joints as the law took them to be (npush x nstep + 1 x njoint), in rad/s or m/s.
    """
    torques = np.zeros((episode.npush, episode.steps, readings.shape[2]))
    law = np.array(parameters, order="C")
    space, pull = new_space(readings.shape[2]), np.zeros(readings.shape[2])
    _command_all(frames, law, episode.states, episode.stiffness, readings, speeds, space, pull, torques)
    return torques


def step_arm(plant):  # type: ignore[no-untyped-def]
    """Lets a timestep of a `Step` pass."""
    raise NotImplementedError


@overload(step_arm, inline="always")
def _step_of(plant):  # type: ignore[no-untyped-def]
    if class_of(plant) is MujocoStep:
        return lambda plant: step_with_mujoco(plant)
    return lambda plant: step_directly(plant)


@compiled
def _run(plant, models, starts, stiffness, sensors, settings, work, outputs):  # type: ignore[no-untyped-def]
    """All pushes of an episode. Fills the `outputs`; see `ArmRecord`.

    `work`: the space of the dynamics, and four vectors (njoint): speeds before a step, the pull of the springs, sums.
    """
    frames, law, nominal = models
    noise, has_speed_sensor, weights = sensors
    timestep, most, ends, low, high, allowed = settings
    space, vectors = work
    ran, fell, energies, motion, angles, speeds = outputs
    n = starts.shape[2]
    pull, jump, squares, jumps = vectors[0], vectors[1], vectors[2], vectors[3]
    for push in range(starts.shape[0]):
        forget(plant)  # type: ignore[no-untyped-call]
        for i in range(n):
            plant.qpos[i], plant.qvel[i] = starts[push, 0, i], starts[push, 1, i]
            squares[i] = jumps[i] = 0.0
        _read(plant, starts[push], noise[push], has_speed_sensor, weights, 0, angles[push], speeds[push])
        start, window, step, fallen = starts[push], 0, 0, False
        while step < most:
            before, speed_before = angles[push, step], speeds[push, step]
            fill_law(frames, law, start, stiffness[push], before, speed_before, pull, space, plant.torque)
            step_arm(plant)  # type: ignore[no-untyped-call]
            step += 1
            _read(plant, starts[push], noise[push], has_speed_sensor, weights, step, angles[push], speeds[push])
            for i in range(n):
                inside = low[i] <= angles[push, step, i] and angles[push, step, i] <= high[i]
                if not (inside and abs(speeds[push, step, i]) <= allowed[i]):
                    fallen = True
            if fallen:
                for i in range(n):
                    angles[push, step, i] = speeds[push, step, i] = 0.0
                break
            for i in range(n):
                jump[i] = speeds[push, step, i] - speed_before[i] - timestep * pull[i]
                squares[i] += speed_before[i] * speed_before[i]
                jumps[i] += jump[i] * jump[i]
            moved, jumped = kinetic_squares(frames, nominal, space, speed_before, jump)
            energies[push, 0] += timestep * moved
            energies[push, 1] += jumped / timestep
            if window < ends.shape[0] and step == ends[window]:
                for i in range(n):
                    motion[push, window, 0, i] = angles[push, step, i]
                    motion[push, window, 1, i] = speeds[push, step, i]
                    motion[push, window, 2, i] = timestep * squares[i]
                    motion[push, window, 3, i] = jumps[i] / timestep
                window += 1
        ran[push], fell[push] = step, fallen
    for i in range(n):
        plant.torque[i] = 0.0


@compiled
def _read(plant, start, noise, has_speed_sensor, weights, step, angles, speeds):  # type: ignore[no-untyped-def]
    """Fills in what the sensors read at a step."""
    count = weights.shape[0]
    for i in range(start.shape[1]):
        angles[step, i] = plant.qpos[i] + noise[step, i]
        if has_speed_sensor:
            speeds[step, i] = plant.qvel[i]
        elif step + 1 >= count:
            speed = 0.0
            for k in range(count):
                speed += weights[k] * angles[step + 1 - count + k, i]
            speeds[step, i] = speed
        else:
            speeds[step, i] = start[1, i]


@compiled
def _command_all(frames, law, starts, stiffness, angles, speeds, space, pull, torques):  # type: ignore[no-untyped-def]
    """Fills in the torques of all steps of all pushes."""
    for push in range(torques.shape[0]):
        for step in range(torques.shape[1]):
            position, speed, torque = angles[push, step], speeds[push, step], torques[push, step]
            fill_law(frames, law, starts[push], stiffness[push], position, speed, pull, space, torque)
