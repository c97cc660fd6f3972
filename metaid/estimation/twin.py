"""The twin: a chain of given lumps under the laws of past trials, push by push, on several threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from metaid.compiled import compiled
from metaid.estimation.driven import watch_readings
from metaid.estimation.motion import watch_push
from metaid.estimation.trials import Coefficients, Driven, Joints, WatchedTrial
from metaid.estimation.unknowns import Unknowns
from metaid.estimation.workspace import balance, derivatives, workspace
from metaid.models import Array

THREADED = 200_000  # multiplications; threads do not pay for less
NOTHING_ELSE = np.empty((0, 0, 0))  # forces beside the law


@dataclass(frozen=True)
class Motion:
    """What the twin shows of one trial.

    `angles`, `speeds`, `speed_energy` and `acceleration_energy` are those of `Windows` (npush x nwindow x njoint). The
    derivatives of the last three by the unknowns are (npush x nwindow x njoint x nunknown). `reached` (npush) is how
    many windows of each push the twin got through.
    """

    angles: Array
    speeds: Array
    speed_energy: Array
    acceleration_energy: Array
    speed_slopes: Array
    speed_energy_slopes: Array
    acceleration_energy_slopes: Array
    reached: NDArray[np.int64]


def simulate(
    trial: WatchedTrial, unknowns: Unknowns, log_factors: Array, gravity: float, windows: int, energies: bool = False
) -> Motion:
    """The first windows of a trial, on another chain under the same law.

    Args:
        trial: the law, the start speeds and the windows.
        unknowns: what is unknown of the chain.
        log_factors: of the unknowns (nunknown).
        gravity: in m/s².
        windows: how many of each push to simulate, from the shortest on.
        energies: whether these are differentiated, too; else their derivatives are empty.
    """
    lumps = unknowns.lumps(log_factors)
    npush, n = trial.start_speeds.shape
    nunknown = len(log_factors)
    shape = npush, windows, n
    shown = np.empty(shape), np.empty(shape), np.empty(shape), np.empty(shape)
    of_energies = *shape, nunknown * energies
    slopes = np.empty((*shape, nunknown)), np.empty(of_energies), np.empty(of_energies)
    reached = np.zeros(npush, dtype=np.int64)
    ends = np.ascontiguousarray(trial.ends[:windows])
    forces = balance(trial.law, lumps, gravity, trial.stiffness), derivatives(unknowns, lumps, gravity)
    common = NOTHING_ELSE, *forces, (trial.timestep, energies), ends
    seen = shown, slopes, reached

    def run(first: int, stride: int) -> None:
        _watch_pushes(first, stride, trial.starts, *common, workspace(n, nunknown, energies), *seen)

    share_out(run, npush, npush * int(ends[-1]) * 2 * n * n * nunknown)
    return Motion(*shown, *slopes, reached)


def drive(
    driven: Driven, unknowns: Unknowns, log_factors: Array, gravity: float, joints: Joints | None = None
) -> Coefficients | None:
    """The twin of a noisy trial, `driven` by what was commanded; None where it cannot follow.

    Args:
        driven: the trial.
        unknowns: what is unknown of the chain.
        log_factors: where it is (nunknown).
        gravity: in m/s².
        joints: what they have beside the lumps; None for nothing.
    """
    trial, starts, steps, basis = driven
    lumps = unknowns.lumps(log_factors)
    npush, _, n = starts.shape
    extra = 0 if trial.start_spread is None else trial.start_spread.shape[-1]
    columns = len(log_factors) + extra
    values, slopes = np.empty((npush, n, basis.shape[2])), np.empty((npush, n, basis.shape[2], columns))
    followed = np.zeros(npush, dtype=np.bool_)
    forces = (
        balance(None, lumps, gravity, joints=joints, is_continuous=trial.is_continuous),
        derivatives(unknowns, lumps, gravity),
    )
    settings = len(log_factors), extra, trial.substeps, trial.is_continuous

    def run(first: int, stride: int) -> None:
        room = workspace(n, columns, False, trial.is_continuous)
        for push in range(first, npush, stride):
            pushed, moving = (starts[push], trial.forces[push]), (trial.timesteps[push], *settings)
            shown = basis[push], steps[push], room, values[push], slopes[push]
            followed[push] = watch_readings(*pushed, *forces, moving, *shown)

    share_out(run, npush, int(steps.sum()) * trial.substeps * n * (2 * n + basis.shape[2]) * columns)
    return Coefficients(values, slopes) if followed.all() else None


def share_out(run: Callable[[int, int], None], npush: int, multiplications: int) -> None:
    """Runs every `stride`-th push from each of `stride` firsts on a thread of its own, if that many multiplications
    are worth it.
    """
    threads = min(threads_at_hand(), npush) if multiplications > THREADED else 1
    waiting = [_pool().submit(run, first, threads) for first in range(1, threads)]
    run(0, threads)
    for one in waiting:
        one.result()


@compiled
def _watch_pushes(first, stride, starts, forces, balance, derivatives, settings, ends, work, shown, slopes, reached):  # type: ignore[no-untyped-def]
    """Every `stride`-th push from the `first` on."""
    angles, speeds, speed_energy, acceleration_energy = shown
    by_speed, by_speed_energy, by_acceleration_energy = slopes
    for push in range(first, starts.shape[0], stride):
        force = forces[push] if forces.shape[0] > 0 else forces[:, :, 0]
        seen = angles[push], speeds[push], speed_energy[push], acceleration_energy[push]
        seen_slopes = by_speed[push], by_speed_energy[push], by_acceleration_energy[push]
        reached[push] = watch_push(starts[push], force, balance, derivatives, settings, ends, work, seen, seen_slopes)


def threads_at_hand() -> int:
    """As many threads as the process may use processors."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(threads_at_hand() - 1, 1), thread_name_prefix="twin")


if hasattr(os, "register_at_fork"):  # a forked process has the pool and none of its threads: it would wait for ever
    os.register_at_fork(after_in_child=_pool.cache_clear)
