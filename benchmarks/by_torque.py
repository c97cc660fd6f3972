"""A chain's equations of motion, linear in its lumps, and least squares by recorded torques."""

from __future__ import annotations

import numpy as np

from benchmarks.chains import Links
from benchmarks.recording import Recording
from metaid.models import Array
from metaid.plant import chain_of


def inverse_dynamics_regressor(angles: Array, speeds: Array, accelerations: Array, gravity: float) -> Array:
    """Joint torque per unit of each lump (nsample x nlink x nlump + nlink): gravity and Coriolis lumps in the order of
    `lump_names`, then inertia lumps.

    Joint `angles` (rad), `speeds` (rad/s), `accelerations` (rad/s²), all (nsample x nlink); `gravity` in m/s².  Eqs. 4
    and 6 of docs/method.md, which are linear in the lumps.
    """
    phi, rate, second_rate = (np.cumsum(signal, axis=1) for signal in (angles, speeds, accelerations))
    nsample, n = phi.shape
    first, second = np.triu_indices(n, 1)
    links, pairs = np.arange(n), n + np.arange(len(first))
    force = np.zeros((nsample, n, n + len(first) + n))
    force[:, links, links] = -gravity * np.sin(phi)
    sine, cosine = np.sin(phi[:, first] - phi[:, second]), np.cos(phi[:, first] - phi[:, second])
    force[:, first, pairs] = cosine * second_rate[:, second] + sine * rate[:, second] ** 2
    force[:, second, pairs] = cosine * second_rate[:, first] - sine * rate[:, first] ** 2
    force[:, links, n + len(first) + links] = second_rate
    torque: Array = np.cumsum(force[:, ::-1], axis=1)[:, ::-1]
    return torque


def least_squares(seen: Recording, nominal: Links, gravity: float) -> tuple[Array, Array]:
    """Gravity and Coriolis lumps (nlump), and inertia lumps (nlink), that explain the torques best.  The nominal model
    only scales the columns.
    """
    believed = chain_of(nominal)
    scale = np.append(believed.lumps.vector, believed.inertia_lumps)
    n = believed.nlink
    angles, speeds, accelerations = (signal.reshape(-1, n) for signal in (seen.angles, seen.speeds, seen.accelerations))
    regressor = inverse_dynamics_regressor(angles, speeds, accelerations, gravity).reshape(-1, len(scale)) * scale
    solution = np.linalg.lstsq(regressor, seen.torques.ravel())[0] * scale
    return solution[:-n], solution[-n:]
