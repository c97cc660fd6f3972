"""How the robot moves that logs have told of, as files have it: its law, and bodies for simulators."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.exporting import ArmLaw, Dynamics, not_in_xml
from metaid.models import IDEAL, Chain, chain_of_lumps
from metaid.models.tree import Tree
from metaid.recorded.estimating import RecordedEstimate


def dynamics_of(found: RecordedEstimate) -> Dynamics:
    """How the identified robot moves: bodies for simulators are those with plain friction and springs."""
    tree, friction = found.possible.tree, found.model.friction_at(found.values)
    plain = found.model.plain.friction_at(found.simulator.values)
    notes = not_in_xml(friction)
    if notes:
        notes = [
            *notes,
            "so bodies, viscous and Coulomb friction were fitted for it anew: left-out torques are predicted to "
            f"{found.simulator_held_out.relative:.2%} by these, to {found.held_out.relative:.2%} by the .py and .h",
        ]
    njoint = found.model.njoint
    damping, coulomb = (np.maximum(plain.of(term)[:njoint], 0.0) for term in ("viscous", "coulomb"))
    simulator = replace(found.simulator.tree, damping=damping, coulomb=coulomb)
    return Dynamics(
        law=ArmLaw(tree, tree.parameters, friction),
        tree=simulator,
        chain=None if found.model.chain is None else _chain(found, found.model.chain, simulator),
        notes=tuple(notes),
        is_chain=found.model.is_chain,
        friction=plain,
    )


def _chain(found: RecordedEstimate, nominal: Chain, tree: Tree) -> Chain | None:
    """The planar chain with the same lumps and friction whose centres of mass are on its links, as a plant file has it;
    None where there is none.
    """
    lumps = replace(nominal.lumps_of((*IDEAL, "inertia")), damping=tree.damping, coulomb=tree.coulomb)
    nlump = len(lumps.vector)
    lumps = lumps.with_parameters(found.simulator.values[:nlump])
    return chain_of_lumps(lumps, nominal, np.ones(nlump, dtype=np.bool_)).chain
