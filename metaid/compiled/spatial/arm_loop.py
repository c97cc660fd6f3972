"""Episodes of a simulated arm at full speed: MuJoCo's step, and between two of them the law of a candidate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from metaid.compiled.decorator import compiled
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.spatial.dynamics import Frames, fill_law, frames_of, kinetic_squares, new_space
from metaid.compiled.stages import Step, fastest_step, forget, step_plant
from metaid.episode import (
    QUANTITIES,
    Episode,
    GoesOn,
    Pushed,
    Record,
    SensorReadings,
    Spatial,
    WholeEpisodes,
    Windows,
    arm_record,
    noise_of,
    uncounted,
    windows_seen,
)
from metaid.models import Array
from metaid.plant import ArmPlant, FaultyPlant, slope_weights


class ArmLoop(WholeEpisodes):
    """Episodes on a simulated arm; holds its state, so one per thread.

    Args:
        plant: that moves.
        episode: what is done to it with every candidate.
        step: how it moves on; by default the fastest.
    """

    def __init__(self, plant: ArmPlant, episode: Episode, step: Step | None = None) -> None:
        self.plant, self.episode = FaultyPlant(plant), episode
        self.step = fastest_step(plant) if step is None else step
        self._kind = cast(Spatial, episode.kind)
        self._frames = frames_of(self._kind.nominal)
        self._space = new_space(plant.njoint)

    def on(self, episode: Episode) -> ArmLoop:
        """The same for another `episode`."""
        return ArmLoop(self.plant.inner, episode, self.step)

    def run(self, law: Array, number: int = 0, goes_on: GoesOn | None = None) -> Record:
        """The episode of the trial of that `number` with the parameters (njoint x 13) of a candidate; `goes_on` is
        asked after each push.
        """
        plant, faults, episode, nominal = self.plant.inner, self.plant.faults, self.episode, self._kind.nominal
        npush, n, period = episode.npush, plant.njoint, self.plant.timestep
        ends = np.array(episode.window_ends, dtype=np.int64)
        steps, fell = np.zeros(npush, dtype=np.int64), np.zeros(npush, dtype=np.bool_)
        energies, motion = np.zeros((npush, 2)), np.zeros((npush, len(ends), QUANTITIES, n))
        angles, speeds = np.zeros((2, npush, episode.steps + 1, n))
        noise = noise_of(self.plant, episode, number)
        offsets, weights = faults.encoder_offsets(n), slope_weights(period)
        sensors = noise.angles, noise.speeds, faults.speed_sensor, faults.encoder_step, offsets, weights
        drives = faults.control_every, faults.torque_limits(n), faults.torque_gains(n), noise.torques
        starts = self._starts(noise.impulses), episode.states
        settings = period, episode.lead, episode.steps, ends, *self._kind.bounds(episode)
        models = self._frames, np.array(law, order="C"), np.array(nominal.parameters, order="C")
        work = self._space, np.zeros((6, n)), np.zeros((faults.delay + 1, n))
        with quiet_mujoco():
            outputs = steps, fell, energies, motion, angles, speeds
            _run(self.step, models, starts, episode.springs, sensors, drives, settings, work, outputs)
        windows = Windows(ends, windows_seen(ends, steps, fell), motion, uncounted(motion))
        record = arm_record(period, steps, fell, energies, windows)
        if episode.readings_steps:
            sensed = speeds if faults.speed_sensor else None
            record = replace(record, readings=SensorReadings(steps - fell + 1, angles, sensed))
        return record.stopped_early(goes_on)

    def _starts(self, noise: Array) -> Array:
        """True joint coordinates and speeds at the start of each push (npush x 2 x njoint), with the `noise` of pushes
        (npush x njoint).
        """
        struck = [start.struck(each) for start, each in zip(self.episode.starts, noise, strict=True)]
        return np.array([(self.plant.inner.true_angles(start), start.speeds) for start in struck], dtype=np.float64)


def commanded_arm_torques(
    frames: Frames, parameters: Array, episode: Episode, positions: Array, speeds: Array
) -> Array:
    """The torques that a law made of sensor readings (npush x nstep x njoint), in N m or N.

    Args:
        frames: of the arm.
        parameters: of the law (njoint x 13).
        episode: in which it was sent.
        positions: joint coordinates that it acted on (npush x nstep + 1 x njoint), in rad or m.
        speeds: of the joints as the law took them to be (npush x nstep + 1 x njoint), in rad/s or m/s.
    """
    torques = np.zeros((episode.npush, episode.steps, positions.shape[2]))
    law = np.array(parameters, order="C")
    space, pull = new_space(positions.shape[2]), np.zeros(positions.shape[2])
    _command_all(frames, law, episode.states, episode.springs, positions, speeds, space, pull, torques)
    return torques


@dataclass(frozen=True, eq=False)
class QuickSpatial(Spatial):
    """The same with the law compiled: a rig has no time to wait for it between two ticks."""

    def torques(self, law: Array, plant: Any, episode: Pushed) -> Callable[[int, Array, Array], Array]:
        n, starts, springs = self.nominal.njoint, episode.states, episode.springs
        frames, parameters, space, pull = frames_of(self.nominal), np.array(law, order="C"), new_space(n), np.zeros(n)

        def torque(push: int, angles: Array, speeds: Array) -> Array:
            own, one = slice(push, push + 1), np.empty((1, 1, n))
            states = (np.ascontiguousarray(each)[None, None] for each in (angles, speeds))
            _command_all(frames, parameters, starts[own], springs[own], *states, space, pull, one)
            torques: Array = one[0, 0]
            return torques

        torque(0, *starts[0])  # compiled before a push begins
        return torque


@compiled
def _run(plant, models, starts, stiffness, sensors, drives, settings, work, outputs):  # type: ignore[no-untyped-def]
    """All pushes of an episode. Fills the `outputs`; see `Record`.

    `starts`: joint coordinates and speeds (npush x 2 x njoint) at the start of each push, true and as they were to be.
    `work`: the space of the dynamics; six vectors (njoint), the pull of the springs, a jump of speeds, two sums, a
    command, coordinates ahead; and the commands under way (delay + 1 x njoint).
    """
    frames, law, nominal = models
    truly, expected = starts
    control_every, limits, gains, torque_noise = drives
    timestep, lead, most, ends, low, high, allowed = settings
    space, vectors, commands = work
    slots = commands.shape[0]
    ran, fell, energies, motion, angles, speeds = outputs
    n = expected.shape[2]
    pull, jump, squares, jumps, command, ahead = vectors
    for push in range(expected.shape[0]):
        forget(plant)
        for i in range(n):
            plant.qpos[i], plant.qvel[i] = truly[push, 0, i], truly[push, 1, i]
            squares[i] = jumps[i] = 0.0
            for slot in range(slots):
                commands[slot, i] = 0.0
        start, window, step, fallen = expected[push], 0, 0, False
        _read(plant, start, sensors, push, 0, angles[push], speeds[push])
        while step < most:
            before, speed_before = angles[push, step], speeds[push, step]
            for i in range(n):
                ahead[i] = before[i] + lead * speed_before[i]
            fill_law(frames, law, start, stiffness[push], ahead, speed_before, pull, space, command)
            for i in range(n):
                commands[step % slots, i] = command[i]
                delivered = min(max(commands[(step + 1) % slots, i], -limits[i]), limits[i])
                plant.torque[i] = gains[i] * delivered + torque_noise[push, step, i]
            for _ in range(control_every):
                step_plant(plant)
            step += 1
            _read(plant, start, sensors, push, step, angles[push], speeds[push])
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
def _read(plant, start, sensors, push, step, angles, speeds):  # type: ignore[no-untyped-def]
    """Fills in what the sensors read at a step."""
    angle_noise, speed_noise, has_speed_sensor, encoder_step, offsets, weights = sensors
    count = weights.shape[0]
    for i in range(start.shape[1]):
        angle = plant.qpos[i] + offsets[i] + angle_noise[push, step, i]
        if encoder_step > 0.0:
            angle = np.floor(angle / encoder_step + 0.5) * encoder_step
        angles[step, i] = angle
        if has_speed_sensor:
            speeds[step, i] = plant.qvel[i] + speed_noise[push, step, i]
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
