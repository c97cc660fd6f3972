"""The simulated twin of a robot, as what is compared sees it; and the threads that its pushes share."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from metaid.estimation.trials import Coefficients, Driven, Filtered, Gains, Joints, WatchedTrial
from metaid.models import Array

# What a filter finds, by the standard deviation of the noise of each joint's torque (njoint), in N m or N.
Led = Callable[[Array], Gains]

THREADED = 200_000  # multiplications; threads do not pay for less


@dataclass(frozen=True)
class Motion:
    """What the twin shows of one trial on exact sensors.

    Attributes:
        speeds: of the joints at the ends of windows (npush x nwindow x njoint).
        speed_slopes: their derivatives by the unknowns (npush x nwindow x njoint x nunknown).
        speed_energy: ∫ q̇² dt of each joint up to there (npush x nwindow x njoint), where it is asked for.
        acceleration_energy: ∫ (q̈ + k q)² dt, likewise.
        speed_energy_slopes: derivatives of the first (npush x nwindow x njoint x nunknown).
        acceleration_energy_slopes: of the second.
        reached: how many windows of each push the twin got through (npush).
    """

    speeds: Array
    speed_slopes: Array
    speed_energy: Array
    acceleration_energy: Array
    speed_energy_slopes: Array
    acceleration_energy_slopes: Array
    reached: NDArray[np.int64]


class Twin(Protocol):
    """A robot with some unknowns, simulated. The derivatives of what it shows are by these."""

    def watch(self, trial: WatchedTrial, windows: int, /, energies: bool = False) -> Motion:
        """The first so many `windows` of each push of a trial, under the same law; with `energies` and their
        derivatives, where it has them.
        """

    def trace(self, trial: WatchedTrial, steps: NDArray[np.int64], /) -> tuple[Array, NDArray[np.bool_]]:
        """Joint coordinates after so many `steps` of each push of a trial (npush x nsteps x njoint), under the same
        law, and whether the push was seen so far and the twin got there (npush x nsteps).
        """

    def drive(self, driven: Driven, joints: Joints | None, /, led: Gains | None = None) -> Coefficients | None:
        """What it shows of a noisy trial, driven by what was commanded; None where it cannot follow.

        Args:
            driven: the trial.
            joints: what they have beside the parameters; None for nothing.
            led: gains of a filter that sets it right by the readings. The coefficients are then those of the whitened
                innovations.
        """

    def lead(self, filtered: Filtered, joints: Joints | None, /) -> Led:
        """A filter through some pushes of a trial (Eq. 35), with what `joints` have beside the parameters."""


def share_out(run: Callable[[int, int], None], npush: int, multiplications: int) -> None:
    """Runs every `stride`-th push from each of `stride` firsts on a thread of its own, if that many multiplications
    are worth it.
    """
    threads = min(threads_at_hand(), npush) if multiplications > THREADED else 1
    waiting = [_pool().submit(run, first, threads) for first in range(1, threads)]
    run(0, threads)
    for one in waiting:
        one.result()


def threads_at_hand() -> int:
    """As many threads as the process may use processors."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(threads_at_hand() - 1, 1), thread_name_prefix="twin")


if hasattr(os, "register_at_fork"):  # a forked process has the pool and none of its threads: it would wait for ever
    os.register_at_fork(after_in_child=_pool.cache_clear)
