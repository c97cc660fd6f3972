"""The lean MuJoCo model of a planar chain: that of the arm which it is, with springs and a tilted base.

MuJoCo is loaded with this module, so a plant imports it when it first moves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.errors import PlantError, usable_mujoco
from metaid.models import Chain
from metaid.models.tree import planar_tree, tilted_gravity
from metaid.plant.description.lean import build_arm_spec

with usable_mujoco():
    import mujoco

TOLERANCE = 1e-8  # of MuJoCo's solver, where there is dry friction: its own


def build_spec(chain: Chain, gravity: float, timestep: float, tilt: float = 0.0) -> mujoco.MjSpec:
    """Hinges about y, explicit inertials. What is drawn is this with shapes added (`show/scene.py`), so it moves alike.

    Args:
        chain: the links; body i of the spec is named `link_i`, and its joint `joint_i`, from 1.
        gravity: in m/s².
        timestep: in s.
        tilt: of the base, in rad, positive towards positive angles.
    """
    tree = planar_tree(chain, gravity)
    spec = build_arm_spec(replace(tree, gravity=tilted_gravity(tree.gravity, np.array([0.0, tilt]))), timestep)
    spec.option.tolerance = TOLERANCE
    for name, stiffness in zip(tree.names, chain.stiffness.tolist(), strict=True):
        spec.joint(name).stiffness = [stiffness, 0.0, 0.0]
    return spec


def chain_model(name: str, chain: Chain, gravity: float, timestep: float, tilt: float) -> mujoco.MjModel:
    """The same, compiled.

    Args:
        name: of the plant, for the message of an error.
        chain: its links.
        gravity: in m/s².
        timestep: in s.
        tilt: of the base, in rad, positive towards positive angles.

    Raises:
        PlantError: MuJoCo cannot build it.
    """
    try:
        return build_spec(chain, gravity, timestep, tilt).compile()
    except (ValueError, mujoco.FatalError) as problem:
        raise PlantError(f"plant {name}: MuJoCo cannot build it: {' '.join(str(problem).split())}") from None
