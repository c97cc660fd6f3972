"""Episodes on a plant with faults, compiled. Plants without faults have a loop of their own (`kernel`), which none of
this slows down.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.compiled.batch import laws_of, new_windows
from metaid.compiled.decorator import compiled
from metaid.compiled.law import LINK, compensate, has_fallen, turn_to_angles
from metaid.compiled.loop import start_states
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.stages import Step, forget, step_plant
from metaid.episode import (
    Episode,
    GoesOn,
    Record,
    WholeEpisodes,
    noise_of,
    readings_before_fall,
    windows_before_fall,
    with_deadband,
)
from metaid.models import Lumps
from metaid.plant import FaultyPlant, MujocoPlant, slope_weights


@compiled
def _read(chain, expected, noise, push, step, sensors, kept, kept_speeds, speeds):  # type: ignore[no-untyped-def]
    """Fills the reading of this step into `kept` and `kept_speeds` (npush x nsteps + 1 x njoint), and the `speeds`
    (njoint) of the joints.
    """
    angle_noise, speed_noise = noise
    speed_sensor, encoder_step, offsets, weights = sensors
    count = weights.shape[0]
    for i in range(speeds.shape[0]):
        angle = chain.qpos[i] + offsets[i] + angle_noise[push, step, i]
        if encoder_step > 0.0:
            angle = np.floor(angle / encoder_step + 0.5) * encoder_step
        kept[push, step, i] = angle
        if speed_sensor:
            speeds[i] = chain.qvel[i] + speed_noise[push, step, i]
        elif step + 1 >= count:
            speeds[i] = 0.0
            for k in range(count):
                speeds[i] += weights[k] * kept[push, step + 1 - count + k, i]
        else:
            speeds[i] = expected[push, 1, i]
        kept_speeds[push, step, i] = speeds[i]


@compiled
def _run(chain, starts, laws, noise, sensors, drives, settings, work, outputs, windows, readings):  # type: ignore[no-untyped-def]
    """All pushes of an episode; returns control steps run and whether a link fell. Fills the four (npush x njoint)
    `outputs` and the `readings` of angles and of speeds, or what stands for these (npush x nsteps + 1 x njoint each).

    `starts`: joint angles and speeds (npush x 2 x njoint) right after each push, true and as calibrated. `laws` are
    those of one candidate (see `batch.Laws`). `work`: the links as the sensors read them, three
    vectors (njoint), whether the push is a joint's first crossing (njoint), and the commands under way (delay + 1 x
    njoint). Nothing is allocated here.
    """
    half_periods, span, speed_energy, acceleration_energy = outputs
    start, expected = starts
    kept, kept_speeds = readings
    gravity, coriolis, damping, coulomb, inertia, springs = laws
    angle_noise, speed_noise, torque_noise = noise
    control_every, limits, gains = drives
    timestep, steps, limit, margin, largest_turn, runaway, ends, deadband, lead = settings
    motion, window_half_periods = windows
    read, joint_speeds, previous, command, crosses, commands = work
    npush, n = start.shape[0], start.shape[2]
    slots = commands.shape[0]
    period = timestep * control_every
    ran = 0
    for push in range(npush):
        for i in range(n):
            half_periods[push, i], span[push, i], speed_energy[push, i], acceleration_energy[push, i] = 0, 0.0, 0.0, 0.0
    for push in range(npush):
        stiffness = springs[push]
        law = gravity[0], coriolis[0], damping[0], coulomb[0], inertia[0], stiffness
        forget(chain)
        for i in range(n):
            chain.qpos[i], chain.qvel[i] = start[push, 0, i], start[push, 1, i]
            for slot in range(slots):
                commands[slot, i] = 0.0
        pushed, fastest, turn, fallen, step = 0.0, 0.0, largest_turn, False, 0
        window, end = 0, ends[0] if ends.shape[0] > 0 else 0
        while True:
            _read(chain, expected, (angle_noise, speed_noise), push, step, sensors, kept, kept_speeds, joint_speeds)
            angle, speed = 0.0, 0.0
            for i in range(n):
                v, v0 = joint_speeds[i], previous[i]
                angle += kept[push, step, i]
                speed += v
                read[i].angle = angle + lead * speed
                read[i].speed = speed
                if step == 0:
                    pushed = max(pushed, abs(speed))
                    crosses[i] = start[push, 0, i] + sensors[2][i] == 0.0 and v != 0.0
                else:
                    speed_energy[push, i] += 0.5 * period * (v0 * v0 + v * v)
                    jump = v - v0 + period * stiffness * kept[push, step - 1, i]  # Eq. 14
                    acceleration_energy[push, i] += jump * jump / period
                    if has_fallen(angle, speed, fastest, period, limit, turn):
                        fallen = True
                previous[i] = v
            if step == 0:
                fastest = margin * pushed
                if runaway * pushed * period < turn:
                    turn = runaway * pushed * period  # Eq. 9
            if step == end and step > 0 and not fallen:
                for i in range(n):
                    motion[push, window, 0, i] = kept[push, step, i]
                    motion[push, window, 1, i] = joint_speeds[i]
                    motion[push, window, 2, i] = speed_energy[push, i]
                    motion[push, window, 3, i] = acceleration_energy[push, i]
                    crossed, _ = _crossings(kept, push, step, i, crosses[i], period, deadband)
                    window_half_periods[push, window, i] = crossed
                window += 1
                end = ends[window] if window < ends.shape[0] else 0
            if fallen or step == steps:
                break
            turn_to_angles(read, stiffness)
            compensate(law, read, joint_speeds, command)
            for i in range(n):
                commands[step % slots, i] = command[i]
                delivered = min(max(commands[(step + 1) % slots, i], -limits[i]), limits[i])
                chain.torque[i] = gains[i] * delivered + torque_noise[push, step, i]
            for _ in range(control_every):
                step_plant(chain)
            step += 1
            ran += 1
        for i in range(n):
            half_periods[push, i], span[push, i] = _crossings(kept, push, step, i, crosses[i], period, deadband)
        if fallen:
            return ran, True
    return ran, False


@compiled
def _crossings(kept, push, steps, joint, crosses, period, deadband):  # type: ignore[no-untyped-def]
    """Half periods of one joint and the time they took, in s, as `episode.crossings` has them."""
    half_periods, first, last, seen, angle = 0, 0.0, 0.0, -1, 0.0
    begun = crosses
    for step in range(steps + 1):
        reading = kept[push, step, joint]
        if not abs(reading) > deadband:
            continue
        if seen >= 0 and (reading > 0.0) != (angle > 0.0):
            time = period * (step - reading / (reading - angle) * (step - seen))
            if begun:
                half_periods += 1
                last = time
            else:
                begun, first, last = True, time, time
        seen, angle = step, reading
    return half_periods, last - first


class FaultyLoop(WholeEpisodes):
    """An episode on one plant with faults, compiled, by the given `step`; holds buffers, so one per thread."""

    def __init__(self, plant: MujocoPlant, episode: Episode, step: Step) -> None:
        self.plant = FaultyPlant(plant)
        self.episode = episode = with_deadband(episode, self.plant)
        self.step = step
        faults, njoint = self.plant.faults, plant.njoint
        self._expected = start_states(plant, episode.starts)
        offsets, weights = faults.encoder_offsets(njoint), slope_weights(self.plant.timestep)
        self._sensors = faults.speed_sensor, faults.encoder_step, offsets, weights
        self._drives = faults.control_every, faults.torque_limits(njoint), faults.torque_gains(njoint)
        ends = np.array(episode.window_ends, dtype=np.int64)
        rule, readings = episode.fall_rule.clauses, (episode.deadband, episode.lead)
        self._settings = plant.timestep, episode.steps, *rule, ends, *readings
        vectors = np.empty(njoint), np.empty(njoint), np.empty(njoint), np.empty(njoint, np.bool_)
        self._work = np.zeros(njoint, LINK), *vectors, np.empty((faults.delay + 1, njoint))

    def run(self, candidate: Lumps, number: int = 0, goes_on: GoesOn | None = None) -> Record:
        """The episode of the trial of that `number` with the `candidate` lumps; `goes_on` is asked after each push."""
        episode, plant = self.episode, self.plant.inner
        noise, shape = noise_of(self.plant, episode, number), episode.pushes.shape
        struck = replace(episode, pushes=episode.pushes * (1.0 + noise.impulses))
        outputs = np.zeros(shape, dtype=np.int64), np.zeros(shape), np.zeros(shape), np.zeros(shape)
        motion, crossed = (output[0] for output in new_windows(episode, 1))
        angles, speeds = np.empty((2, shape[0], episode.steps + 1, shape[1]))
        with quiet_mujoco():
            steps, fell = _run(
                self.step,
                (start_states(plant, struck.starts), self._expected),
                laws_of(episode, plant.gravity, candidate[None]),
                (noise.angles, noise.speeds, noise.torques),
                self._sensors,
                self._drives,
                self._settings,
                self._work,
                outputs,
                (motion, crossed),
                (angles, speeds),
            )
        ran = np.clip(steps - episode.steps * np.arange(shape[0]), 0, episode.steps)
        begun = np.count_nonzero(ran)
        falls = fell & (np.arange(shape[0]) == begun - 1)
        motions = [(angles[push, : end + 1], speeds[push, : end + 1]) for push, end in enumerate(ran[:begun])]
        kept = tuple(each for each, _ in motions) if episode.keep_angles else ()
        windows = None
        if episode.window_ends:
            windows = windows_before_fall(np.array(episode.window_ends), motion, crossed, ran, falls)
        readings = None
        if episode.readings_steps:
            sensed = self.plant.faults.speed_sensor
            readings = readings_before_fall(motions, episode.readings_steps, falls, sensed)
        floor = episode.noise_floor.energy
        record = Record(self.plant.timestep, ran, falls, *outputs, kept, floor, windows, readings)
        return record.stopped_early(goes_on)

    def on(self, episode: Episode) -> FaultyLoop:
        """The same for another `episode`."""
        return FaultyLoop(self.plant.inner, episode, self.step)
