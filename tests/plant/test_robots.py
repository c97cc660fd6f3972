"""Arms of others, from the URDFs of the package example-robot-data as they are, beside pinocchio."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from metaid.models import Array
from metaid.plant import ArmPlant, ArmSettings
from metaid.plant.description import arm_model, draw_starts
from metaid.plant.description.reading import forces_of_lean

pytestmark = pytest.mark.robots
pinocchio: Any = pytest.importorskip("pinocchio", reason="`make robots` installs pinocchio")
DATA = Path(pinocchio.__file__).parents[4] / "share" / "example-robot-data" / "robots"
if not DATA.is_dir():
    pytest.skip("`make robots` installs example-robot-data", allow_module_level=True)
ROBOTS = {
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
}


def plant(name: str) -> ArmPlant:
    """The arm; the fingers of the Panda are held."""
    joints = tuple(f"panda_joint{i}" for i in range(1, 8)) if name == "panda" else None
    return ArmPlant(name, ArmSettings(urdf=str(DATA / ROBOTS[name]), joints=joints))


def by_pinocchio(arm: ArmPlant, states: Array) -> tuple[Array, Array]:
    """Mass matrix and bias force at joint coordinates and speeds (2 x njoint), by an independent code."""
    model = pinocchio.buildModelFromUrdf(arm.settings.file)
    held = [i for i in range(1, model.njoints) if model.names[i] not in arm.tree.names]
    model = pinocchio.buildReducedModel(model, held, pinocchio.neutral(model))
    assert tuple(model.names)[1:] == arm.tree.names
    data, configuration = model.createData(), pinocchio.neutral(model)
    configuration = pinocchio.integrate(model, configuration, states[0])
    upper = np.triu(pinocchio.crba(model, data, configuration))
    bias = pinocchio.nonLinearEffects(model, data, configuration, states[1])
    return upper + upper.T - np.diag(np.diag(upper)), bias


@pytest.mark.parametrize("name", ROBOTS)
def test_urdf_moves_as_pinocchio_says(name: str) -> None:
    """Mass matrix and bias force of the lean model are those of the file, without rotors, in random states."""
    arm = plant(name)
    model = arm_model(arm.tree, arm.timestep)
    for states in np.random.default_rng(0).uniform(-1.5, 1.5, (5, 2, arm.njoint)):
        matrix, bias, _ = forces_of_lean(model, *states)
        expected_matrix, expected_bias = by_pinocchio(arm, states)
        assert np.abs(matrix - expected_matrix).max() < 1e-9 * np.abs(expected_matrix).max()
        assert np.abs(bias - expected_bias).max() < 1e-9 * np.abs(expected_bias).max()


@pytest.mark.parametrize("name", ROBOTS)
def test_pushes_of_it_have_starts(name: str) -> None:
    """From twenty poses it coasts clear of itself, though some of its meshes cannot be loaded."""
    assert len(draw_starts(plant(name), 20, 0.3, seed=1)) == 20
