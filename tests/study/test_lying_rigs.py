"""Rigs that lie: what cannot be true is never a COMPLETE or PRUNED trial, and an honest rig is never refused."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import random_links, random_plant

from metaid.episode import Calibration, Episode, FallRule, Outcome, natural_time, rich_pushes, run_stepwise
from metaid.errors import ImplausiblePlant, PlantError
from metaid.models import Array, Chain
from metaid.plant import FaultSettings, FaultyPlant, MujocoPlant, PlantSettings, SocketPlant, SocketSettings, Start
from metaid.store import Store
from metaid.study import Problem, create_study, load_study, run_study, stored_spec
from metaid.study.calibration import calibrate_chain
from soak import lies
from soak.bench.serving import bench
from soak.lies import LIES, Answer, Liar, Lie, listening, replayed
from soak.rigs import HONEST_TRIALS, NOISE, PUSHES_A_TRIAL, STEPS, broken, created, told

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def liar() -> Iterator[Liar]:
    """A rig that was honest while a study of it was created, in a folder that is the current one."""
    rig = Liar(STEPS)
    with created(rig):
        yield rig


@pytest.fixture(scope="module")
def problem(liar: Liar) -> Problem:
    """The study of that rig, as it is in the DB."""
    with closing(Store("template.db")) as store:
        return Problem(stored_spec(store, "study"))


def outcomes(problem: Problem, liar: Liar, lie: Lie | None, scales: Sequence[float]) -> list[Outcome]:
    """What becomes of candidates whose factors are these `scales`, where the rig tells a `lie` in the last."""
    liar.arm(lie, PUSHES_A_TRIAL * (len(scales) - 1))
    with closing(problem.make_objective()) as objective:
        batch = objective.share(np.array([np.full(3, scale) for scale in scales]), range(len(scales)))
        objective.work_on(batch)
        return objective.outcomes(batch)


@pytest.mark.parametrize("name", LIES)
def test_lie_fails_its_trial(problem: Problem, liar: Liar, name: str) -> None:
    """Whatever the lie, the trial fails and has a reason, and no torque is sent that is not finite."""
    lie = LIES[name]
    *before, lied = outcomes(problem, liar, lie, (0.9, 1.2) if lie is replayed else (1.2,))
    assert [outcome.failure for outcome in before] == [None] * len(before)
    assert lied.failure is not None
    assert np.isfinite(np.array(liar.sent_torques())).all()


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("pushes are a tenth too weak", r"push 1, tick 0: joint 1 turns at 2.238 rad/s .*expected: 2.486 ± 0.072"),
        ("an encoder dies", r"push 1, tick 75: joint 1 changes its speed by .*expected: at most"),
        ("all readings freeze near the end", r"joint 1 is at 0.5\d* rad for 2 readings and does not move"),
        ("the tick stands still", r"it is at tick 10 after 75 steps: its time does not go on"),
    ],
)
def test_reason_says_which_joint_what_was_seen_and_what_was_expected(liar: Liar, name: str, reason: str) -> None:
    """In one sentence, which is in the DB; the second one ends the run, in one line and with status 2."""
    found = told(liar, LIES[name])
    assert broken(found) is None
    for shown in (*found.reasons[HONEST_TRIALS:], found.answer.err):
        assert shown is not None
        assert re.search(reason, shown)


def test_run_goes_on_where_a_rig_is_honest_again(liar: Liar) -> None:
    """Two failed trials end a run, not the study: the same command goes on, and one failed trial alone ends nothing."""
    found = told(liar, LIES["an angle is NaN"])
    assert found.states[HONEST_TRIALS:] == ["FAIL", "FAIL"]
    liar.arm(None, 0)
    with closing(Store("run.db")) as store:
        run_study(store, "study")
        states = [trial.state.name for trial in store.trials("study", load_study("study.toml").names)]
    assert states.count("FAIL") == 2
    assert len(states) == 8


def test_single_failed_trial_ends_nothing(liar: Liar) -> None:
    """A push that goes wrong once costs one trial."""

    def once(rig: Liar, answer: Answer) -> None:
        if rig.pushes == HONEST_TRIALS * PUSHES_A_TRIAL:
            answer["speeds"][0] *= 2.0

    found = told(liar, once)
    assert found.answer.status == 0
    assert found.states.count("FAIL") == 1
    assert found.states[HONEST_TRIALS] == "FAIL"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("all readings are zero", "joint 1 does not answer"),
        ("an angle has 400 digits", "the angle of joint 1 is inf"),
        ("the tick is 1e400", "at tick inf after"),
        ("the answer is a deep list", "not JSON"),
    ],
)
def test_lie_while_a_study_is_created_is_one_line_and_leaves_nothing(name: str, message: str) -> None:
    """All-zero readings, which would be a singular matrix, among them."""
    rig = Liar(0)
    with created(rig):
        rig.arm(LIES[name], 0)
        with closing(Store("other.db", create=True)) as store:
            with pytest.raises(PlantError, match=message):
                create_study(store, load_study("study.toml"), "study")
            assert store.names() == []


def test_torque_that_is_not_finite_is_never_sent() -> None:
    """Not even where the law is a user's own."""
    rig = Liar(STEPS)
    with listening(rig) as address:
        plant = SocketPlant("rig", SocketSettings(socket=address, joints=2, step_timeout=30.0))
        plant.push(Start.upright(np.array([0.1, 0.1])))
        plant.apply_torque(np.array([0.0, np.inf]))
        with pytest.raises(ImplausiblePlant, match=r"a torque of \[0.0, inf\] N m: it is not sent"):
            plant.step()
        plant.close()
    assert rig.sent_torques() == []


@pytest.mark.parametrize("kind", NOISE)
def test_honest_rig_is_believed(kind: str) -> None:
    """With exact readings, and with 1 mrad of noise and pushes that differ by 2 %, no trial fails: neither far from
    the truth nor near it.
    """
    rig = Liar(STEPS, **NOISE[kind], seed=3)
    with created(rig), closing(Store("template.db")) as store:
        found = outcomes(Problem(stored_spec(store, "study")), rig, None, (0.7, 1.0, 1.001, 1.4))
    assert [outcome.failure for outcome in found] == [None] * 4


def calibration_of(plant: MujocoPlant, nominal: Chain, pushes: Array) -> Calibration:
    """What `study create` would measure at a rig with the faults of a simulated plant, without its chance."""
    faults = plant.settings.faults
    speeds = np.array([plant.start_speeds(Start.upright(push)) for push in pushes])
    response = np.array([plant.start_speeds(Start.upright(push)) for push in np.eye(plant.njoint)]).T
    spread = np.linalg.norm(response * pushes[:, None], axis=-1) * faults.push_noise
    tolerance = 6.0 * np.hypot(spread, faults.speed_noise) + 0.02 * np.abs(speeds).max()
    noise = np.full(plant.njoint, faults.angle_noise), np.full(plant.njoint, faults.speed_noise)
    return Calibration(speeds, tolerance, *noise, nominal, plant.gravity)


@pytest.mark.parametrize(
    "faults",
    [
        {},
        {"angle_noise": 1e-3, "push_noise": 0.02},
        {"angle_noise": 1e-3, "speed_noise": 0.05},
        {"encoder_step": 1e-3, "speed_sensor": False},
        {"encoder_step": 0.014},
        {"angle_noise": 1e-3, "delay": 3, "torque_limit": 2.0, "torque_noise": 0.3},
    ],
    ids=str,
)
@pytest.mark.parametrize("nlink", [1, 2, 4])
def test_no_honest_plant_is_called_a_liar(nlink: int, faults: dict[str, float]) -> None:
    """Heterogeneous chains whose nominal model is a third off; coasting, swinging and falling; noise, coarse encoders,
    speeds that lag, late and weak torques.
    """
    random = np.random.default_rng([nlink, len(faults)])
    links = random_links(nlink, 0)
    plant = MujocoPlant("honest", PlantSettings(links=links, faults=FaultSettings.model_validate(faults)))
    nominal = replace(plant.chain, mass=plant.chain.mass * random.uniform(0.75, 1.33, nlink))
    horizon = 1.5 * natural_time(nominal, plant.gravity)
    pushes = rich_pushes(random_plant(nlink, 0), 2, 1.0 / horizon, 0)
    steps = round(horizon / plant.timestep)
    episode = Episode(pushes, steps, FallRule(np.pi), calibration=calibration_of(plant, nominal, pushes))
    size = len(plant.chain.lumps.vector)
    for factors in (np.ones(size), 1.0 + 1e-3 * random.standard_normal(size), *random.uniform(0.5, 2.0, (3, size))):
        run_stepwise(FaultyPlant(plant), plant.chain.lumps.scaled(factors), episode)


def test_joint_that_turns_back_within_a_step_of_a_coarse_encoder_has_not_stopped() -> None:
    """It comes at 4 rad/s and goes again, at 80 rad/s², while 30 mrad show nothing for 50 ms."""
    plant = MujocoPlant("honest", PlantSettings.model_validate({"links": [{"length": 0.4, "mass": 1.0}]}))
    step, start, slowing = 0.03, 8.0, 80.0
    nothing, times = np.zeros(1), plant.timestep * np.arange(150)
    for phase in np.linspace(0.0, step, 60):
        calibration = Calibration(np.array([[start]]), np.array([[1.0]]), nothing, nothing, plant.chain, plant.gravity)
        check = calibration.check(plant, 0, {})
        for time in times:
            angle, speed = start * time - 0.5 * slowing * time**2, start - slowing * time
            read = np.array([step * np.round((angle + phase) / step)]), np.array([speed])
            check.begin(*read) if time == 0.0 else check.step(*read, np.array([-4.0]))


def test_calibration_measures_noise_and_spread() -> None:
    """The noise of 1 mrad to a fifth, the spread of 2 % of every impulse to a half; nothing where there is none."""
    nominal = MujocoPlant("nominal", PlantSettings.model_validate({"links": lies.PLANT["links"]})).chain
    for kind, noise, spread in (("exact", 0.0, 0.0), ("noisy", 1e-3, 0.02)):
        rig = Liar(STEPS, **NOISE[kind])
        with listening(rig) as address:
            plant = SocketPlant("rig", SocketSettings(socket=address, joints=2, step_timeout=30.0))
            pushed = calibrate_chain(plant, nominal, rich_pushes(plant, 4, 3.3, seed=1), 1)
            plant.close()
        assert pushed.angle_noise == pytest.approx([noise] * 2, rel=0.2)
        assert pushed.push_noise == pytest.approx(spread, rel=0.5)


def test_how_pushes_differ_is_measured_though_torques_are_rough(tmp_path: Path) -> None:
    """Noise of the torques moves lighter links at rest more than their pushes differ, and not yet right after these."""
    lengths = (0.5, 0.3, 0.3, 0.25, 0.2)
    (tmp_path / "links.toml").write_text("".join(f"[[links]]\nlength = {each}\nmass = 0.7\n" for each in lengths))
    links = [{"length": each, "mass": 0.8} for each in lengths]
    nominal = MujocoPlant("nominal", PlantSettings.model_validate({"links": links}))
    with bench(tmp_path / "links.toml", 0.002, torque_noise=0.3, start_speeds=0.02) as address:
        plant = SocketPlant("rig", SocketSettings(socket=address, joints=5, step_timeout=60.0))
        pushed = calibrate_chain(plant, nominal.chain, rich_pushes(nominal, 8, 2.0, seed=1), 1)
        plant.close()
    assert pushed.speed_noise[4] > 0.1
    assert pushed.push_noise == pytest.approx(0.02, rel=0.5)


def test_pushes_that_cannot_be_repeated_are_refused_when_a_study_is_created() -> None:
    """An estimate of such pushes would be worth nothing."""
    rig = Liar(STEPS, push_noise=0.6)
    with listening(rig) as address:
        plant = SocketPlant("rig", SocketSettings(socket=address, joints=2, step_timeout=30.0))
        nominal = MujocoPlant("nominal", PlantSettings.model_validate({"links": lies.PLANT["links"]})).chain
        with pytest.raises(PlantError, match=r"differs by .* from one time to the next"):
            calibrate_chain(plant, nominal, np.full((4, 2), 0.1), 1)
        plant.close()
