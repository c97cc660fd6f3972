"""For how long a plant coasts after a push: an episode whose joint speeds are looked at step by step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from metaid.episode import Episode, FallRule, arm_episode
from metaid.models import Array, Lumps
from metaid.models.tree import Tree, kinetic_squares
from metaid.plant import ArmPlant, ArmStart, MujocoPlant

COASTING = 0.1  # speeds changed by more than this share of what they were are no longer coasting
WITHOUT_FALLS = FallRule(limit=np.inf)


def coasting_steps(plant: MujocoPlant, lumps: Lumps, impulses: Array, steps: int) -> int:
    """For how many steps a chain coasts after a push: until a joint's speed has changed by a tenth of the speed of the
    fastest link after the push.

    Args:
        plant: it is pushed from rest upright.
        lumps: of the law that compensates it.
        impulses: of the push (njoint), in N s.
        steps: after which it is no longer watched, the most that are returned.
    """
    from metaid.compiled import CompiledLoop  # loads numba

    loop = CompiledLoop(plant, Episode(impulses[None], steps, WITHOUT_FALLS, keep_angles=True))
    angles, pushed = loop.run(lumps).angles[0], plant.start_speeds(loop.episode.starts[0])
    speeds = np.diff(angles, axis=0) / plant.timestep  # MuJoCo turns a joint by the speed that a step leads to
    changes = np.abs(speeds - pushed).max(axis=1)
    return _steps_before(changes <= COASTING * np.abs(np.cumsum(pushed)).max())


def arm_coasting_steps(
    plant: ArmPlant, laws: tuple[Array, Tree], starts: Sequence[ArmStart], steps: int
) -> NDArray[np.int64]:
    """For how many steps an arm coasts after each push (npush), whatever the ranges of its joints: until its speeds
    have changed by a tenth of those at the start in a metric.

    Args:
        plant: that moves.
        laws: parameters (njoint x 13) of the arm whose bias torque it is sent, and the arm whose mass matrix is the
            metric.
        starts: from where, one push after another.
        steps: after which a push is no longer watched, the most that are returned.
    """
    from metaid.compiled.spatial import ArmLoop  # loads numba

    law, metric = laws
    unbounded = np.full(plant.njoint, np.inf)
    endless = replace(metric, low=-unbounded, high=unbounded)
    episode = arm_episode(endless, starts, np.zeros(len(starts)), steps, fall_rule=WITHOUT_FALLS, readings_steps=steps)
    seen = ArmLoop(plant, episode).run(law).readings
    assert seen is not None
    assert seen.speeds is not None
    coasted = np.zeros(len(starts), dtype=np.int64)
    for push, count in enumerate(seen.counts):
        angles, speeds = seen.angles[push, 1:count], seen.speeds[push, 1:count]
        pushed = np.broadcast_to(starts[push].speeds, speeds.shape)
        with np.errstate(over="ignore", invalid="ignore"):  # an arm may run away as far as it likes
            changed, whole = (kinetic_squares(metric, angles, each) for each in (speeds - pushed, pushed))
        coasted[push] = _steps_before(changed <= COASTING**2 * whole)
    return coasted


def _steps_before(coasts: NDArray[np.bool_]) -> int:
    """The steps before the first after which it no longer `coasts` (nsteps)."""
    return len(coasts) if coasts.all() else int(coasts.argmin())
