"""What is true of a bench (`soak.bench`), in the parameters that a study of it finds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from metaid.models import Array, Chain
from metaid.models.tree import ArmPrior, Tree
from metaid.plant import ArmPlant, PlantSettings, chain_of, load_plant


def told_unit(has: Mapping[str, Any]) -> float:
    """What the first motor gives of what it is told, by the imperfections that a bench `has`: the unit of lumps."""
    return 1.0 + float(has.get("gains", (0.0,))[0])


def true_chain(links: Sequence[Mapping[str, float]], has: Mapping[str, Any]) -> Chain:
    """The chain of a bench with these `links`; the rotor of the first joint turns with the first link, and is one with
    its inertia.
    """
    own = [dict(link) for link in links]
    own[0]["inertia"] += has.get("rotors", (0.0,))[0]
    return chain_of(PlantSettings.model_validate({"links": own}).links)


def true_arm(file: Path, has: Mapping[str, Any]) -> Tree:
    """The arm of a bench that moves this MJCF. Its friction is the bench's own: it takes none from a file."""
    plant = load_plant(file)
    assert isinstance(plant, ArmPlant)
    tree, joints = plant.tree, np.zeros((3, plant.njoint))
    for row, name in enumerate(("rotors", "viscous", "dry")):
        given = has.get(name, ())
        joints[row, : len(given)] = given
    return replace(tree, rotor=tree.rotor + joints[0], damping=joints[1], coulomb=joints[2])


def true_lumps(chain: Chain, names: Sequence[str], has: Mapping[str, Any]) -> Array:
    """The lumps (nlump) of these `names`, in units of what the first motor is told."""
    kinds = tuple(dict.fromkeys(name.partition("_")[0] for name in names))
    return np.asarray(chain.lumps_of(kinds).vector_of(kinds) / told_unit(has), dtype=np.float64)


def true_base(tree: Tree, prior: ArmPrior, has: Mapping[str, Any]) -> Array:
    """The base parameters (nbase) that a `prior` is of, in the same units."""
    return np.asarray(prior.base.of(tree.parameters) / told_unit(has), dtype=np.float64)
