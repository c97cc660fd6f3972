"""What an identified model is to be written from: its law, and possible bodies that have its lumps or base parameters.

These are pure functions of what was identified: of a chain its lumps, of an arm its base parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from metaid.exporting.laws import ArmLaw, ChainLaw, Law
from metaid.models import FRICTION, SLIDING, Array, Chain, Lumps, chain_of_lumps
from metaid.models.tree import PARAMETERS, ArmPrior, JointFriction, Tree, planar_tree, possible_bodies

EXACT = 1e-9  # by which lumps may differ from a chain's: rounding
_PARTS = ("rotor", "damping", "coulomb")


@dataclass(frozen=True)
class Dynamics:
    """How an identified model moves.

    Attributes:
        law: the compensation law, exactly as it was identified.
        tree: links that can be; None where none have what was identified.
        chain: the same as a planar chain; None of an arm, or where there is none.
        notes: what to know of the bodies, in sentences without a full stop.
        is_chain: whether it is a planar chain, and no arm.
        friction: whose springs and coupled motors the links have, in files that can hold these; None for none.
        besides: what was found beside it and no file has, in a sentence without a full stop; none where it is empty.
    """

    law: Law
    tree: Tree | None
    chain: Chain | None
    notes: tuple[str, ...]
    is_chain: bool
    friction: JointFriction | None = None
    besides: str = ""


def chain_dynamics(
    lumps: Lumps, gravity: float, nominal: Chain, known: NDArray[np.bool_], rotor: Array | float = 0.0
) -> Dynamics:
    """That of a planar chain.

    Args:
        lumps: that were identified; inertia lumps may be missing.
        gravity: in m/s².
        nominal: the chain whose bodies those of the result are to be close to.
        known: which of the gravity, Coriolis and inertia lumps (nlump) are identified.
        rotor: the reflected inertia of what turns with each joint (njoint), in kg m².
    """
    kinds = ("gravity", "coriolis") if lumps.inertia is None else ("gravity", "coriolis", "inertia")
    lumps = replace(lumps, searched=kinds)
    # A plant has no friction below zero, which noise may make of none.
    damping, coulomb = (np.maximum(lumps.of(kind), 0.0) for kind in FRICTION)
    found = chain_of_lumps(replace(lumps, damping=damping, coulomb=coulomb), nominal, known)
    notes = []
    excess = np.where(known, np.abs(found.excess), 0.0)
    if excess.max() > EXACT and found.chain is not None:
        worst = int(excess.argmax())
        notes.append(
            f"no chain has exactly the lumps that were found: the nearest one is written, and {lumps.names[worst]} "
            f"differs most from it, by {100.0 * found.excess[worst]:+.2g} %"
        )
    notes += [
        f"{kind}_{i + 1} was found to be {value:.3g}; the bodies have 0"
        for kind in FRICTION
        for i, value in enumerate(lumps.of(kind).tolist())
        if value < 0.0
    ]
    tree = None
    if found.chain is not None:
        tree = replace(planar_tree(found.chain, gravity), rotor=np.full(lumps.nlink, rotor))
    return Dynamics(ChainLaw(lumps, gravity, rotor=rotor), tree, found.chain, tuple(notes), is_chain=True)


def arm_dynamics(prior: ArmPrior, values: Array) -> Dynamics:
    """That of an arm with base parameters `values` (nbase), its bodies close to the nominal ones of a `prior`."""
    found = possible_bodies(prior, values)
    parameters = prior.parameters_at(values)
    viscous, coulomb = (parameters[:, PARAMETERS.index(name)] for name in ("damping", "coulomb"))
    friction = JointFriction.simple(viscous, coulomb, np.full(len(parameters), SLIDING))
    law = ArmLaw(prior.nominal, parameters, friction)
    if found is None:
        return Dynamics(law, None, None, (), is_chain=False)
    notes = tuple(
        f"{what} of joint {found.tree.names[joint]} was found to be {value:.3g}; the bodies have 0"
        for joint, row in enumerate(found.cut.tolist())
        for what, value in zip(_PARTS, row, strict=True)
        if value < 0.0
    )
    return Dynamics(law, found.tree, None, notes, is_chain=False)
