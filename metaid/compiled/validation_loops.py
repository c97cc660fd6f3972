"""The loop of a validation of a chain, compiled: computed torque along a motion."""

from __future__ import annotations

import numpy as np

from metaid.compiled.decorator import compiled
from metaid.compiled.law import LINK, compensate, place_links
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.stages import advance, fastest_step, look
from metaid.models import Array, Lumps
from metaid.plant import MujocoPlant, Start


def track_compiled(
    plant: MujocoPlant,
    laws: tuple[Lumps, Lumps],
    inertias: tuple[Array, Array],
    desired: tuple[Array, Array, Array],
    bandwidth: float,
    lost: float,
) -> tuple[Array, Array, Array]:
    """Drives a plant from rest upright along a motion with computed torque.

    Args:
        plant: it is brought to rest upright first.
        laws: lumps of the feedforward's model, and of the feedback's.
        inertias: the inertia lumps (nlink) of the two, in kg m².
        desired: joint angles in rad, speeds in rad/s and accelerations in rad/s², each (nsteps x njoint).
        bandwidth: of the feedback, in rad/s.
        lost: the error of a joint angle, in rad, beyond which control is lost.

    Returns:
        Joint angles, speeds and torques (nseen x njoint), up to where control was lost.
    """
    chain, links = fastest_step(plant), np.zeros(plant.njoint, LINK)
    models = tuple((np.array(lumps.coriolis), np.array(d)) for lumps, d in zip(laws, inertias, strict=True))
    seen = np.zeros((3, *desired[0].shape))
    plant.push(Start.upright(np.zeros(plant.njoint)))
    motion = np.ascontiguousarray(desired[0]), np.ascontiguousarray(desired[1]), np.ascontiguousarray(desired[2])
    work = np.zeros((3, plant.njoint))
    with quiet_mujoco():
        count = _track(chain, _law(plant, laws[0]), models, links, motion, bandwidth, lost, work, seen)
    angles, speeds, torques = seen[:, :count]
    return angles, speeds, torques


def _law(plant: MujocoPlant, lumps: Lumps) -> tuple[Array, Array, Array, Array, Array, float]:
    """What `compensate` takes: copies, all of one layout."""
    damping, coulomb, inertia = (np.array(lumps.of(kind)) for kind in ("damping", "coulomb", "inertia"))
    return np.array(plant.gravity * lumps.gravity), np.array(lumps.coriolis), damping, coulomb, inertia, 0.0


@compiled
def _track(chain, law, models, links, motion, bandwidth, lost, work, seen):  # type: ignore[no-untyped-def]
    """Fills `seen` (3 x nsteps x njoint) with angles, speeds and torques; returns the steps before control was lost.

    τ = M̃(φ) q̈_d + h̃ + g̃ + M̄(φ) (k_p e + k_d ė), the `models` being those of M̃ and M̄. `work` (3 x njoint) is space.
    """
    angles, speeds, accelerations = motion
    (coriolis, inertia), (feedback_coriolis, feedback_inertia) = models
    wanted, corrected, torque = work[0], work[1], work[2]
    n = links.shape[0]
    for step in range(angles.shape[0]):
        for i in range(n):
            if not abs(chain.qpos[i] - angles[step, i]) <= lost:
                return step
        place_links(chain.qpos, chain.qvel, links)
        look(chain, links, 0.0)
        compensate(law, links, chain.qvel, torque)
        acceleration, correction = 0.0, 0.0  # absolute, in rad/s²
        for i in range(n):
            error, rate = angles[step, i] - chain.qpos[i], speeds[step, i] - chain.qvel[i]
            acceleration += accelerations[step, i]
            correction += bandwidth * bandwidth * error + 2.0 * bandwidth * rate
            wanted[i], corrected[i] = acceleration, correction
        carried = 0.0
        for i in range(n - 1, -1, -1):
            carried += inertia[i] * wanted[i] + feedback_inertia[i] * corrected[i]  # Eq. 4
            for j in range(n):
                cosine = links[i].cosine * links[j].cosine + links[i].sine * links[j].sine
                carried += cosine * (coriolis[i, j] * wanted[j] + feedback_coriolis[i, j] * corrected[j])
            torque[i] += carried  # Eq. 6
        for i in range(n):
            seen[0, step, i], seen[1, step, i], seen[2, step, i] = chain.qpos[i], chain.qvel[i], torque[i]
            chain.torque[i] = torque[i]
        advance(chain)
    return angles.shape[0]
