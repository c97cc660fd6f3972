"""Episodes on a plant with faults, compiled. Plants without faults have a loop of their own (`kernel`), which none of
this slows down.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.compiled.batch import laws_of, new_windows
from metaid.compiled.decorator import compiled
from metaid.compiled.kernel import Step, advance, look
from metaid.compiled.law import LINK, compensate, turn_to_angles
from metaid.episode import (
    Episode,
    Record,
    StepwiseLoop,
    Trajectory,
    run_stepwise,
    same_record,
    window_ends,
    windows_before_fall,
)
from metaid.models import Lumps
from metaid.plant import FaultyPlant, MujocoPlant, Noise, draw, slope_weights, stream

RESTING = 1000  # readings of the plant at rest, which tell how far noise alone can throw one

DEADBAND = 5.0  # of their standard deviation: a reading so near the upright tells no side


@compiled
def _read(chain, expected, noise, push, step, sensors, kept, speeds):  # type: ignore[no-untyped-def]
    """Fills the reading of this step into `kept` (nsteps + 1 x njoint), and the joint `speeds` (njoint)."""
    angle_noise, speed_noise = noise
    speed_sensor, encoder_step, weights = sensors
    count = weights.shape[0]
    for i in range(speeds.shape[0]):
        angle = chain.qpos[i] + angle_noise[push, step, i]
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
            speeds[i] = expected[push, i]


@compiled
def _run(chain, starts, laws, noise, sensors, drives, settings, work, outputs, windows, kept):  # type: ignore[no-untyped-def]
    """All pushes of an episode; returns control steps run and whether a link fell. Fills the four (npush x njoint)
    `outputs` and `kept` (npush x nsteps + 1 x njoint), the angle readings.

    `laws` are those of one candidate (see `batch.Laws`); `work`: the links as they are `told` to the law and as they
    move, four vectors (njoint), the commands under way (delay + 1 x njoint). Nothing is allocated here.
    """
    half_periods, span, speed_energy, acceleration_energy = outputs
    start, expected = starts
    gravity, coriolis, damping, coulomb, inertia, stiffness = laws
    law = gravity[0], coriolis[0], damping[0], coulomb[0], inertia[0], stiffness
    angle_noise, speed_noise, torque_noise = noise
    control_every, limits, tilt = drives
    timestep, steps, limit, margin, ends, deadband, lead = settings
    motion, window_half_periods = windows
    told, moving, joint_speeds, previous, first, command, commands = work
    npush, n = start.shape
    slots = commands.shape[0]
    period = timestep * control_every
    ran = 0
    for push in range(npush):
        for i in range(n):
            half_periods[push, i], span[push, i], speed_energy[push, i], acceleration_energy[push, i] = 0, 0.0, 0.0, 0.0
    for push in range(npush):
        for i in range(n):
            chain.qpos[i], chain.qvel[i] = 0.0, start[push, i]
            for slot in range(slots):
                commands[slot, i] = 0.0
        fastest, fallen, step = 0.0, False, 0
        window, end = 0, ends[0] if ends.shape[0] > 0 else 0
        while True:
            _read(chain, expected, (angle_noise, speed_noise), push, step, sensors, kept, joint_speeds)
            angle, speed = 0.0, 0.0
            for i in range(n):
                v, v0 = joint_speeds[i], previous[i]
                angle += kept[push, step, i]
                speed += v
                told[i].angle = angle + lead * speed
                told[i].speed = speed
                if step == 0:
                    fastest, first[i] = max(fastest, margin * abs(speed)), v
                else:
                    speed_energy[push, i] += 0.5 * period * (v0 * v0 + v * v)
                    jump = v - v0 + period * stiffness * kept[push, step - 1, i]  # Eq. 17
                    acceleration_energy[push, i] += jump * jump / period
                    # Eq. 8, and what the simulation cannot follow; written so that NaN counts as fallen.
                    if not (abs(angle) <= limit or abs(speed) <= fastest) or not abs(chain.qvel[i]) * timestep <= 1.0:
                        fallen = True
                previous[i] = v
            if step == end and step > 0 and not fallen:
                for i in range(n):
                    motion[push, window, 0, i] = kept[push, step, i]
                    motion[push, window, 1, i] = joint_speeds[i]
                    motion[push, window, 2, i] = speed_energy[push, i]
                    motion[push, window, 3, i] = acceleration_energy[push, i]
                    crossed, _ = _crossings(kept, push, step, i, first[i], period, deadband)
                    window_half_periods[push, window, i] = crossed
                window += 1
                end = ends[window] if window < ends.shape[0] else 0
            if fallen or step == steps:
                break
            turn_to_angles(told, stiffness)
            compensate(law, told, joint_speeds, command)
            for i in range(n):
                commands[step % slots, i] = command[i]
                delivered = min(max(commands[(step + 1) % slots, i], -limits[i]), limits[i])
                chain.torque[i] = delivered + torque_noise[push, step, i]
            for _ in range(control_every):
                angle, speed = tilt, 0.0
                for i in range(n):
                    angle += chain.qpos[i]
                    speed += chain.qvel[i]
                    moving[i].angle = angle
                    moving[i].speed = speed
                look(chain, moving, stiffness)  # type: ignore[no-untyped-call]
                advance(chain, moving)  # type: ignore[no-untyped-call]
            step += 1
            ran += 1
        for i in range(n):
            half_periods[push, i], span[push, i] = _crossings(kept, push, step, i, first[i], period, deadband)
        if fallen:
            return ran, True
    return ran, False


@compiled
def _crossings(kept, push, steps, joint, start_speed, period, deadband):  # type: ignore[no-untyped-def]
    """Half periods of one joint and the time they took, in s, as `episode.crossings` has them."""
    half_periods, first, last, seen, angle = 0, 0.0, 0.0, -1, 0.0
    begun = start_speed != 0.0
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


class FaultyLoop(StepwiseLoop):
    """An episode on one plant with faults: compiled, with the given `step`, or in plain Python with None; holds
    buffers, so one per thread.
    """

    plant: FaultyPlant

    def __init__(self, plant: MujocoPlant, episode: Episode, step: Step | None) -> None:
        faulty = FaultyPlant(plant)
        deadband = DEADBAND * float(faulty.rest(RESTING, episode.seed).std())
        super().__init__(faulty, replace(episode, deadband=deadband))
        self.step = step
        faults, njoint = faulty.faults, plant.njoint
        self._expected = np.array([plant.start_speeds(impulses) for impulses in episode.pushes])
        self._sensors = faults.speed_sensor, faults.encoder_step, slope_weights(faulty.timestep)
        self._drives = faults.control_every, faults.torque_limits(njoint), faults.tilt
        self._settings = (
            plant.timestep,
            episode.steps,
            episode.fall_limit,
            episode.fall_margin,
            np.array(episode.window_ends, dtype=np.int64),
            deadband,
            episode.lead,
        )
        told, moving = np.zeros(njoint, LINK), np.zeros(njoint, LINK)
        self._work = told, moving, *(np.empty(njoint) for _ in range(4)), np.empty((faults.delay + 1, njoint))

    def run(self, candidate: Lumps) -> Record:
        if self.step is None:
            return self.run_stepwise(candidate)[0]
        noise, plant, shape = self._noise(candidate), self.plant.inner, self.episode.pushes.shape
        struck = self.episode.pushes * (1.0 + noise.impulses)
        start = np.array([plant.start_speeds(impulses) for impulses in struck])
        outputs = np.zeros(shape, dtype=np.int64), np.zeros(shape), np.zeros(shape), np.zeros(shape)
        motion, crossed = (output[0] for output in new_windows(self.episode, 1))
        readings = np.empty((shape[0], self.episode.steps + 1, shape[1]))
        steps, fell = _run(
            self.step,
            (start, self._expected),
            laws_of(self.episode, plant.gravity, candidate[None]),
            (noise.angles, noise.speeds, noise.torques),
            self._sensors,
            self._drives,
            self._settings,
            self._work,
            outputs,
            (motion, crossed),
            readings,
        )
        ran = [min(steps - begun, self.episode.steps) for begun in range(0, steps, self.episode.steps)]
        kept = tuple(push[: end + 1] for push, end in zip(readings, ran, strict=False))
        period, floor = self.plant.timestep, self.episode.noise_floor.energy
        windows = None
        if self.episode.window_ends:
            windows = windows_before_fall(np.array(self.episode.window_ends), motion, crossed, ran, fell)
        angles = kept if self.episode.keep_angles else ()
        return Record(period, steps, steps if fell else None, *outputs, angles, floor, windows)

    def run_stepwise(self, candidate: Lumps) -> tuple[Record, Trajectory]:
        """The same episode in the plain loop: the reference. The motion is what the sensors read of it."""
        self.plant.begin(self._noise(candidate))
        return run_stepwise(self.plant, candidate, self.episode)

    def agrees_with_stepwise(self, candidate: Lumps, steps: int = 25) -> bool:
        """Whether a short episode comes out the same in the compiled and in the plain loop."""
        steps = min(steps, self.episode.steps)
        short = replace(self.episode, pushes=self.episode.pushes[:1], steps=steps, window_ends=window_ends(steps))
        episode = FaultyLoop(self.plant.inner, short, self.step)
        return same_record(episode.run(candidate), episode.run_stepwise(candidate)[0])

    def _noise(self, candidate: Lumps) -> Noise:
        npush, njoint = self.episode.pushes.shape
        random = stream(self.episode.seed, candidate)
        return draw(self.plant.faults, random, npush, self.episode.steps, njoint)
