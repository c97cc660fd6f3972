"""The episode as one compiled function around MuJoCo's own `mj_step`, which releases the GIL.

It does what `episode.run_plain` does, at nearly the speed of bare `mj_step`. Model and data are reached by their
addresses, which MuJoCo does not promise; `CompiledEpisode.agrees_with_plain` compares the two loops on a short
episode before anything is believed.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import llvmlite.binding
import mujoco
import numpy as np
from numba import cfunc, njit, types

from metaid.chain import Array, Lumps
from metaid.episode import Episode, Record, run_plain
from metaid.plant import MujocoPlant

_mj_step = types.ExternalFunction("mj_step", types.void(types.uintp, types.uintp))
llvmlite.binding.load_library_permanently(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))


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


@njit(nogil=True, cache=True)
def _compensate(gravity, coriolis, angles, speeds, sines, cosines, torque):  # type: ignore[no-untyped-def]
    """Joint torques from candidate lumps.  Eqs. 5 and 6, with sin(φ_i − φ_j) expanded so that each angle needs one
    sine and cosine.
    """
    n = angles.shape[0]
    for i in range(n):
        sines[i], cosines[i] = np.sin(angles[i]), np.cos(angles[i])
    carried = 0.0
    for i in range(n - 1, -1, -1):
        cosine_sum, sine_sum = 0.0, 0.0
        for j in range(n):
            pull = coriolis[i, j] * speeds[j] * speeds[j]
            cosine_sum += pull * cosines[j]
            sine_sum += pull * sines[j]
        carried += sines[i] * cosine_sum - cosines[i] * sine_sum - gravity[i] * sines[i]  # Eq. 5
        torque[i] = carried  # Eq. 6


@njit(nogil=True, cache=True)
def _run(  # type: ignore[no-untyped-def]
    model,
    data,
    qpos,
    qvel,
    torque,
    start,
    gravity,
    coriolis,
    timestep,
    steps,
    limit,
    margin,
    half_periods,
    span,
    speed_energy,
    acceleration_energy,
):
    """All pushes of an episode; fills the four (npush x njoint) outputs; returns steps run and whether a link fell."""
    npush, n = start.shape
    angles, speeds, sines, cosines, side, first = (
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
    )
    previous_angle, previous_speed = np.empty(n), np.empty(n)
    ran = 0
    for push in range(npush):
        fastest, angle, speed = 0.0, 0.0, 0.0
        for i in range(n):
            qpos[i], qvel[i] = 0.0, start[push, i]
            side[i], first[i] = np.sign(start[push, i]), 0.0
            speed += start[push, i]
            angles[i], speeds[i] = 0.0, speed
            previous_angle[i], previous_speed[i] = 0.0, start[push, i]
            fastest = max(fastest, abs(speed))
            half_periods[push, i], span[push, i], speed_energy[push, i], acceleration_energy[push, i] = 0, 0.0, 0.0, 0.0
        fastest *= margin
        for step in range(1, steps + 1):
            _compensate(gravity, coriolis, angles, speeds, sines, cosines, torque)
            _mj_step(model, data)
            ran += 1
            angle, speed, fallen = 0.0, 0.0, False
            for i in range(n):
                q, v, v0 = qpos[i], qvel[i], previous_speed[i]
                angle += q
                speed += v
                angles[i], speeds[i] = angle, speed
                speed_energy[push, i] += 0.5 * (v0 * v0 + v * v)
                acceleration_energy[push, i] += (v - v0) * (v - v0)
                if q * side[i] < 0.0:
                    time = timestep * (step - q / (q - previous_angle[i]))
                    if half_periods[push, i] == 0 and start[push, i] == 0.0 and first[i] == 0.0:
                        first[i] = time
                    else:
                        half_periods[push, i] += 1
                        span[push, i] = time - first[i]
                    side[i] = -side[i]
                elif side[i] == 0.0:
                    side[i] = np.sign(q)
                previous_angle[i], previous_speed[i] = q, v
                # Eq. 8, written so that NaN counts as fallen; beyond a radian a step nothing is simulated any more.
                if not (abs(angle) <= limit or abs(speed) <= fastest) or not abs(speed) * timestep <= 1.0:
                    fallen = True
            if fallen:
                return ran, True
        for i in range(n):
            speed_energy[push, i] *= timestep
            acceleration_energy[push, i] /= timestep
    return ran, False


class CompiledEpisode:
    """An episode on one MuJoCo plant, compiled; holds buffers, so one per thread."""

    def __init__(self, plant: MujocoPlant, episode: Episode) -> None:
        _quiet_mujoco()
        self.plant = plant
        self.episode = episode
        self._start = np.array([plant.start_speeds(impulses) for impulses in episode.pushes])
        shape = episode.pushes.shape
        self._outputs: tuple[Any, ...] = (
            np.zeros(shape, dtype=np.int64),
            np.zeros(shape),
            np.zeros(shape),
            np.zeros(shape),
        )

    def run(self, candidate: Lumps) -> Record:
        """One episode with the `candidate` lumps. The record's arrays are overwritten by the next run."""
        plant, data, episode = self.plant, self.plant.data, self.episode
        steps, fell = _run(
            plant.model._address,
            data._address,
            data.qpos,
            data.qvel,
            data.qfrc_applied,
            self._start,
            plant.gravity * candidate.gravity,
            candidate.coriolis,
            plant.timestep,
            episode.steps,
            episode.fall_limit,
            episode.fall_margin,
            *self._outputs,
        )
        return Record(plant.timestep, steps, steps if fell else None, *self._outputs)

    def agrees_with_plain(self, candidate: Lumps, steps: int = 25) -> bool:
        """Whether a short episode comes out the same in the compiled and in the plain loop."""
        short = Episode(
            self.episode.pushes[:1], min(steps, self.episode.steps), self.episode.fall_limit, self.episode.fall_margin
        )
        compiled = CompiledEpisode(self.plant, short).run(candidate)
        plain, _ = run_plain(self.plant, candidate, short)
        return (
            compiled.fall_step == plain.fall_step
            and bool((compiled.half_periods == plain.half_periods).all())
            and _same(compiled.speed_energy, plain.speed_energy)
            and _same(compiled.acceleration_energy, plain.acceleration_energy)
        )


def _same(one: Array, other: Array) -> bool:
    return bool(np.allclose(one, other, rtol=1e-6, atol=1e-9))
