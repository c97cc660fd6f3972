"""The comparison is fair: on perfect data every method finds the same known truth, each in its own way."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import peers
from benchmarks.by_torque import inverse_dynamics_regressor
from benchmarks.chains import random_chain
from benchmarks.rivals.answers import OURS, tuned, winners
from benchmarks.rivals.comparing import DRIVEN, GRAVITY, LOGGED, METHODS, Cell, key, measure
from benchmarks.rivals.conditions import CONDITIONS, ENCODER, TIMESTEP, Condition
from benchmarks.rivals.excitation import SPEED, SWING, exciting
from benchmarks.rivals.logs import Log, record
from benchmarks.rivals.pushed import output_error, trials_of
from benchmarks.rivals.regression import Columns, regress, searched_delay, weighted
from benchmarks.rivals.servo import Sensors, follow
from metaid.plant import FaultyPlant, MujocoPlant, PlantSettings, Start, chain_of, draw, slope_weights

TRUE, NOMINAL = random_chain(2, 0)
EVERYTHING = Condition("", {**ENCODER, "torque_noise": 0.3, "delay": 2, "tilt": 0.03}, friction=0.05)
SEARCHED = Condition("", {**ENCODER, "delay": 4, "tilt": 0.03}, friction=0.05, searched=("friction", "tilt", "delay"))


@pytest.fixture(scope="module")
def log() -> Log:
    """A rig without a fault along exciting trajectories, for five seconds."""
    return record(TRUE, NOMINAL, CONDITIONS["none"], 5.0, seed=0)


@pytest.fixture(scope="module")
def searched() -> Log:
    """A rig whose friction, tilt and delay are to be found."""
    return record(TRUE, NOMINAL, SEARCHED, 5.0, seed=0)


def assert_found(found: Columns, tolerance: float) -> None:
    """All lumps are the true chain's."""
    chain = chain_of(TRUE)
    assert found.lumps == pytest.approx(chain.lumps.vector, rel=tolerance)
    assert found.inertia == pytest.approx(chain.inertia_lumps, rel=tolerance)


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


@pytest.mark.parametrize("method", LOGGED)
def test_on_perfect_data_every_rival_is_exact(method: str, log: Log) -> None:
    """All lumps to 1e-4 from five seconds and the wrong nominal model."""
    for found in LOGGED[method](log):
        assert_found(found, 1e-4)


@pytest.mark.parametrize("method", DRIVEN)
def test_a_toolbox_with_the_same_servos_is_exact(method: str) -> None:
    """All lumps to 1e-4 where each joint has a position servo of its own, in the rig and in the model."""
    log = record(TRUE, NOMINAL, CONDITIONS["none"], 5.0, seed=0, by_drives=True)
    for found in DRIVEN[method](log):
        assert_found(found, 1e-4)


def test_metaid_is_exact_without_a_torque() -> None:
    """All lumps, in no more seconds than the others have, and it says that it has found them."""
    found = output_error(TRUE, NOMINAL, CONDITIONS["none"], 5.0, seed=0)
    assert_found(Columns(np.append(found.lumps, found.inertia), 2, ()), 1e-6)
    assert found.seconds <= 5.0
    assert found.verdict == "found"


def test_metaid_finds_lumps_beside_what_is_searched() -> None:
    """Within 1 % in five seconds with friction, a tilt and late torques that it is not told."""
    found = output_error(TRUE, NOMINAL, SEARCHED, 5.0, seed=0)
    assert_found(Columns(np.append(found.lumps, found.inertia), 2, ()), 0.01)


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


def test_the_servo_drives_the_rig_that_metaid_pushes() -> None:
    """Under the same torques a MuJoCo plant with the same faults and noise reads the same angles."""
    seen = record(TRUE, NOMINAL, EVERYTHING, 5.0, seed=0).seen
    faults = EVERYTHING.settings
    noise = draw(faults, np.random.default_rng([0, 2, 1]), 1, len(seen.torques), 2)
    plant = FaultyPlant(MujocoPlant("rig", EVERYTHING.plant(TRUE)))
    plant.begin(noise)
    plant.push(Start.upright(np.zeros(2)))
    for step in range(100):
        angles, speeds = plant.states()
        assert angles == pytest.approx(seen.angles[step], abs=1e-9)
        assert speeds == pytest.approx(seen.speeds[step], abs=1e-6)
        plant.apply_torque(seen.torques[step])
        plant.step()


def test_trajectories_keep_within_their_limits_and_begin_and_end_at_rest() -> None:
    """Every joint of the motion that was chosen."""
    motion = exciting(chain_of(NOMINAL), GRAVITY, TIMESTEP, 5.0, seed=1)
    assert np.abs(motion.angles).max() <= SWING * 1.01
    assert np.abs(motion.speeds).max() <= SPEED * 1.01
    for signal in (motion.angles, motion.speeds, motion.accelerations):
        assert np.abs(signal[[0, -1]]).max() <= 0.05 * np.abs(signal).max()


def test_faults_that_are_searched_are_found(searched: Log) -> None:
    """By regression: the delay in steps, friction and tilt to some per cent."""
    assert searched_delay(searched) == 4
    found = regress(searched, weighted)[2]
    assert found.friction == pytest.approx([0.05, 0.05], rel=0.1)
    assert found.tilt == pytest.approx(0.03, rel=0.05)


@pytest.mark.parametrize("method", ["instrumental variables", "DIDIM", "closed-loop output error"])
def test_methods_that_simulate_find_lumps_beside_faults(method: str, searched: Log) -> None:
    """Within 1 % with a tenth of a milliradian of noise."""
    assert_found(LOGGED[method](searched)[-1], 0.01)


def test_what_a_rig_asks_of_a_servo_is_lost_where_it_cannot_follow() -> None:
    """A log ends where an angle is lost, and asking for more of it is refused."""
    log = record(TRUE, NOMINAL, CONDITIONS["none"], 5.0, seed=0)
    lost = follow(
        chain_of(TRUE).lumps,
        GRAVITY,
        TIMESTEP,
        log.servo,
        Sensors(np.full((2501, 2), 20.0), np.zeros((2500, 2)), slope_weights(TIMESTEP)),
    )
    assert len(lost.torques) == 0


def test_trials_have_all_pushes_that_there_is_time_for() -> None:
    """Two small trials where there is time for little, four where there is much, one where there is next to none."""
    assert [trials_of(pushes, 3) for pushes in (2, 8, 20, 100)] == [1, 2, 3, 4]


def test_one_command_compares_and_goes_on_where_it_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A result for each method, as JSON; what is in the file of results is not run again."""
    results = tmp_path / "results"
    cell = measure(key("none", "least squares", 5), 2, 0)
    common = ["peers", "--part", "none", "--links", "2", "--seeds", "0", "--budgets", "5", "--results", str(results)]
    monkeypatch.setattr(sys, "argv", [*common, "--methods", "least squares", "weighted", OURS, "--json"])
    for measured in (3, 0):
        peers.main()
        printed = capsys.readouterr()
        assert {row["method"] for row in json.loads(printed.out)} == {"least squares", "weighted", OURS}
        assert len(printed.err.splitlines()) == measured
    monkeypatch.setattr(sys, "argv", ["peers", "--results", str(results), "--report"])
    peers.main()
    assert "| weighted | **exact** | 1 of 1 |" in capsys.readouterr().out
    assert cell.errors[0]["worst_lump"] < 1e-9
    assert set(METHODS) >= {"least squares", "weighted", OURS}


def test_a_filter_is_chosen_once_for_all_chains() -> None:
    """The one with the least errors over all of them, and not the best of each."""

    def cell(seed: int, *errors: float) -> Cell:
        named = [{"gravity": error, "coriolis": 0.0, "mass_matrix": 0.0} for error in errors]
        return Cell("coarse", "weighted", 2, seed, 5, named, 5.0, 1.0, 1.0, 0.1, "")

    assert [each.error for each in tuned([cell(0, 0.1, 0.2), cell(1, 0.1, 0.01)])] == [0.2, 0.01]


def test_methods_that_are_exact_win_alike() -> None:
    """And where none is, the one with the least error."""
    assert winners({"one": 1e-12, "other": 1e-7, "third": 1e-3}) == ["one", "other"]
    assert winners({"one": 1e-2, "third": 1e-3}) == ["third"]
