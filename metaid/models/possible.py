"""Which chains a plant file may describe: those that can exist, and that its timestep can follow. Which of them are so
strange that their units are asked for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from metaid.errors import PlantError
from metaid.models.chain import Chain
from metaid.models.lumps import Array

LEAST_GYRATION = 1e-3  # of a link's length: a radius of gyration below it is no body's, but a point's
LEAST_MASS_EIGENVALUE = 1e-10  # of the mass matrix with a unit diagonal; below it rounding decides how the chain moves
MIN_STEPS_PER_RADIAN = 5.0  # of a chain's fastest mode: in fewer steps its motion is not simulated but guessed
# What is not beyond doubt, in SI units; a rod of steel that weighs HEAVIEST a metre is as thick as a thigh.
SHORTEST, LONGEST = 1e-3, 20.0  # m of a link
LIGHTEST, HEAVIEST = 1e-4, 300.0  # kg of a metre of a link
WEAKEST, STRONGEST = 0.1, 30.0  # m/s² of gravity


def least_inertia(mass: float, length: float) -> float:
    """The least inertia about its centre of mass, in kg m², that a link of that `mass` (kg) and `length` (m) has."""
    return mass * (LEAST_GYRATION * length) ** 2


def refuse_impossible(name: str, chain: Chain) -> None:
    """Raises PlantError where the mass matrix (Eq. 4) of the upright chain is singular, or all but singular."""
    root = np.sqrt(chain.inertia_lumps)
    scaled = chain.mass_matrix(np.zeros(chain.nlink)) / np.outer(root, root)
    if not np.linalg.eigvalsh(scaled)[0] > LEAST_MASS_EIGENVALUE:
        raise PlantError(
            f"{name}: masses and lengths differ so much from link to link that the mass matrix is singular "
            "(allowed: links that each have a share in the motion)"
        )


def refuse_too_long_a_step(name: str, chain: Chain, gravity: float, timestep: float) -> None:
    """Refuses a timestep that cannot follow the chain.

    Args:
        name: of the plant, for the message.
        chain: whose motion is simulated.
        gravity: in m/s².
        timestep: of the simulation, in s.

    Raises:
        PlantError: steps are too long for the chain's fastest mode, over-compensated by all of gravity, or overshoot
            what its joints damp in one.
    """
    joints = np.eye(chain.nlink) - np.eye(chain.nlink, k=-1)  # joint angles from absolute ones
    stiffness = np.diag(gravity * chain.lumps.gravity) + joints.T @ np.diag(chain.stiffness) @ joints
    damping = joints.T @ np.diag(chain.damping) @ joints
    masses = chain.mass_matrix(np.zeros(chain.nlink))
    fastest = float(np.sqrt(np.linalg.eigvals(np.linalg.solve(masses, stiffness)).real.max()))
    quickest = float(np.linalg.eigvals(np.linalg.solve(masses, damping)).real.max())
    rate = max(fastest * MIN_STEPS_PER_RADIAN, quickest)
    if not rate * timestep <= 1.0:
        what = f"the damping of its joints, {quickest:.3g}/s" if rate == quickest else f"{fastest:.3g} rad/s"
        raise PlantError(
            f"{name}: timestep {timestep} s is too long for its fastest motion, {what} "
            f"(allowed: at most {1 / rate:.2g} s)"
        )


def question_of_units(name: str, chain: Chain, gravity: float) -> str | None:
    """What to ask whoever wrote down a chain that can be, but hardly is, in one line; None if nothing.

    Args:
        name: of the model, for the question.
        chain: that is described.
        gravity: in m/s².
    """
    for link, (length, mass) in enumerate(zip(chain.length.tolist(), chain.mass.tolist(), strict=True), start=1):
        if not (SHORTEST <= length <= LONGEST and LIGHTEST <= mass / length <= HEAVIEST):
            return f"{name}: link {link} is {length:g} m long and weighs {mass:g} kg: is that meant? (in m and kg)"
    if not WEAKEST <= gravity <= STRONGEST:
        return f"{name}: gravity is {gravity:g} m/s²: is that meant?"
    return None


def question_of_distances(name: str, joints: Sequence[str], distances: Array) -> str | None:
    """The same of an arm, whose joints are as far from the one before (njoint), in m; that of the first is its place in
    the world.
    """
    for joint, distance in list(zip(joints, distances.tolist(), strict=True))[1:]:
        if distance > LONGEST:
            return f"{name}: joint {joint} is {distance:g} m from the one before: is that meant? (in m)"
    return None
