"""The lumped parameters and the compensation law, against MuJoCo and against each other."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from conftest import random_plant

from metaid.errors import EpisodeError
from metaid.models import UNITS, ChainModel, compensation_basis, factors_from_names, lump_names, speeds_after

ALL_SIZES = pytest.mark.parametrize("nlink", [1, 2, 3, 5, 10])


def joints_to_links(nlink: int) -> np.ndarray:
    """T in φ = T q."""
    return np.tril(np.ones((nlink, nlink)))


@ALL_SIZES
def test_mass_matrix_from_lumps_is_the_one_that_mujoco_computes(nlink: int) -> None:
    """M(φ) of the lumps, brought to joint angles, equals MuJoCo's at any posture."""
    plant, random = random_plant(nlink), np.random.default_rng(2)
    for _ in range(5):
        plant.data.qpos[:] = random.uniform(-3, 3, nlink)
        mujoco.mj_forward(plant.model, plant.data)
        expected = np.zeros((nlink, nlink))
        mujoco.mj_fullM(plant.model, plant.data, expected)
        turn = joints_to_links(nlink)
        assert turn.T @ plant.chain.mass_matrix(turn @ plant.data.qpos) @ turn == pytest.approx(
            expected, rel=1e-10, abs=1e-12
        )


@ALL_SIZES
def test_compensation_with_true_lumps_is_the_bias_force_that_mujoco_computes(nlink: int) -> None:
    """The law with the true lumps is exactly what MuJoCo says gravity and Coriolis forces are."""
    plant, random = random_plant(nlink), np.random.default_rng(3)
    for _ in range(5):
        plant.data.qpos[:] = random.uniform(-3, 3, nlink)
        plant.data.qvel[:] = random.uniform(-5, 5, nlink)
        mujoco.mj_forward(plant.model, plant.data)
        torque = ChainModel(plant.chain.lumps, plant.gravity).torque(plant.data.qpos, plant.data.qvel)
        assert torque == pytest.approx(plant.data.qfrc_bias, rel=1e-9, abs=1e-10)


@ALL_SIZES
def test_law_is_linear_in_the_lumps(nlink: int) -> None:
    """The basis times the lumps is the law, so H is taken of the same law that is sent."""
    plant, random = random_plant(nlink), np.random.default_rng(4)
    angles, speeds = random.uniform(-2, 2, nlink), random.uniform(-5, 5, nlink)
    force = compensation_basis(np.cumsum(angles), np.cumsum(speeds), 9.81) @ plant.chain.lumps.vector
    assert np.cumsum(force[::-1])[::-1] == pytest.approx(ChainModel(plant.chain.lumps, 9.81).torque(angles, speeds))


def test_factors_scale_the_lump_of_their_name_and_no_other() -> None:
    """A factor is candidate ÷ nominal under its lump's name."""
    lumps = random_plant(3).chain.lumps
    scaled = lumps.scaled(factors_from_names({"coriolis_1_3": 2.0, "gravity_2": 0.5}, 3))
    ratio = dict(zip(lump_names(3), scaled.vector / lumps.vector, strict=True))
    assert ratio == pytest.approx(
        {"gravity_1": 1, "gravity_2": 0.5, "gravity_3": 1, "coriolis_1_2": 1, "coriolis_1_3": 2, "coriolis_2_3": 1}
    )
    assert scaled.coriolis == pytest.approx(scaled.coriolis.T)


def test_unknown_lump_is_named_with_those_that_exist() -> None:
    """A wrong name tells which are right."""
    with pytest.raises(EpisodeError, match=r"'coriolis_2_1'.*did you mean.*coriolis_1_2"):
        factors_from_names({"coriolis_2_1": 1.0}, 2)


@ALL_SIZES
def test_push_gives_the_speeds_that_mujoco_gives_to_a_short_strong_force(nlink: int) -> None:
    """Impulses at the link tips change the speeds as a force of 1e-6 s does in MuJoCo."""
    plant = random_plant(nlink)
    impulses = np.random.default_rng(5).uniform(-0.2, 0.2, nlink)
    instant = 1e-6
    plant.model.opt.timestep = instant
    for link, impulse in enumerate(impulses):
        tip = np.array([0.0, 0.0, plant.chain.length[: link + 1].sum()])
        mujoco.mj_forward(plant.model, plant.data)
        force = np.array([impulse / instant, 0.0, 0.0])
        mujoco.mj_applyFT(plant.model, plant.data, force, np.zeros(3), tip, link + 1, plant.data.qfrc_applied)
    mujoco.mj_step(plant.model, plant.data)
    assert np.cumsum(plant.data.qvel) == pytest.approx(
        speeds_after(plant.chain, impulses, np.zeros(nlink)), rel=1e-4, abs=1e-4
    )


@ALL_SIZES
@pytest.mark.parametrize("stiffness", [0.0, 7.0, 30.0])
def test_basis_times_lumps_is_the_compensation_torque(nlink: int, stiffness: float) -> None:
    """For random lumps of every kind, which belong to no chain, with and without springs."""
    random, kinds = np.random.default_rng(nlink), tuple(UNITS)
    names = lump_names(nlink, kinds)
    lumps = random_plant(nlink).chain.lumps_of(kinds)
    lumps = lumps.with_parameters(random.uniform(-2.0, 2.0, len(names)))
    angles, speeds = random.uniform(-2.0, 2.0, nlink), random.uniform(-5.0, 5.0, nlink)
    basis = compensation_basis(np.cumsum(angles), np.cumsum(speeds), 9.81, kinds, -stiffness * np.cumsum(angles))
    torque = ChainModel(lumps, 9.81, stiffness).torque(angles, speeds)
    assert np.cumsum((basis @ lumps.vector)[::-1])[::-1] == pytest.approx(torque)
