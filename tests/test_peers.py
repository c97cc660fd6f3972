"""The comparison is fair: on perfect data every method finds the same known truth, each in its own way."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import peers
from benchmarks.by_torque import inverse_dynamics_regressor
from benchmarks.chains import random_chain
from benchmarks.rivals import comparing, toolbox
from benchmarks.rivals.answers import tuned, winners
from benchmarks.rivals.arm_model import misplaced
from benchmarks.rivals.benched import chain_on_bench, follow_on_bench, output_error_on_bench, trials_of
from benchmarks.rivals.comparing import DRIVEN, LOGGED, METHODS, OPEN, OURS, Cell, key, measure, wanted
from benchmarks.rivals.conditions import CONDITIONS, ENCODER, TIMESTEP, Condition
from benchmarks.rivals.kept import KEPT, differences, read_cells, write_cells
from benchmarks.rivals.logs import SPEED, SWING, Log, record
from benchmarks.rivals.models import ChainModel
from benchmarks.rivals.regression import regress, search_beforehand, weighted
from benchmarks.rivals.subjects import GRAVITY, ArmSubject, subject_of
from metaid.errors import StudyError
from metaid.models import Array
from metaid.plant import MujocoPlant, PlantSettings, chain_of
from soak.bench import Bench, Imperfections, arm_of_links

pytestmark = pytest.mark.slow

TRUE, NOMINAL = random_chain(2, 0)
SEARCHED = Condition("", {**ENCODER, "delay": 4, "tilt": 0.03}, friction=0.05, searched=("friction", "tilt", "delay"))
OFFSET = CONDITIONS["kinematics, searched"]


@pytest.fixture(scope="module")
def log() -> Log:
    """A rig without a fault along exciting trajectories, for five seconds."""
    return record(TRUE, NOMINAL, CONDITIONS["none"], 5.0, seed=0)


@pytest.fixture(scope="module")
def searched() -> Log:
    """A rig whose friction, tilt and delay are to be found."""
    return record(TRUE, NOMINAL, SEARCHED, 5.0, seed=0)


def assert_found(found: Array, tolerance: float) -> None:
    """All lumps are the true chain's."""
    chain = chain_of(TRUE)
    right = np.append(chain.lumps.vector, chain.inertia_lumps)
    assert found[: len(right)] == pytest.approx(right, rel=tolerance)


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
    """All lumps to 1e-4 from five seconds and the wrong nominal model; to 1e-5 where no derivative is needed."""
    for found in LOGGED[method](log):
        assert_found(found, 1e-5 if method.startswith("closed") else 1e-4)


@pytest.mark.parametrize("method", DRIVEN)
def test_a_toolbox_with_the_same_servos_is_exact(method: str) -> None:
    """All lumps to 1e-3 where each joint has a position servo of its own, that of the rig at 50 kHz, and to 1e-4 where
    it is at 500 kHz.
    """
    log = record(TRUE, NOMINAL, CONDITIONS["none"], 5.0, seed=0, by_drives=True)
    benched, short = chain_on_bench(TRUE, NOMINAL, CONDITIONS["none"], 0), log.first(1.5)  # both joints have moved much
    often = replace(short, seen=follow_on_bench(benched, short.servo, log.weights, 0, loops=1000))
    for each, tolerance in ((short, 1e-3), (often, 1e-4)):
        for found in DRIVEN[method](each):
            assert_found(found, tolerance)


def test_exact_bench_is_followed_as_step_by_step(log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit, by the compiled loop that one without noise, delay and limits has."""
    benched, short = chain_on_bench(TRUE, NOMINAL, CONDITIONS["none"], 0), log.first(0.2)
    compiled = follow_on_bench(benched, short.servo, log.weights, 0, loops=10)
    monkeypatch.setattr("benchmarks.rivals.benched.INEXACT", ("rate",))
    stepwise = follow_on_bench(benched, short.servo, log.weights, 0, loops=10)
    assert len(compiled.angles) == 101
    for kind in ("angles", "speeds", "torques"):
        assert np.array_equal(getattr(compiled, kind), getattr(stepwise, kind))


def test_metaid_is_exact_without_a_torque() -> None:
    """All lumps, in no more seconds than the others have, and it says that it has found them."""
    found = subject_of("none", 2, 0).pushed(5.0)
    assert_found(found.parameters, 1e-6)
    assert found.seconds <= 5.0
    assert found.verdict == "found"


def test_metaid_finds_lumps_beside_what_is_searched() -> None:
    """Within 1 % in five seconds with friction, a tilt and late torques that it is not told."""
    found = output_error_on_bench(chain_on_bench(TRUE, NOMINAL, SEARCHED, 0), SEARCHED, 5.0, 0)
    assert_found(found.parameters, 0.01)


def test_twin_of_a_rival_follows_an_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a PUMA 560 with all its friction the closed-loop method, on perfect sensors, is right to some per cent in five
    seconds.
    """
    monkeypatch.setattr(comparing, "BUDGETS", (5,))  # a minute would be recorded, for the longer budgets
    cell = measure(key("none", "closed-loop output error", 5), 6, 0)
    assert max(cell.errors[0][part] for part in ("gravity", "coriolis", "mass_matrix")) < 0.03


def test_metaid_is_exact_where_encoders_are_offset() -> None:
    """All lumps to 0.1 % in five seconds, with 0.1 mrad of noise; and it says that it has found them."""
    cell = measure(key("kinematics, searched", OURS, 5), 2, 0)
    assert cell.errors[0]["worst_lump"] < 1e-3
    assert cell.motion <= 5.0
    assert cell.verdict == "found"


def test_pushes_whose_speeds_scatter_are_not_refused() -> None:
    """Of five links that each begin with a speed that differs by 2 %, as all do when the study is created."""
    cell = measure(key("fine", OURS, 5), 5, 0)
    assert cell.verdict == "found"
    assert cell.errors[0]["worst_lump"] < 2e-3


def test_bench_adds_to_angles_and_torques_what_it_is_told() -> None:
    """An offset is read where nothing else is, and noise of the torques moves what no torque does."""
    links, seen = {"links": [{"length": 0.4, "mass": 1.0}]}, []
    for noise in (0.0, 0.3):
        bench = Bench(arm_of_links(links), TIMESTEP, Imperfections(encoder_offset=0.01, torque_noise=noise), True)
        bench.push([0.0])
        assert bench.states()[0] == pytest.approx([0.0])
        bench.advance([0.0])
        seen.append(bench.states()[1][0])
    hanging_over = 0.01 * -GRAVITY * 0.2 / (0.4**2 / 12 + 0.2**2) * TIMESTEP
    assert seen[0] == pytest.approx(hanging_over, rel=1e-3)
    assert abs(seen[1] - seen[0]) > 1e-4


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


def test_trajectories_keep_within_their_limits_and_begin_and_end_at_rest() -> None:
    """Every joint of the motion that was chosen."""
    motion = record(TRUE, NOMINAL, CONDITIONS["none"], 5.0, seed=1).servo
    assert np.abs(motion.angles).max() <= SWING * 1.01
    assert np.abs(motion.speeds).max() <= SPEED * 1.01
    for signal in (motion.angles, motion.speeds):
        assert np.abs(signal[[0, -1]]).max() <= 0.05 * np.abs(signal).max()


def test_faults_that_are_searched_are_found(searched: Log) -> None:
    """By regression: the delay in steps, friction and tilt to some per cent."""
    assert search_beforehand(searched).delay == 4
    assert isinstance(searched.model, ChainModel)
    found = searched.model.columns(regress(searched, weighted)[2])
    assert found.friction == pytest.approx([0.05, 0.05], rel=0.1)
    assert found.tilt == pytest.approx(0.03, rel=0.05)


@pytest.mark.parametrize("method", ["instrumental variables", "DIDIM", "closed-loop output error"])
def test_methods_that_simulate_find_lumps_beside_faults(method: str, searched: Log) -> None:
    """Within 1 % with a tenth of a milliradian of noise."""
    assert_found(LOGGED[method](searched)[-1], 0.01)


@pytest.mark.parametrize("method", ["weighted", "DIDIM", "closed-loop output error"])
def test_rivals_find_lumps_beside_offsets_of_encoders(method: str) -> None:
    """Within 1 % where every encoder reads half a degree too much and lengths are wrong."""
    log = record(TRUE, OFFSET.believed(NOMINAL, 0), OFFSET, 5.0, seed=0)
    assert search_beforehand(log).offset == pytest.approx([np.deg2rad(0.5)] * 2, rel=0.05)
    assert_found(LOGGED[method](log)[-1], 0.01)


@pytest.fixture(scope="module")
def arm() -> ArmSubject:
    """An arm with six joints and exact sensors."""
    subject = subject_of("none", 6, 0)
    assert isinstance(subject, ArmSubject)
    return subject


def test_joints_that_are_misplaced_are_so_by_what_is_said(arm: ArmSubject) -> None:
    """Each by a millimetre and half a degree; masses are what they were."""
    tree = arm.plant.tree
    moved = misplaced(tree, 0, 1e-3, np.deg2rad(0.5))
    assert np.linalg.norm(moved.position - tree.position, axis=1) == pytest.approx(1e-3)
    turned = np.einsum("nij,nik->njk", tree.rotation, moved.rotation)
    cosine = (np.trace(turned, axis1=1, axis2=2) - 1.0) / 2.0
    assert np.rad2deg(np.arccos(cosine)) == pytest.approx(0.5)
    assert (moved.mass == tree.mass).all()


def test_an_arm_may_have_the_joints_where_nobody_believes_them() -> None:
    """Then even the true masses are some tenths of a per cent to some per cent wrong."""
    subject = subject_of("kinematics", 6, 0)
    assert isinstance(subject, ArmSubject)
    error = subject.judge(subject.prior.base.of(subject.plant.tree.parameters)).largest
    assert 1e-3 < error < 0.05


def test_a_toolbox_is_ended_when_its_time_is_up(log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    """It says so, and has the best that it had found by then."""
    monkeypatch.setattr(toolbox, "ALLOWED", 0.0)
    with pytest.raises(toolbox.TimeIsUpError, match="ended after") as ended:
        toolbox.open_loop(log)
    assert ended.value.best.shape == (5,)


def test_what_is_measured_is_what_is_worth_it() -> None:
    """Arms have the parts that they have, and the toolbox a chain of each length."""
    runs = wanted(["none", "tilted"], [OURS, OPEN], {3: (5, 15), 6: (5,)}, [0, 1])
    assert (key("tilted", OURS, 15), 3, 1) in runs
    assert not any(links == 6 and named.split(" / ")[0] == "tilted" for named, links, _ in runs)
    assert [run for run in runs if OPEN in run[0]] == [(key("none", OPEN, 5), 3, 0)]


def test_a_log_ends_where_an_angle_is_lost() -> None:
    """And asking for more of it than there is is refused."""
    log = record(TRUE, NOMINAL, CONDITIONS["none"], 5.0, seed=0)
    away = replace(log.servo, angles=log.servo.angles + 20.0 * (np.arange(2500) >= 1000)[:, None])
    lost = follow_on_bench(chain_on_bench(TRUE, NOMINAL, CONDITIONS["none"], 0), away, log.weights, 0)
    assert len(lost.torques) == 1000
    with pytest.raises(StudyError, match="control was lost before 5 s"):
        replace(log, seen=lost).first(5.0)


def test_trials_have_all_pushes_that_there_is_time_for() -> None:
    """Two small trials where there is time for little, four where there is much, one where there is for one push."""
    assert [trials_of(pushes, 3) for pushes in (1, 2, 8, 20, 100)] == [1, 2, 2, 3, 4]


def test_one_command_compares_and_goes_on_where_it_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A result for each method, as JSON; what is in the file of results is not run again."""
    results = tmp_path / "results"
    monkeypatch.setattr(comparing, "BUDGETS", (5,))  # a minute would be recorded, for the longer budgets
    common = ["peers", "--part", "none", "--links", "2", "--seeds", "0", "--budgets", "5", "--workers", "1"]
    common += ["--results", str(results)]
    monkeypatch.setattr(sys, "argv", [*common, "--methods", "least squares", "weighted", OURS, "--json"])
    for measured in (3, 0):
        peers.main()
        printed = capsys.readouterr()
        rows = {row["method"]: row for row in json.loads(printed.out)}
        assert rows.keys() == {"least squares", "weighted", OURS}
        assert len(printed.err.splitlines()) == measured + 1
    monkeypatch.setattr(sys, "argv", ["peers", "--results", str(results), "--report"])
    peers.main()
    assert "| weighted | **exact** | 1 of 1 |" in capsys.readouterr().out
    assert rows["least squares"]["errors"][0]["worst_lump"] < 1e-5
    assert set(METHODS) >= {"least squares", "weighted", OURS}


def test_a_filter_is_chosen_once_for_all_chains() -> None:
    """The one with the least errors over all of them, and not the best of each."""

    def cell(seed: int, *errors: float) -> Cell:
        named = [{"gravity": error, "coriolis": 0.0, "mass_matrix": 0.0, "worst_lump": error} for error in errors]
        return Cell("coarse", "weighted", 2, seed, 5, named, 5.0, 1.0, 1.0, 0.1, "")

    assert [each.error for each in tuned([cell(0, 0.1, 0.2), cell(1, 0.1, 0.01)])] == [0.2, 0.01]


def test_methods_that_are_exact_win_alike() -> None:
    """And where none is, the one with the least error."""
    assert winners({"one": 1e-12, "other": 1e-7, "third": 1e-3}) == ["one", "other"]
    assert winners({"one": 1e-2, "third": 1e-3}) == ["third"]
    assert winners({}) == []  # where every method says that it has not found it


def test_results_that_are_kept_are_read_as_they_were_written(tmp_path: Path) -> None:
    """And one that is measured otherwise is named, by what it was and what it is."""
    kept = read_cells()
    write_cells(reversed(kept), tmp_path / "kept.csv")
    assert (tmp_path / "kept.csv").read_text() == KEPT.read_text()
    cell = next(each for each in kept if each.condition == "coarse")
    worse = replace(cell, errors=[{name: 1.2 * error for name, error in each.items()} for each in cell.errors])
    rounded = replace(cell, errors=[{name: 1.001 * error for name, error in each.items()} for each in cell.errors])
    assert not differences(kept, [rounded])
    (told,) = differences(kept, [worse])
    assert told.startswith(f"{cell.sampler}, {cell.links} links, seed {cell.seed}: kept")
    assert len(differences(kept, [replace(cell, verdict="not found")])) == 1
