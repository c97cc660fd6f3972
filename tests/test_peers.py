"""The comparison is fair: on perfect data every method finds the same known truth, each in its own way."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from benchmarks import peers
from benchmarks.by_torque import Found, inverse_dynamics_regressor, least_squares, mujoco_sysid
from benchmarks.chains import Links, random_chain
from benchmarks.recording import Recording, record, with_noise
from metaid.plant.mujoco_plant import MujocoPlant
from metaid.plant.settings import PlantSettings, chain_of

GRAVITY = 9.81


@pytest.fixture(scope="module")
def pair() -> tuple[Links, Links]:
    """A chain of two links and its nominal model."""
    return random_chain(2, 0)


@pytest.fixture(scope="module")
def recording(pair: tuple[Links, Links]) -> Recording:
    """That chain along exciting trajectories."""
    return record(*pair, seed=0)


def assert_found(found: Found, true: Links, tolerance: float) -> None:
    """The lumps are the true chain's, the inertia lumps too if there are any."""
    chain = chain_of(true)
    assert found.lumps == pytest.approx(chain.lumps.vector, rel=tolerance)
    if found.inertia_lumps is not None:
        assert found.inertia_lumps == pytest.approx(chain.inertia_lumps, rel=tolerance)


def test_chains_are_repeatable_different_and_as_wrong_as_they_say() -> None:
    """The same seed means the same chain; nominal models keep the lengths and stay within their shares."""
    assert random_chain(3, 1) == random_chain(3, 1) != random_chain(3, 2)
    for seed in range(20):
        true, nominal = random_chain(4, seed)
        for one, other in zip(true, nominal, strict=True):
            assert 0.2 <= one.length <= 0.6
            assert 0.5 <= one.mass <= 1.5
            assert one.length == other.length
            assert abs(other.mass / one.mass - 1) <= 0.3
            assert abs(other.com / one.com - 1) <= 0.15
            assert abs(other.inertia / one.inertia - 1) <= 0.3


def test_metaid_finds_the_truth_without_a_torque(pair: tuple[Links, Links]) -> None:
    """Every lump within 1 %, and it stopped by itself."""
    found = peers.metaid_search(*pair, seed=0, sampler="cmaes")
    assert_found(found, pair[0], 0.01)
    assert found.trials is not None
    assert found.trials < peers.TRIALS_PER_LUMP * 3


def test_least_squares_on_perfect_data_is_exact(pair: tuple[Links, Links], recording: Recording) -> None:
    """To rounding, inertia lumps included: there it is better than any search."""
    assert_found(least_squares(recording, pair[1], GRAVITY), pair[0], 1e-9)


def test_sysid_on_perfect_data_is_exact(pair: tuple[Links, Links], recording: Recording) -> None:
    """MuJoCo's toolbox converges to the true lumps from the wrong nominal model."""
    assert_found(mujoco_sysid(recording, pair[1], GRAVITY), pair[0], 1e-6)


def test_noise_costs_least_squares_its_exactness_and_not_its_sense(
    pair: tuple[Links, Links], recording: Recording
) -> None:
    """With 1 mrad on the angles the lumps are wrong by more than 0.01 % and by less than 5 %."""
    found = least_squares(with_noise(recording, pair[1], GRAVITY, seed=0), pair[1], GRAVITY)
    error = np.abs(found.lumps / chain_of(pair[0]).lumps.vector - 1).max()
    assert 1e-4 < error < 0.05


def test_regressor_times_the_lumps_is_mujocos_inverse_dynamics() -> None:
    """In any state of a longer chain."""
    plant = MujocoPlant("chain", PlantSettings(links=random_chain(4, 0)[0]))
    angles, speeds, torque = np.random.default_rng(1).normal(size=(3, 4))
    plant.data.qpos[:], plant.data.qvel[:] = angles, speeds
    plant.apply_torque(torque)
    plant.step()
    accelerations = (plant.states()[1] - speeds) / plant.timestep
    regressor = inverse_dynamics_regressor(angles[None], speeds[None], accelerations[None], GRAVITY)[0]
    lumps = np.append(plant.chain.lumps.vector, plant.chain.inertia_lumps)
    assert regressor @ lumps == pytest.approx(torque, abs=1e-8)


def test_one_command_compares_every_method_on_the_same_chain(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As JSON, one result per method; and they make a row each of the table."""
    monkeypatch.setattr(sys, "argv", ["peers", "--links", "1", "--seeds", "1", "--json"])
    peers.main()
    results = json.loads(capsys.readouterr().out)
    assert [result["method"] for result in results] == list(peers.NEEDS)
    assert all(result["error"] < 0.01 for result in results)
    assert len(peers.table([peers.Result(**result) for result in results])) == len(peers.NEEDS)
