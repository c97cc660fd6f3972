"""What is unknown of nominal robots, as their logs tell it: of a planar chain, and of an arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import compress

import numpy as np

from metaid.errors import RecordError
from metaid.models import IDEAL, Array, Chain, ChainModel, lump_names, lump_unit
from metaid.models.tree import (
    PARAMETERS,
    ArmPrior,
    Dynamics,
    PriorDeviations,
    Sliding,
    Tree,
    arm_dynamics,
    planar_tree,
    rigid_torque,
    torque_columns,
)
from metaid.plant import MujocoPlant, SimulatedPlant
from metaid.recorded.weak_form.linear_model import BASE, RIGID, LinearModel

STILL = 0.01  # rad/s or m/s, until the usual speeds of logs are known
SPREAD = 0.3  # standard deviation of a nominal lump, as a share of it
UNKNOWN_ROTOR = 5.0  # prior deviation of rotors, as `PriorDeviations` has it: a URDF knows nothing of gears


def model_of(plant: SimulatedPlant, gravity: Sequence[float] | None = None) -> LinearModel:
    """That of a nominal robot with plain friction; with `gravity` in the frame of the base, in m/s², in place of an
    arm's own.  Raises RecordError where a planar chain says its own.
    """
    if not isinstance(plant, MujocoPlant):
        tree = plant.tree if gravity is None else replace(plant.tree, gravity=np.asarray(gravity, dtype=np.float64))
        return arm_model(tree)
    if gravity is not None:
        raise RecordError("gravity: a planar chain says its own in its plant file (allowed: of an MJCF or URDF)")
    return chain_model(plant.chain, plant.gravity)


def chain_model(chain: Chain, gravity: float) -> LinearModel:
    """That of a nominal planar chain under `gravity`, in m/s², its lumps and the rotors of its joints unknown; that of
    the first joint cannot be told from the link.
    """
    n, kinds = chain.nlink, (*IDEAL, "inertia")
    names = *lump_names(n, kinds), *(f"rotor_{i + 1}" for i in range(1, n))
    law = ChainModel(chain.lumps_of(kinds), gravity)
    lumps = law.parameters
    rotors = lumps[len(lumps) - n + 1 :]

    def bodies(angles: Array, speeds: Array, accelerations: Array) -> Array:
        turned = (accelerations[..., None] * np.eye(n))[..., 1:]
        return np.concatenate([law.regressor(angles, speeds, accelerations), turned], axis=-1)

    def robot(values: Array) -> ChainModel:
        rotor = np.concatenate([np.zeros((*values.shape[:-1], 1)), values[..., len(lumps) :]], axis=-1)
        return ChainModel(law.lumps.with_parameters(values[..., : len(lumps)]), gravity, rotor=rotor)

    def dynamics(values: Array) -> Dynamics:
        own = robot(values)
        return lambda angles, speeds: (own.mass_matrix(angles), own.torque(angles, speeds))

    def _rigid(values: Array, angles: Array, speeds: Array, accelerations: Array) -> Array:
        return robot(values).inverse_dynamics(angles, speeds, accelerations)

    return LinearModel(
        names=names,
        units=tuple("kg m²" if name.startswith("rotor") else lump_unit(name) for name in names),
        expressions=("",) * len(names),
        nominal=np.concatenate([lumps, np.zeros(n - 1)]),
        covariance=np.diag(np.concatenate([SPREAD * lumps, rotors]) ** 2),
        bodies=bodies,
        rigid=_rigid,
        dynamics=dynamics,
        joints=tuple(f"{i + 1}" for i in range(n)),
        slides=np.zeros(n, dtype=np.bool_),
        sliding=Sliding.at_once(np.full(n, STILL)),
        untrusted=np.zeros(n, dtype=np.bool_),
        passive=np.zeros(n, dtype=np.bool_),
        tree=planar_tree(chain, gravity),
        chain=chain,
    ).with_friction(BASE)


def arm_model(tree: Tree) -> LinearModel:
    """That of a nominal arm, its base parameters unknown, rotors among them."""
    prior = ArmPrior(tree, PriorDeviations(rotor=UNKNOWN_ROTOR))
    kept = prior.base.columns % len(PARAMETERS) < RIGID
    columns = prior.base.columns[kept]

    def of_links(values: Array) -> Array:
        every = np.zeros((*values.shape[:-1], tree.njoint * len(PARAMETERS)))
        every[..., columns] = values
        return every.reshape(*values.shape[:-1], tree.njoint, len(PARAMETERS))

    def dynamics(values: Array) -> Dynamics:
        return arm_dynamics(tree, of_links(values))

    def _rigid(values: Array, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
        return rigid_torque(tree, of_links(values), coordinates, speeds, accelerations)

    return LinearModel(
        names=tuple(compress(prior.base.names, kept)),
        units=tuple(compress(prior.base.units, kept)),
        expressions=tuple(compress(prior.base.expressions, kept)),
        nominal=prior.values[kept],
        covariance=prior.covariance[np.ix_(kept, kept)],
        bodies=partial(torque_columns, tree, columns),
        rigid=_rigid,
        dynamics=dynamics,
        joints=tuple(tree.names),
        slides=tree.slides,
        sliding=Sliding.at_once(np.full(tree.njoint, STILL)),
        untrusted=np.zeros(tree.njoint, dtype=np.bool_),
        passive=np.zeros(tree.njoint, dtype=np.bool_),
        tree=tree,
        prior=prior,
    ).with_friction(BASE)


def arm_like(model: LinearModel, tree: Tree) -> LinearModel:
    """That of an arm which differs from that of a `model` in its bodies, frames or gravity alone."""
    other = replace(arm_model(tree), sliding=model.sliding, untrusted=model.untrusted, passive=model.passive)
    return other.with_rubbing(model.rubbing)
