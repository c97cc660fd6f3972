"""MuJoCo's stages called one by one are `mj_step` to the last bit, or they are not used."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from conftest import random_links

from metaid.compiled import CompiledLoop, fastest_step, step_of
from metaid.compiled.stages import agrees_with_mj_step
from metaid.episode import Episode, rich_pushes
from metaid.plant import MujocoPlant, PlantSettings


def plant_with(nlink: int, **joint: float) -> MujocoPlant:
    """A random chain whose joints have springs or friction."""
    links = tuple(link.model_copy(update=joint) for link in random_links(nlink, 1))
    return MujocoPlant("joints", PlantSettings(links=links))


@pytest.mark.parametrize(
    "joint", [{}, {"damping": 0.02, "stiffness": 0.1}, {"frictionloss": 0.02}], ids=["bare", "damped", "rubbed"]
)
@pytest.mark.parametrize("nlink", [1, 2, 3, 5, 10])
def test_episodes_are_the_same_to_the_last_bit(nlink: int, joint: dict[str, float]) -> None:
    """Survivors and falls, near the truth and far from it, come out equal in every number."""
    plant = plant_with(nlink, **joint)
    lumps = plant.chain.lumps
    episode = Episode(rich_pushes(plant, 4, 3.0, seed=1), steps=300)
    whole = CompiledLoop(plant, episode, step_of(plant.model, plant.data, is_direct=False))
    direct = CompiledLoop(plant, episode, step_of(plant.model, plant.data, is_direct=True))
    random, fell = np.random.default_rng(nlink), set()
    for spread in (0.0, 0.05, 0.5, 0.9):
        candidate = lumps.scaled(1.0 + spread * random.uniform(-1.0, 1.0, len(lumps.vector)))
        one = whole.run(candidate)
        numbers = one.total_steps, one.fall_step, *(array.tobytes() for array in _arrays(one))
        other = direct.run(candidate)
        assert numbers == (other.total_steps, other.fall_step, *(array.tobytes() for array in _arrays(other)))
        fell.add(one.fall_step is not None)
    assert fell == {True, False}


def _arrays(record):  # type: ignore[no-untyped-def]
    return record.half_periods, record.crossing_span, record.speed_energy, record.acceleration_energy


@pytest.mark.parametrize("joint", [{}, {"damping": 0.01}, {"stiffness": 0.1}, {"frictionloss": 0.01}])
def test_a_chain_is_stepped_directly_with_and_without_friction_and_springs(joint: dict[str, float]) -> None:
    """The faster way is the one that is taken."""
    assert fastest_step(plant_with(3, **joint)).is_direct


@pytest.mark.parametrize(
    "joint",
    [
        "<freejoint/>",
        '<joint type="ball"/>',
        '<joint type="hinge" axis="0 1 0" limited="true" range="-20 20"/>',
        "",
    ],
)
def test_models_that_are_no_chain_of_hinges_and_slides_are_not_accepted(joint: str) -> None:
    """Other joints and other constraints are noticed, before or by the comparison."""
    inertial = '<inertial pos="0 0 0.2" mass="1" diaginertia="0.01 0.01 0.01"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody><body>{joint}{inertial}</body></worldbody></mujoco>")
    assert not agrees_with_mj_step(model, mujoco.MjData(model))
