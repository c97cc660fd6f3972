"""The model that logs have told, to be written to files, and what each file predicts once it is loaded again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from metaid.exporting import ArmLaw, Dynamics, couples_of, file_torques, not_in_xml
from metaid.models import IDEAL, Array, Chain, chain_of_lumps
from metaid.models.tree import PARAMETERS, JointFriction, Tree
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.weak_form.smoothed import Smoothed


@dataclass(frozen=True)
class FileError:
    """How well a written file predicts: the error of its torques as a share of what they are (`relative`), of each
    joint (`by_joint`), on how many `rows`; None where it predicts none, and `why_not`.
    """

    path: str
    relative: float | None
    by_joint: tuple[float, ...]
    rows: int
    why_not: str = ""


def dynamics_of(found: RecordedEstimate) -> Dynamics:
    """How the identified robot moves: bodies for simulators are those with plain friction."""
    tree, friction = found.possible.tree, found.model.friction_at(found.values)
    plain = found.simulator_model.friction_at(found.simulator.values)
    notes = not_in_xml(friction)
    if notes:
        notes = [
            *notes,
            "so bodies, viscous and Coulomb friction were fitted for it anew: left-out torques are predicted to "
            f"{found.simulator_held_out.relative:.2%} by these, to {found.held_out.relative:.2%} by the .py and .h",
        ]
    simulator = _with_friction(found.simulator.tree, plain)
    return Dynamics(
        law=ArmLaw(tree, tree.parameters, friction),
        tree=simulator,
        chain=None if found.model.chain is None else _chain(found, found.model.chain, simulator),
        notes=tuple(notes),
        is_chain=found.model.is_chain,
        couples=couples_of(plain),
    )


def _with_friction(tree: Tree, friction: JointFriction) -> Tree:
    parameters = tree.parameters.copy()
    parameters[:, PARAMETERS.index("damping")] = np.maximum(friction.of("viscous")[: tree.njoint], 0.0)
    parameters[:, PARAMETERS.index("coulomb")] = np.maximum(friction.of("coulomb")[: tree.njoint], 0.0)
    return tree.with_parameters(parameters)


def _chain(found: RecordedEstimate, nominal: Chain, tree: Tree) -> Chain | None:
    """The planar chain with the same lumps and friction whose centres of mass are on its links, as a plant file has it;
    None where there is none.
    """
    lumps = replace(nominal.lumps_of((*IDEAL, "inertia")), damping=tree.damping, coulomb=tree.coulomb)
    nlump = len(lumps.vector)
    lumps = lumps.with_parameters(found.simulator.values[:nlump])
    return chain_of_lumps(lumps, nominal, np.ones(nlump, dtype=np.bool_)).chain


def file_error(path: Path, name: str, found: RecordedEstimate, logs: Sequence[Smoothed], zeros: Array) -> FileError:
    """How well a written file predicts the torques of logs, loaded again: those of the rows that are judged (Eq. 73).

    Args:
        path: of the file.
        name: of the model that was written.
        found: what it is of.
        logs: that are predicted.
        zeros: of their encoders (nlog x njoint), in rad.
    """
    squares, whole, rows = np.zeros(found.model.njoint), np.zeros(found.model.njoint), 0
    for own, zero in zip(logs, zeros, strict=True):
        predicted = file_torques(
            path,
            name,
            own.coordinates + zero,
            own.speeds,
            own.accelerations,
            found.possible.tree.names,
            gravity=found.possible.tree.gravity,
        )
        if predicted.torques is None:
            return FileError(str(path), None, (), 0, predicted.why_not)
        sent = own.acting(found.delay)
        left = (sent - own.filtered(predicted.torques))[own.judged]
        squares = squares + found.model.trusted_alone((left**2).sum(axis=0))
        bodies = found.values[: found.model.nbody]
        whole = whole + own.whole(found.model, bodies, sent)[own.judged].sum(axis=0)
        rows += len(left)
    relative = float(np.sqrt(squares.sum() / max(whole.sum(), 1e-300)))
    by_joint = np.sqrt(squares / np.maximum(whole, 1e-300))
    return FileError(str(path), relative, tuple(by_joint.tolist()), rows)
