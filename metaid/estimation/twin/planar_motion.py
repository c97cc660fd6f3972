"""The motion of a planar chain, compiled, and what it follows from.

In absolute angles φ and speeds ω (nlink), with the law's lumps less the chain's (tilde less none), Eq. 4 is

    M α = F,    F_i = Σ_j (ã − a)_ij sin(φ_i − φ_j) ω_j² − g (μ̃ − μ)_i sin φ_i + f_i − f_{i+1} + Q_i    (22)

f_k is what is left of the friction in joint k, with the torque of a spring there, and Q a force that is known
beforehand. Where link i leans by λ_i when its angle is 0, sines and cosines are of φ_i + λ_i.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from metaid.compiled import compiled, factorise, solve
from metaid.estimation.log_unknowns import Columns
from metaid.estimation.twin.joints import joint_force
from metaid.estimation.twin.workspace import Beside
from metaid.models import Array


class PlanarBalance(NamedTuple):
    """What the motion of Eq. 22 follows from, for n links.

    `gravity` (n) times g, in N m, `coriolis` (n x n), `damping` and `coulomb` (n) are the law's lumps less the chain's.
    `spring` (n) is minus the stiffness of a spring in each joint, in N m/rad, and `lean` (n) the true absolute angle,
    in rad, of each link whose angle is read as 0. `straight` (n) is what each joint reads, in rad, where it is
    straight. `dry` (n) is dry friction in N m that builds up over `presliding` rad, in steps of Runge and Kutta alone;
    none does where that is 0. `cogging` (3 x n) is that of `Joints`. `mass_coriolis` (n x n) and `mass_inertia` (n) are
    the chain's own, with the inertia of its rotors; `rotor` (n), in kg m², is what that of joint i takes off between
    links i − 1 and i. `law_coriolis` and `law_inertia` are the law's, which ask for q̈ = −`stiffness` q.
    """

    gravity: Array
    coriolis: Array
    damping: Array
    coulomb: Array
    spring: Array
    lean: Array
    straight: Array
    dry: Array
    presliding: float
    cogging: Array
    mass_coriolis: Array
    mass_inertia: Array
    rotor: Array
    law_coriolis: Array
    law_inertia: Array
    stiffness: float


class PlanarDerivatives(NamedTuple):
    """The derivative of each lump by the log factor of what it is a multiple of, `gravity` times g; the `columns` of
    these; and what is unknown `beside` them.
    """

    gravity: Array
    coriolis: Array
    inertia: Array
    damping: Array
    coulomb: Array
    columns: Columns
    beside: Beside


class PlanarSpace(NamedTuple):
    """What a planar kernel works in: `cosine` and `sine` of the true angles (n); `factor` (n x n), L and D of
    M = L D Lᵀ.
    """

    cosine: Array
    sine: Array
    factor: Array


@compiled
def accelerate(balance, work):  # type: ignore[no-untyped-def]
    """Fills in α of Eq. 22 and the factors of M; whether M is positive definite."""
    angle, cosine, sine = work.angle, work.own.cosine, work.own.sine
    for i in range(angle.shape[0]):
        true_angle = angle[i] + balance.lean[i]
        cosine[i], sine[i] = np.cos(true_angle), np.sin(true_angle)
    _force(balance, work)
    return _solve(balance, work)


@compiled
def _force(balance, work):  # type: ignore[no-untyped-def]
    """Fills `acceleration` with F of Eq. 22."""
    angle, speed, force, cosine, sine = work.angle, work.speed, work.acceleration, work.own.cosine, work.own.sine
    n, stiffness = angle.shape[0], balance.stiffness
    carried = 0.0  # the torque in the joint above, from the tip down
    for i in range(n - 1, -1, -1):
        own = joint_force(i, balance, work)
        force[i] = own - carried - balance.gravity[i] * sine[i] - stiffness * balance.law_inertia[i] * angle[i]
        force[i] += work.force[i]
        carried = own
        for j in range(n):
            difference = sine[i] * cosine[j] - cosine[i] * sine[j]
            force[i] += balance.coriolis[i, j] * difference * speed[j] * speed[j]
            if stiffness != 0.0:
                common = cosine[i] * cosine[j] + sine[i] * sine[j]
                force[i] -= stiffness * balance.law_coriolis[i, j] * common * angle[j]


@compiled
def _solve(balance, work):  # type: ignore[no-untyped-def]
    """Turns F into α = M⁻¹ F; False where M is not positive definite."""
    cosine, sine, factor = work.own.cosine, work.own.sine, work.own.factor
    for i in range(factor.shape[0]):
        for j in range(i):
            factor[i, j] = balance.mass_coriolis[i, j] * (cosine[i] * cosine[j] + sine[i] * sine[j])
        factor[i, i] = 0.0
        if i > 0:
            factor[i, i - 1] -= balance.rotor[i]
    if not factorise(factor, balance.mass_inertia, factor):
        return False
    solve(factor, work.acceleration)
    return True
