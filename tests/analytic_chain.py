"""Equations of motion of a planar chain, written independently of metaid: from positions, not from lumps."""

from __future__ import annotations

import numpy as np

from metaid.models import Array, Chain


def jacobians(chain: Chain, angles: Array) -> tuple[Array, Array]:
    """∂(x, z)/∂φ of every centre of mass (nlink x 2 x nlink), and its second derivative's diagonal ∂²(x, z)/∂φ²."""
    n = chain.nlink
    first, second = np.zeros((n, 2, n)), np.zeros((n, 2, n))
    for body in range(n):
        for link in range(body + 1):
            lever = chain.com[body] if link == body else chain.length[link]
            first[body, :, link] = lever * np.array([np.cos(angles[link]), -np.sin(angles[link])])
            second[body, :, link] = lever * np.array([-np.sin(angles[link]), -np.cos(angles[link])])
    return first, second


def acceleration(chain: Chain, gravity: float, angles: Array, speeds: Array, joint_torque: Array) -> Array:
    """φ̈ (nlink) from Newton's law for every body, projected on the angles."""
    first, second = jacobians(chain, angles)
    mass_matrix = np.einsum("b,bci,bcj->ij", chain.mass, first, first) + np.diag(chain.inertia)
    centripetal = second @ speeds**2
    weight = np.array([0.0, -gravity])
    force = np.einsum("b,bci,bc->i", chain.mass, first, weight - centripetal)
    generalised = joint_torque - np.append(joint_torque[1:], 0.0)  # a motor pushes its own link and pulls the one below
    return np.linalg.solve(mass_matrix, force + generalised)


def simulate(
    chain: Chain, gravity: float, timestep: float, steps: int, speeds: Array, law, start: Array | float = 0.0
) -> Array:  # type: ignore[no-untyped-def]
    """Joint angles (steps + 1 x nlink) from absolute angles `start` and `speeds`; `law(q, q̇)` is the joint torque.

    Semi-implicit Euler, as in MuJoCo.
    """
    angles = np.zeros(chain.nlink) + start
    history = [angles]
    for _ in range(steps):
        torque = law(np.diff(angles, prepend=0.0), np.diff(speeds, prepend=0.0))
        speeds = speeds + timestep * acceleration(chain, gravity, angles, speeds, torque)
        angles = angles + timestep * speeds
        history.append(angles)
    return np.diff(np.array(history), axis=1, prepend=0.0)
