"""A planar chain's own equations of motion in a few scalar loops, for models that are simulated many times over.

A step is one of the classical Runge-Kutta method: a rig moves continuously while its torque is held.
"""

from __future__ import annotations

from typing import NamedTuple

from metaid.compiled import compiled
from metaid.compiled.law import turn_to_angles
from metaid.models import Array


class AnalyticStep(NamedTuple):
    """What the compiled loop steps: joint state and torque, the chain's lumps (`gravity` in N m), working space."""

    qpos: Array
    qvel: Array
    torque: Array
    gravity: Array
    coriolis: Array
    inertia: Array
    damping: Array
    mass: Array
    acceleration: Array
    timestep: float


@compiled
def place(chain, links, tilt):  # type: ignore[no-untyped-def]
    """Turns the `links` to where an `AnalyticStep` is, on a base that leans by a `tilt` in rad."""
    angle, speed = tilt, 0.0
    for i in range(links.shape[0]):
        angle += chain.qpos[i]
        speed += chain.qvel[i]
        links[i].angle = angle
        links[i].speed = speed
    turn_to_angles(links, 0.0)


@compiled
def flow_analytically(chain, links, tilt, stages):  # type: ignore[no-untyped-def]
    """One timestep of Runge and Kutta's of an `AnalyticStep`; `stages` (4 x njoint) is working space."""
    n, timestep = links.shape[0], chain.timestep
    for i in range(n):
        stages[0, i], stages[1, i] = chain.qpos[i], chain.qvel[i]
        stages[2, i] = stages[3, i] = 0.0
    for stage in range(4):
        place(chain, links, tilt)
        accelerate_analytically(chain, links)
        weight = timestep / 6.0 if stage == 0 or stage == 3 else timestep / 3.0
        ahead, below = timestep if stage == 2 else 0.5 * timestep, 0.0
        for i in range(n):
            rate, change = chain.qvel[i], chain.acceleration[i] - below
            below = chain.acceleration[i]
            stages[2, i] += weight * rate
            stages[3, i] += weight * change
            chain.qpos[i], chain.qvel[i] = stages[0, i] + ahead * rate, stages[1, i] + ahead * change
    for i in range(n):
        chain.qpos[i], chain.qvel[i] = stages[0, i] + stages[2, i], stages[1, i] + stages[3, i]


@compiled
def accelerate_analytically(chain, links):  # type: ignore[no-untyped-def]
    """Fills in absolute accelerations, given the `links`' speeds, cosines and sines.

    Solves M φ̈ = Q − Σ_j a_ij sin(φ_i − φ_j) φ̇_j² + g μ_i sin φ_i (Eq. 4), Q the joint torques less viscous
    friction, by M = L D Lᵀ: the factors of M take the place of its lower half.
    """
    _, qvel, torque, gravity, coriolis, inertia, damping, mass, acceleration, _ = chain
    n = qvel.shape[0]
    for i in range(n):
        cosine, sine = links[i].cosine, links[i].sine
        force = torque[i] - damping[i] * qvel[i] + gravity[i] * sine
        if i + 1 < n:
            force -= torque[i + 1] - damping[i + 1] * qvel[i + 1]
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
