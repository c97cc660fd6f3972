"""A chain by its lumps: torque, regressor and mass matrix in joint coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import random_plant

from metaid.models import FRICTION, IDEAL, ChainModel, Lumps, mass_matrix

G = 9.81


def lumps_with_everything(nlink: int) -> Lumps:
    """Lumps of every kind, all searched."""
    random = np.random.default_rng(nlink)
    lumps = random_plant(nlink).chain.lumps_of((*IDEAL, *FRICTION, "inertia"))
    return lumps.with_parameters(lumps.vector + random.uniform(0.1, 1.0, len(lumps.names)))


@pytest.mark.parametrize("nlink", [1, 3, 5])
def test_torque_is_the_regressor_times_the_parameters(nlink: int) -> None:
    """For every kind of lump, at random states."""
    model = ChainModel(lumps_with_everything(nlink), G)
    random = np.random.default_rng(1)
    for _ in range(20):
        angles, speeds = random.normal(size=(2, nlink))
        torque = ChainModel(lumps_with_everything(nlink), G).torque(angles, speeds)
        assert model.regressor(angles, speeds) @ model.parameters == pytest.approx(torque, rel=1e-12, abs=1e-12)
        assert model.torque(angles, speeds) == pytest.approx(torque, rel=1e-12, abs=1e-12)


def test_many_states_at_once_are_each_by_itself() -> None:
    """Torque, regressor and mass matrix of a batch (2 x 5 states), with springs in the law."""
    model = ChainModel(lumps_with_everything(4), G, stiffness=2.0)
    angles, speeds = np.random.default_rng(3).normal(size=(2, 2, 5, 4))
    torque, regressor, matrix = model.torque(angles, speeds), model.regressor(angles, speeds), model.mass_matrix(angles)
    for i in np.ndindex(2, 5):
        assert torque[i] == pytest.approx(model.torque(angles[i], speeds[i]), rel=1e-12, abs=1e-12)
        assert regressor[i] == pytest.approx(model.regressor(angles[i], speeds[i]), rel=1e-12, abs=1e-12)
        assert matrix[i] == pytest.approx(model.mass_matrix(angles[i]), rel=1e-12, abs=1e-12)


def test_mass_matrix_in_joint_coordinates_gives_the_same_kinetic_energy() -> None:
    """q̇ᵀ M q̇ is that of the absolute angles, whose speeds are sums of joint speeds."""
    lumps = lumps_with_everything(4)
    angles, speeds = np.random.default_rng(2).normal(size=(2, 4))
    absolute = mass_matrix(lumps, np.cumsum(angles))
    joints = ChainModel(lumps, G).mass_matrix(angles)
    assert speeds @ joints @ speeds == pytest.approx(np.cumsum(speeds) @ absolute @ np.cumsum(speeds), rel=1e-12)
