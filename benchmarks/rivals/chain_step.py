"""A planar chain's own equations of motion in a few scalar loops, for rigs that are simulated many times over.

The step is MuJoCo's: semi-implicit Euler with the torque of its beginning.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from metaid.compiled import compiled
from metaid.models import Array, Chain


class AnalyticStep(NamedTuple):
    """What the compiled loop steps: joint state and torque, the chain's lumps (`gravity` in N m), working space."""

    qpos: Array
    qvel: Array
    torque: Array
    gravity: Array
    coriolis: Array
    inertia: Array
    damping: Array
    stiffness: Array
    mass: Array
    acceleration: Array
    timestep: float


def analytic_step(chain: Chain, gravity: float, timestep: float) -> AnalyticStep:
    """A `chain` at rest upright; `gravity` in m/s², `timestep` in s."""
    n, lumps = chain.nlink, chain.lumps
    state = np.zeros(n), np.zeros(n), np.zeros(n)
    weights = gravity * lumps.gravity, lumps.coriolis, chain.inertia_lumps
    return AnalyticStep(
        *state, *weights, chain.damping.copy(), chain.stiffness.copy(), np.zeros((n, n)), np.zeros(n), timestep
    )


@compiled
def advance_analytically(chain, links):  # type: ignore[no-untyped-def]
    """One timestep of an `AnalyticStep`, given its `links`' speeds, cosines and sines.

    Solves M φ̈ = Q − Σ_j a_ij sin(φ_i − φ_j) φ̇_j² + g μ_i sin φ_i (Eq. 4), Q the joint torques less viscous friction
    and springs, by M = L D Lᵀ: the factors of M take the place of its lower half.
    """
    qpos, qvel, torque, gravity, coriolis, inertia, damping, stiffness, mass, acceleration, timestep = chain
    n = qpos.shape[0]
    for i in range(n):
        cosine, sine = links[i].cosine, links[i].sine
        force = torque[i] - damping[i] * qvel[i] - stiffness[i] * qpos[i] + gravity[i] * sine
        if i + 1 < n:
            force -= torque[i + 1] - damping[i + 1] * qvel[i + 1] - stiffness[i + 1] * qpos[i + 1]
        for j in range(n):
            centrifugal = coriolis[i, j] * links[j].speed * links[j].speed
            force -= centrifugal * (sine * links[j].cosine - cosine * links[j].sine)
        mass[i, i] = inertia[i]
        for j in range(i):
            mass[i, j] = coriolis[i, j] * (cosine * links[j].cosine + sine * links[j].sine)
            for k in range(j):
                mass[i, j] -= mass[i, k] * mass[j, k] * mass[k, k]
            mass[i, j] /= mass[j, j]
            force -= mass[i, j] * acceleration[j]
            mass[i, i] -= mass[i, j] * mass[i, j] * mass[j, j]
        acceleration[i] = force
    for i in range(n - 1, -1, -1):
        acceleration[i] /= mass[i, i]
        for k in range(i + 1, n):
            acceleration[i] -= mass[k, i] * acceleration[k]
    below = 0.0
    for i in range(n):
        qvel[i] += timestep * (acceleration[i] - below)
        qpos[i] += timestep * qvel[i]
        below = acceleration[i]
