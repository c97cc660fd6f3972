"""A chain's equations of motion, linear in its lumps."""

from __future__ import annotations

import numpy as np

from metaid.models import Array


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
