"""The episode as one compiled function that releases the GIL and allocates nothing.

It does what `episode.run_plain` does, at the speed of its step: MuJoCo's own `mj_step`, the same from MuJoCo's stages
(`pipeline`), or the analytic equations of motion (`analytic`). Model and data are reached by their addresses, which
MuJoCo does not promise; `CompiledEpisode.agrees_with_plain` compares the two loops on a short episode before anything
is believed.
"""

from __future__ import annotations

import functools

import mujoco
import numpy as np
from numba import cfunc
from numba.extending import overload

from metaid.analytic import AnalyticStep, advance_analytically, analytic_step
from metaid.batch import Batch, new_batch
from metaid.chain import SLIDING, Array, Lumps
from metaid.compiled import compiled
from metaid.episode import Episode, Record, run_plain
from metaid.pipeline import (
    DirectStep,
    MujocoStep,
    advance_directly,
    agrees_with_mj_step,
    direct_step,
    mj_step,
    mujoco_step,
)
from metaid.plant import MujocoPlant
from metaid.queue import take

Step = MujocoStep | DirectStep | AnalyticStep


@cfunc("float64()")
def _no_time() -> float:
    return 0.0


@cfunc("void(uintp)")
def _no_warning(_message: int) -> None:
    return


@functools.cache
def _quiet_mujoco() -> None:
    """Takes out the bindings' timer, half of all the time at three links, and the log file of warnings: a diverged
    episode is a fall.
    """
    mujoco.set_mjcb_time(_no_time.ctypes)
    mujoco.set_mju_user_warning(_no_warning.ctypes)


def advance(chain, speeds, sines, cosines):  # type: ignore[no-untyped-def]
    """One timestep of any `Step`; which one is settled when the loop is compiled."""
    raise NotImplementedError


@overload(advance, inline="always")
def _advance_of(chain, speeds, sines, cosines):  # type: ignore[no-untyped-def]
    kind = chain.instance_class
    if kind is MujocoStep:
        return lambda chain, speeds, sines, cosines: mj_step(chain.model, chain.data)
    if kind is DirectStep:
        return lambda chain, speeds, sines, cosines: advance_directly(chain)
    return lambda chain, speeds, sines, cosines: advance_analytically(chain, speeds, sines, cosines)


@compiled
def compensate(law, angles, speeds, qvel, work, torque):  # type: ignore[no-untyped-def]
    """Joint torques of a `law` (see `batch.Laws`).  Eqs. 5, 6, 15 and 16, with sin(φ_i − φ_j) and cos(φ_i − φ_j)
    expanded so that each angle needs one sine and cosine.

    The sums over j run outside, so that the links i are independent of each other within them.
    """
    gravity, coriolis, damping, coulomb, inertia, stiffness = law
    n = angles.shape[0]
    sines, cosines, sine_sums, cosine_sums = work
    for i in range(n):
        sines[i], cosines[i] = np.sin(angles[i]), np.cos(angles[i])
        sine_sums[i], cosine_sums[i] = 0.0, 0.0
    for j in range(n):
        squared = speeds[j] * speeds[j]
        pulled = stiffness * angles[j]
        sine, cosine = squared * sines[j] + pulled * cosines[j], squared * cosines[j] - pulled * sines[j]
        for i in range(n):
            sine_sums[i] += coriolis[j, i] * sine
            cosine_sums[i] += coriolis[j, i] * cosine
    carried = 0.0
    for i in range(n - 1, -1, -1):
        carried += sines[i] * (cosine_sums[i] - gravity[i]) - cosines[i] * sine_sums[i]  # Eq. 5, and 16 but for d
        carried -= stiffness * inertia[i] * angles[i]
        sliding = min(max(qvel[i] / SLIDING, -1.0), 1.0)
        torque[i] = carried + damping[i] * qvel[i] + coulomb[i] * sliding  # Eqs. 6 and 15


@compiled
def _run_push(chain, start, law, settings, work, outputs, kept):  # type: ignore[no-untyped-def]
    """One push of an episode, which gives the joints the speeds `start` (njoint): steps run, and whether a link fell.

    Fills the four (njoint) `outputs`, and `kept` (nsteps + 1 x njoint) with joint angles unless it is empty. `work` are
    twelve vectors (njoint); nothing is allocated here.
    """
    timestep, steps, limit, margin = settings
    half_periods, span, speed_energy, acceleration_energy = outputs
    angles, speeds, side, first, previous_angle, previous_speed, squares, jumps = work[4:]
    qpos, qvel, torque = chain.qpos, chain.qvel, chain.torque
    n = start.shape[0]
    pull = timestep * law[-1]
    fastest, angle, speed, ran, fallen = 0.0, 0.0, 0.0, 0, False
    keep = kept.size > 0
    for i in range(n):
        qpos[i], qvel[i] = 0.0, start[i]
        side[i], first[i] = np.sign(start[i]), 0.0
        speed += start[i]
        angles[i], speeds[i] = 0.0, speed
        previous_angle[i], previous_speed[i] = 0.0, start[i]
        squares[i], jumps[i] = 0.0, 0.0
        half_periods[i], span[i] = 0, 0.0
        fastest = max(fastest, abs(speed))
    fastest *= margin
    for step in range(1, steps + 1):
        compensate(law, angles, speeds, qvel, work[:4], torque)
        advance(chain, speeds, work[0], work[1])  # type: ignore[no-untyped-call]
        ran = step
        angle, speed = 0.0, 0.0
        for i in range(n):
            q, v, v0 = qpos[i], qvel[i], previous_speed[i]
            angle += q
            speed += v
            angles[i], speeds[i] = angle, speed
            squares[i] += 0.5 * (v0 * v0 + v * v)
            jump = v - v0 + pull * previous_angle[i]  # Eq. 17: what the step did beyond q̈ = −k q
            jumps[i] += jump * jump
            if q * side[i] < 0.0:
                time = timestep * (step - q / (q - previous_angle[i]))
                if half_periods[i] == 0 and start[i] == 0.0 and first[i] == 0.0:
                    first[i] = time
                else:
                    half_periods[i] += 1
                    span[i] = time - first[i]
                side[i] = -side[i]
            elif side[i] == 0.0:
                side[i] = np.sign(q)
            previous_angle[i], previous_speed[i] = q, v
            # Eq. 8, written so that NaN counts as fallen; beyond a radian a step nothing is simulated any more.
            if not (abs(angle) <= limit or abs(speed) <= fastest) or not abs(speed) * timestep <= 1.0:
                fallen = True
        if keep:
            for i in range(n):
                kept[step, i] = qpos[i]
        if fallen:
            break
    for i in range(n):
        speed_energy[i] = squares[i] * timestep
        acceleration_energy[i] = jumps[i] / timestep
    return ran, fallen


@compiled
def _run_from(chain, start, queue, laws, settings, work, ran, fell, outputs, kept):  # type: ignore[no-untyped-def]
    """Takes pushes of a `Batch` from its `queue` until there are none left; those of a candidate that is known to have
    fallen after an earlier one are left out. `start` are the joint speeds (npush x njoint) after each.
    """
    gravity, coriolis, damping, coulomb, inertia, stiffness = laws
    half_periods, span, speed_energy, acceleration_energy = outputs
    npush = start.shape[0]
    turn = take(queue)
    while turn < gravity.shape[0] * npush:
        candidate, push = turn // npush, turn % npush
        fallen = False
        for earlier in range(push):
            fallen = fallen or fell[candidate, earlier]
        if not fallen:
            seen = (
                half_periods[candidate, push],
                span[candidate, push],
                speed_energy[candidate, push],
                acceleration_energy[candidate, push],
            )
            angles = kept[candidate, push] if kept.size > 0 else kept[:, :, 0, 0]
            friction = damping[candidate], coulomb[candidate]
            law = gravity[candidate], coriolis[candidate], *friction, inertia[candidate], stiffness
            result = _run_push(chain, start[push], law, settings, work, seen, angles)
            ran[candidate, push], fell[candidate, push] = result
        turn = take(queue)


def fastest_step(plant: MujocoPlant, physics: str = "mujoco") -> Step:
    """How the compiled loop moves `plant` on: its analytic equations, or MuJoCo's stages one by one, or `mj_step` where
    these are not the same to the last bit.
    """
    _quiet_mujoco()
    if physics == "analytic":
        return analytic_step(plant.chain, plant.felt_gravity, plant.timestep)
    make = direct_step if agrees_with_mj_step(plant.model, plant.data) else mujoco_step
    return make(plant.model, plant.data)


class CompiledEpisode:
    """An episode on one plant, compiled, by the given `step` or the fastest for MuJoCo; holds buffers, so one per
    thread.
    """

    def __init__(self, plant: MujocoPlant, episode: Episode, step: Step | None = None) -> None:
        _quiet_mujoco()
        self.plant = plant
        self.episode = episode
        self.step = fastest_step(plant) if step is None else step
        self._start = np.array([plant.start_speeds(impulses) for impulses in episode.pushes])
        self._settings = plant.timestep, episode.steps, episode.fall_limit, episode.fall_margin
        self._work = tuple(np.empty(plant.njoint) for _ in range(12))

    def new_batch(self, candidates: Lumps) -> Batch:
        """A batch of `candidates`, lumps with a leading axis (ncandidate), for this and its like to work on."""
        return new_batch(self.episode, self.plant.timestep, self.plant.gravity, candidates)

    def work_on(self, batch: Batch) -> None:
        """Runs pushes of the `batch` until there are none left; others may do so at the same time."""
        results = batch.ran, batch.fell, batch.outputs, batch.angles
        _run_from(self.step, self._start, batch.queue, batch.laws, self._settings, self._work, *results)

    def run(self, candidate: Lumps) -> Record:
        """One episode with the `candidate` lumps."""
        batch = self.new_batch(candidate[None])
        self.work_on(batch)
        return batch.records()[0]

    def agrees_with_plain(self, candidate: Lumps, steps: int = 25) -> bool:
        """Whether a short episode comes out the same in the compiled and in the plain loop."""
        short = Episode(
            self.episode.pushes[:1],
            min(steps, self.episode.steps),
            self.episode.fall_limit,
            self.episode.fall_margin,
            stiffness=self.episode.stiffness,
        )
        compiled = CompiledEpisode(self.plant, short, self.step).run(candidate)
        plain, _ = run_plain(self.plant, candidate, short)
        return same_record(compiled, plain)


def same_record(compiled: Record, plain: Record) -> bool:
    """Whether two loops saw the same, but for rounding."""
    return (
        compiled.fall_step == plain.fall_step
        and bool((compiled.half_periods == plain.half_periods).all())
        and _same(compiled.speed_energy, plain.speed_energy)
        and _same(compiled.acceleration_energy, plain.acceleration_energy)
    )


def _same(one: Array, other: Array) -> bool:
    return bool(np.allclose(one, other, rtol=1e-6, atol=1e-9))
