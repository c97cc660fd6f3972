"""Episodes on a simulated plant as its sensors read it and its drives move it, compiled: whatever it is that moves.

What a push shows follows from its readings, which are all kept.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from metaid.compiled.decorator import compiled
from metaid.compiled.loop import start_states
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.stages import Step, fastest_step, forget, step_plant
from metaid.episode import Episode, GoesOn, Record, States, WholeEpisodes, noise_of, record_of
from metaid.models import Array
from metaid.plant import ArmPlant, FaultyPlant, MujocoPlant, of_each, slope_weights


def command(law, push, position, speed, torque):  # type: ignore[no-untyped-def]
    """Fills in the torque of a law; whose it is, is settled when the loop is compiled.

    Args:
        law: of a chain or of an arm.
        push: its number.
        position: joint coordinates (njoint) that the law acts on, in rad or m.
        speed: joint speeds (njoint), in rad/s or m/s.
        torque: of the joints (njoint), in N m or N, filled in.
    """
    raise NotImplementedError


def follow(law, push, step, positions, speeds):  # type: ignore[no-untyped-def]
    """Takes in what was read of a push at a step; whether it has fallen.

    Args:
        law: as `command` has it.
        push: its number.
        step: since the push.
        positions: joint coordinates (nsteps + 1 x njoint), in rad or m, up to that step.
        speeds: likewise, in rad/s or m/s.
    """
    raise NotImplementedError


class SensedLoop(WholeEpisodes):
    """Episodes on a plant with faults or without; holds its state, so one per thread.

    Args:
        plant: that moves.
        episode: what is done to it with every candidate.
        step: how it moves on; by default the fastest.
    """

    def __init__(self, plant: MujocoPlant | ArmPlant, episode: Episode, step: Step | None = None) -> None:
        self.plant = FaultyPlant(plant)
        self.episode = episode
        self._squares: Array | None = None  # that a law which is `sent` fills in; see `Seen`
        self.step = fastest_step(plant) if step is None else step
        self._expected = start_states(plant, episode.starts)

    def on(self, episode: Episode) -> SensedLoop:
        """The same for another `episode`."""
        return type(self)(self.plant.inner, episode, self.step)

    def sent(self, law: Any) -> Any:
        """A `law` as `command` and `follow` take it."""
        raise NotImplementedError

    def run(self, law: Any, number: int = 0, goes_on: GoesOn | None = None) -> Record:
        """The episode of the trial of that `number` with the `law` of a candidate; `goes_on` is asked after each
        push.
        """
        plant, faults, episode = self.plant.inner, self.plant.faults, self.episode
        n, noise = plant.njoint, noise_of(self.plant, episode, number)
        offsets, weights = of_each(faults.encoder_offset, n), slope_weights(self.plant.timestep)
        struck = [start.struck(each) for start, each in zip(episode.starts, noise.impulses, strict=True)]
        ran, fell = np.zeros(episode.npush, dtype=np.int64), np.zeros(episode.npush, dtype=np.bool_)
        angles, speeds = np.zeros((2, episode.npush, episode.steps + 1, n))
        with quiet_mujoco():
            _run(
                self.step,
                self.sent(law),
                (start_states(plant, struck), self._expected),
                (noise.angles, noise.speeds, faults.speed_sensor, faults.encoder_step, offsets, weights),
                (faults.control_every, of_each(faults.torque_limit, n), of_each(faults.torque_gain, n), noise.torques),
                (episode.steps, episode.lead, episode.kind.ends_at_fall),
                (np.zeros(n), np.zeros((faults.delay + 1, n))),
                (ran, fell, angles, speeds),
            )
        begun = ran[ran > 0].tolist()
        motions = [States(angles[push, : steps + 1], speeds[push, : steps + 1]) for push, steps in enumerate(begun)]
        with np.errstate(over="ignore", invalid="ignore"):  # where nothing falls a push may run away as far as it likes
            record = record_of(motions, self.plant, episode, fell, self._squares)
        return record.stopped_early(goes_on)


@compiled
def _run(plant, law, starts, sensors, drives, settings, work, seen):  # type: ignore[no-untyped-def]
    """All pushes of an episode, or those up to the first fall where that ends it.

    Args:
        plant: the `Step` that moves.
        law: that is sent; see `command`.
        starts: joint coordinates and speeds (npush x 2 x njoint) right after each push, true and as calibrated.
        sensors: noise of angles and of speeds (npush x nsteps + 1 x njoint each); whether speeds are read; the step of
            the encoders and their offsets (njoint), in rad or m; weights of the last angles for the speed, in 1/s.
        drives: timesteps that a torque holds; limits, in N m or N, and gains (njoint each); noise of torques (npush x
            nsteps x njoint).
        settings: steps after a push; by how much the law looks ahead, in s; whether a fall ends the episode.
        work: working space, coordinates ahead (njoint) and the commands under way (delay + 1 x njoint).
        seen: steps run and whether each push fell (npush), what was read of angles and of speeds, or what stands for
            these (npush x nsteps + 1 x njoint each), filled in.
    """
    (truly, expected), (control_every, limits, gains, torque_noise) = starts, drives
    (most, lead, ends_at_fall), (ahead, commands), (ran, fell, angles, speeds) = settings, work, seen
    n, slots = ahead.shape[0], commands.shape[0]
    for push in range(ran.shape[0]):
        forget(plant)
        for i in range(n):
            plant.qpos[i], plant.qvel[i] = truly[push, 0, i], truly[push, 1, i]
        commands[:] = 0.0
        _read(plant, expected[push], sensors, push, 0, angles[push], speeds[push])
        step, fallen = 0, False
        while step < most and not fallen:
            coming = commands[(step + 1) % slots]
            for i in range(n):
                ahead[i] = angles[push, step, i] + lead * speeds[push, step, i]
            command(law, push, ahead, speeds[push, step], commands[step % slots])  # type: ignore[no-untyped-call]
            for i in range(n):
                delivered = min(max(coming[i], -limits[i]), limits[i])
                plant.torque[i] = gains[i] * delivered + torque_noise[push, step, i]
            for _ in range(control_every):
                step_plant(plant)
            step += 1
            _read(plant, expected[push], sensors, push, step, angles[push], speeds[push])
            fallen = follow(law, push, step, angles[push], speeds[push])  # type: ignore[no-untyped-call]
        ran[push], fell[push] = step, fallen
        if fallen and ends_at_fall:
            break
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
