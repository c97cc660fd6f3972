"""What the compiled loops of the twin are given, and what they work in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from metaid.estimation.log_unknowns import Columns, LogUnknowns
from metaid.estimation.trials import NOTHING_FURTHER, Further, Joints
from metaid.models import Array, Lumps

BLOCK = 4  # rows and columns that are multiplied at once, held in registers
LANES = 8  # numbers in one instruction, at most
# What joints have that is unknown, in this order: of dry friction also the way over which it builds up.
KINDS = ("viscous", "dry", "spring", "cosine", "sine", "rotor", "straight", "lean", "presliding")


class Balance(NamedTuple):
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


class Beside(NamedTuple):
    """What each unknown beside the lumps has, for n links: `torques` (ntorque x nstep x n) of a push, in N m, those of
    the first of them; `by_kind` (n x KINDS x nother) and `lean` (n x nother) those of the others: how much of each kind
    a joint has, and the true absolute angle of a link. The first has the column `first`.
    """

    torques: Array
    by_kind: Array
    lean: Array
    first: int


class Derivatives(NamedTuple):
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


class Workspace(NamedTuple):
    """What one thread works in, for n links and p unknowns; rows and columns beyond are zero.

    The state: `angle`, `speed`, `acceleration`, `cosine`, `sine` (n), absolute. `speed_energy` and
    `acceleration_energy` (n) of the joints so far. `factors` (n x n): L and D of M = L D Lᵀ. `solved` (n x 3 n):
    M⁻¹ [1 G H]. `closed` (n x 2 n): the last two of these. `pulls` (2 n x n): see `tangent`. `moved` (2 n x p): δφ
    above δω. `changed` (n x p): δα. `speed_slopes`, `acceleration_slopes` (n x p): derivatives of the energies.
    `stages` (4 x n): of a Runge-Kutta step the state before it, angles and speeds, and what it adds to them; `held` and
    `added` (2 n x p): the same of the derivatives. `slip` (3 x n): of dry friction that builds up, its share of all of
    it before the step, where the joint was then, in rad, and the share now; `slipped` (n x p): derivatives of the
    first. `units` (KINDS) and `turning` (p): of one joint, see `beside`.
    """

    angle: Array
    speed: Array
    acceleration: Array
    cosine: Array
    sine: Array
    speed_energy: Array
    acceleration_energy: Array
    factors: Array
    solved: Array
    closed: Array
    pulls: Array
    moved: Array
    changed: Array
    speed_slopes: Array
    acceleration_slopes: Array
    stages: Array
    held: Array
    added: Array
    slip: Array
    slipped: Array
    units: Array
    turning: Array


def balance(
    law: Lumps | None,
    lumps: Lumps,
    gravity: float,
    stiffness: float = 0.0,
    joints: Joints | None = None,
    is_continuous: bool = False,
    rubs: bool = False,
) -> Balance:
    """What the motion of a chain under a law follows from.

    Args:
        law: the lumps of the law; without one only the chain's own forces act.
        lumps: of the chain.
        gravity: in m/s².
        stiffness: of the law, in 1/s².
        joints: what they have beside the lumps; None for nothing.
        is_continuous: whether the twin takes Runge-Kutta steps.
        rubs: whether dry friction of the joints builds up in these, if there is none yet.
    """
    if joints is None:
        none = np.zeros(lumps.nlink)
        joints = Joints(none, none, none, none, np.zeros(1), none, np.zeros(1), np.zeros((3, lumps.nlink)))
    if law is None:
        law = Lumps(np.zeros(lumps.nlink), np.zeros((lumps.nlink, lumps.nlink)))
    return Balance(
        gravity=gravity * (law.gravity - lumps.gravity),
        coriolis=law.coriolis - lumps.coriolis,
        damping=law.of("damping") - lumps.of("damping") - joints.viscous,
        coulomb=law.of("coulomb") - lumps.of("coulomb") - (0.0 if is_continuous else 1.0) * joints.dry,
        spring=0.0 - joints.spring,
        lean=joints.tilt[0] - np.cumsum(joints.offset),  # what reads too much leans the other way.  Eq. 43
        straight=np.array(joints.offset),
        dry=(1.0 if is_continuous else 0.0) * joints.dry,
        presliding=float(joints.presliding[0]) if is_continuous and (rubs or bool(joints.dry.any())) else 0.0,
        cogging=np.array(joints.cogging),
        mass_coriolis=np.array(lumps.coriolis),
        mass_inertia=lumps.of("inertia") + joints.rotor + np.append(joints.rotor[1:], 0.0),
        rotor=np.array(joints.rotor),
        law_coriolis=np.array(law.coriolis),
        law_inertia=np.array(law.of("inertia")),
        stiffness=float(stiffness),
    )


def derivatives(unknowns: LogUnknowns, lumps: Lumps, further: Further = NOTHING_FURTHER) -> Derivatives:
    """Those of the `lumps` by the `unknowns`: of what is a multiple of a parameter, by the logarithm of that, it is
    itself. And those by what is `further` unknown, whose torques are those of the first push.
    """
    return Derivatives(
        gravity=unknowns.gravity * lumps.gravity,
        coriolis=np.array(lumps.coriolis),
        inertia=np.array(lumps.of("inertia")),
        damping=np.array(lumps.of("damping")),
        coulomb=np.array(lumps.of("coulomb")),
        columns=unknowns.columns,
        beside=_beside(further, lumps.nlink, len(unknowns.names)),
    )


def _beside(further: Further, nlink: int, first: int) -> Beside:
    """What is `further` unknown, from the column `first` on."""
    joints = further.joints
    if joints is None:
        return Beside(further.torques_of(0, nlink), np.zeros((nlink, len(KINDS), 0)), np.zeros((nlink, 0)), first)
    lean = joints.tilt[:, :1] - np.cumsum(joints.offset, axis=-1)  # Eq. 43
    presliding = np.repeat(joints.presliding, nlink, axis=1)
    kinds = joints.viscous, joints.dry, joints.spring, *joints.cogging.swapaxes(0, 1)[:2], joints.rotor, joints.offset
    each = np.array([*kinds, np.diff(lean, axis=-1, prepend=0.0), presliding])
    by_kind = np.ascontiguousarray(each.transpose(2, 0, 1))
    return Beside(further.torques_of(0, nlink), by_kind, np.ascontiguousarray(lean.T), first)


def workspace(nlink: int, nunknown: int, energies: bool, is_continuous: bool = False) -> Workspace:
    """Working space for a twin.

    Args:
        nlink: the number of links.
        nunknown: the number of unknowns.
        energies: whether their derivatives are kept, too.
        is_continuous: whether it takes Runge-Kutta steps.
    """
    rows, inner, columns = _up(nlink, BLOCK), _up(2 * nlink, BLOCK), _up(nunknown, LANES)
    shape = nlink * energies, columns
    angle, speed, acceleration, cosine, sine, moving, accelerated = (np.zeros(nlink) for _ in range(7))
    return Workspace(
        angle,
        speed,
        acceleration,
        cosine,
        sine,
        moving,
        accelerated,
        np.zeros((nlink, nlink)),
        np.zeros((nlink, 3 * nlink)),
        np.zeros((rows, inner)),
        np.zeros((2 * nlink, nlink)),
        np.zeros((inner, columns)),
        np.zeros((rows, columns)),
        np.zeros(shape),
        np.zeros(shape),
        np.zeros((4, nlink)),
        np.zeros((inner, columns * is_continuous)),
        np.zeros((inner, columns * is_continuous)),
        np.zeros((3, nlink)),
        np.zeros((nlink, columns * is_continuous)),
        np.zeros(len(KINDS)),
        np.zeros(columns),
    )


def _up(count: int, whole: int) -> int:
    """`count`, or the next multiple of `whole`: blocks then have no remainder."""
    return -(-count // whole) * whole
