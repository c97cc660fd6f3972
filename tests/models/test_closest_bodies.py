"""Bodies that can be, with given lumps or base parameters, closest to nominal ones."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import random_plant, wrong_chain
from random_arm import SOME, arm_named, wrong_tree

from metaid.models import Array, Chain, ChainModel, Lumps, chain_of_lumps
from metaid.models.closest_bodies import LEAST_SHARE, Matrices, closest
from metaid.models.tree import ArmPrior, joint_mass_matrix, joint_torque, planar_tree, possible_bodies
from metaid.plant import LinkSettings

FULL = ("gravity", "coriolis", "inertia")


def chain_with(lumps: Lumps, nominal: Chain) -> tuple[Chain | None, Array]:
    """The chain with these lumps, all of which count."""
    found = chain_of_lumps(lumps, nominal, np.ones(len(lumps.vector), dtype=np.bool_))
    return found.chain, found.excess


def fits_a_plant_file(chain: Chain) -> bool:
    """Whether a plant file may describe each of its links."""
    columns = (chain.length, chain.mass, chain.com, chain.inertia)
    for row in zip(*(column.tolist() for column in columns), strict=True):
        LinkSettings(**dict(zip(("length", "mass", "com", "inertia"), row, strict=True)))
    return True


@pytest.mark.parametrize("kinds", [FULL, FULL[:2]], ids=["inertia", "no inertia"])
@pytest.mark.parametrize("nlink", [1, 2, 3, 5, 20])
def test_chain_has_exactly_the_lumps_that_it_is_made_of(nlink: int, kinds: tuple[str, ...]) -> None:
    """And its links are possible bodies, whose lengths, but for the last, are the true ones."""
    true = random_plant(nlink).chain
    lumps = true.lumps_of(kinds)
    chain, excess = chain_with(lumps, wrong_chain(true, nlink))
    assert chain is not None
    assert chain.lumps_of(kinds).vector == pytest.approx(lumps.vector, rel=1e-13)
    assert np.abs(excess).max() < 1e-13
    assert chain.length[:-1] == pytest.approx(true.length[:-1], rel=1e-13)
    assert fits_a_plant_file(chain)


def test_closest_chain_to_a_nominal_one_with_its_lumps_is_itself() -> None:
    """Where nothing was learned, the bodies are those that were believed."""
    nominal = random_plant(3).chain
    chain, _ = chain_with(nominal.lumps_of(FULL), nominal)
    assert chain is not None
    for key in ("length", "mass", "com", "inertia"):
        assert getattr(chain, key) == pytest.approx(getattr(nominal, key), rel=1e-6)


def test_lumps_that_are_no_chains_give_the_nearest_one() -> None:
    """And it is said by how much each lump differs."""
    true, random = random_plant(4).chain, np.random.default_rng(0)
    lumps = true.lumps_of(FULL)
    seen = lumps.with_parameters(lumps.vector * np.exp(1e-2 * random.standard_normal(len(lumps.vector))))
    chain, excess = chain_with(seen, wrong_chain(true, 0))
    assert chain is not None
    assert chain.lumps_of(FULL).vector * (1.0 + excess) == pytest.approx(seen.vector, rel=1e-12)
    assert 1e-3 < np.abs(excess).max() < 3e-2
    assert chain.length[:3] == pytest.approx(true.length[:3], rel=2e-2)


def test_lumps_that_do_not_count_are_those_of_the_chain() -> None:
    """Without Coriolis lumps lengths are the nominal ones; one Coriolis lump of a link is enough for its length."""
    true = random_plant(3).chain
    nominal, lumps = wrong_chain(true, 0), true.lumps_of(FULL)
    names = lumps.names
    none = chain_of_lumps(lumps, nominal, np.array(["coriolis" not in name for name in names])).chain
    one = chain_of_lumps(lumps, nominal, np.array([name != "coriolis_1_2" for name in names])).chain
    assert none is not None
    assert one is not None
    assert none.length == pytest.approx(nominal.length)
    assert none.lumps.gravity == pytest.approx(lumps.gravity)
    assert one.lumps_of(FULL).vector == pytest.approx(lumps.vector)


def test_lumps_of_no_possible_chain_give_none() -> None:
    """An inertia lump below what the gravity lumps need, and a lump below zero."""
    nominal = random_plant(2).chain
    lumps = nominal.lumps_of(FULL)
    for index, factor in ((3, 0.2), (0, -1.0)):
        changed = lumps.vector.copy()
        changed[index] *= factor
        assert chain_with(lumps.with_parameters(changed), nominal)[0] is None


def test_closest_bodies_are_the_closest() -> None:
    """No step from them leads to a smaller divergence, and all matrices have their share of the nominal ones."""
    random = np.random.default_rng(0)
    root = random.standard_normal((3, 4, 4))
    offset = root @ root.swapaxes(1, 2) - 2.0 * np.eye(4)  # not positive definite
    slope = random.standard_normal((3, 4, 4, 5))
    slope[..., 0] = np.eye(4)
    slope += slope.swapaxes(1, 2)
    whole = np.concatenate([offset[..., None], slope], axis=-1)  # the first parameter is 1
    group = Matrices(whole, np.broadcast_to(np.diag([1.0, 2.0, 0.5, 3.0]), (3, 4, 4)))
    found = closest([group], np.eye(6)[0], np.eye(6)[:, 1:])
    assert found is not None

    def divergence(x: Array) -> float:
        inside = whole @ x - LEAST_SHARE * group.nominal
        scaled = np.linalg.solve(group.nominal, inside) / (1.0 - LEAST_SHARE)
        return float((np.trace(scaled, axis1=1, axis2=2) - np.linalg.slogdet(scaled)[1]).sum())

    assert np.linalg.eigvalsh(group.at(found)).min() > LEAST_SHARE
    steps = random.standard_normal((50, 6)) * np.append(0.0, np.ones(5))
    assert all(divergence(found + 1e-3 * step) > divergence(found) for step in steps)


@pytest.mark.parametrize("name", SOME)
def test_arm_has_exactly_the_base_parameters_that_it_is_made_of(name: str) -> None:
    """It moves as the true one, rotors and friction included, and its links are possible bodies."""
    true = arm_named(name)
    prior = ArmPrior(wrong_tree(true, 0))
    values = prior.base.of(true.parameters)
    found = possible_bodies(prior, values)
    assert found is not None
    assert not found.cut.any()
    assert prior.base.of(found.tree.parameters) == pytest.approx(values, rel=1e-12, abs=1e-12 * np.abs(values).max())
    states = np.random.default_rng(1).standard_normal((3, 20, true.njoint))
    wanted = joint_torque(true, *states)
    assert np.abs(joint_torque(found.tree, *states) - wanted).max() < 1e-12 * np.abs(wanted).max()
    assert (found.tree.mass >= 0.05 * prior.nominal.mass).all()
    second = 0.5 * np.trace(found.tree.inertia, axis1=1, axis2=2)[:, None, None] * np.eye(3) - found.tree.inertia
    assert (np.linalg.eigvalsh(second) > 0.0).all()
    assert min(map(np.min, (found.tree.rotor, found.tree.damping, found.tree.coulomb))) >= 0.0


def test_closest_arm_to_a_nominal_one_with_its_base_parameters_is_itself() -> None:
    """Where nothing was learned, the bodies are those that were believed."""
    nominal = arm_named("four")
    prior = ArmPrior(nominal)
    found = possible_bodies(prior, prior.values)
    assert found is not None
    assert found.tree.parameters == pytest.approx(nominal.parameters, rel=1e-6, abs=1e-9)


def test_friction_below_zero_is_cut_and_said() -> None:
    """No simulator takes it; the rest is as it was identified."""
    prior = ArmPrior(arm_named("four"))
    values = prior.values.copy()
    values[list(prior.base.names).index("damping2")] = -0.01
    found = possible_bodies(prior, values)
    assert found is not None
    assert found.cut[1, 1] == pytest.approx(-0.01)
    assert np.count_nonzero(found.cut) == 1
    assert found.tree.damping[1] == 0.0
    assert found.tree.coulomb == pytest.approx(prior.nominal.coulomb)


def test_base_parameters_of_no_possible_arm_give_none() -> None:
    """The last link cannot turn with less than no inertia."""
    prior = ArmPrior(arm_named("pa10"))
    values = prior.values.copy()
    values[list(prior.base.names).index("zz7")] = -1.0
    assert possible_bodies(prior, values) is None


def test_chain_as_an_arm_moves_alike() -> None:
    """Its gravity, Coriolis forces and mass matrix are those of the chain's lumps."""
    chain, random = random_plant(3).chain, np.random.default_rng(0)
    tree, model = planar_tree(chain, 9.81), ChainModel(chain.lumps_of(FULL), 9.81)
    for angles, speeds in random.standard_normal((5, 2, 3)):
        assert joint_torque(tree, angles, speeds, np.zeros(3)) == pytest.approx(model.torque(angles, speeds))
        assert joint_mass_matrix(tree, angles) == pytest.approx(model.mass_matrix(angles))
