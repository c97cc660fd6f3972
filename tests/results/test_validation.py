"""What an identified model is worth: it coasts and tracks where the nominal one does not."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
from conftest import Finished, law_of, random_links, random_plant

import metaid as package
from metaid.episode import natural_time, rich_pushes
from metaid.errors import StudyError
from metaid.models import FRICTION, IDEAL, Array, ChainModel, Lumps
from metaid.plant import MujocoPlant, PlantSettings, Start
from metaid.results import smooth_sinusoids, track, validate_law
from metaid.results.coasting import coasting_steps
from metaid.results.courses import ChainCourse
from metaid.results.validation import Validated, fresh_seed
from metaid.study import Problem, load_study

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]


@pytest.fixture(scope="module")
def problem() -> Problem:
    """The shipped three-link-coast study."""
    return Problem(load_study("three-link-coast"))


def true_factors(problem: Problem) -> np.ndarray:
    """The factors at which the nominal lumps are the plant's."""
    return problem.open_plant().chain.lumps.vector / problem.nominal.lumps.vector


@pytest.mark.parametrize("nlink", [1, 2, 5])
def test_true_model_coasts_for_the_whole_horizon(nlink: int) -> None:
    """On any chain, and a model with 5 % more gravity does not."""
    plant = random_plant(nlink)
    truth = plant.chain.lumps
    heavier = Lumps(1.05 * truth.gravity, truth.coriolis)
    for impulses in rich_pushes(plant, 3, 4.0, fresh_seed(1, 0)):
        assert coasting_steps(plant, truth, impulses, 3000) == 3000
        assert coasting_steps(plant, heavier, impulses, 3000) < 3000


@pytest.mark.parametrize("nlink", [1, 2, 5])
def test_computed_torque_of_the_whole_truth_follows_the_trajectory(nlink: int) -> None:
    """To a fifth of a degree, in MuJoCo, which knows nothing of the equations used here."""
    plant = random_plant(nlink)
    model = ChainModel(plant.chain.lumps, plant.gravity)
    time = natural_time(plant.chain, plant.gravity)
    desired = smooth_sinusoids(nlink, time, plant.timestep)
    seen = track(plant, Start.upright(np.zeros(nlink)), model, model, desired, 3.0 / time)
    assert np.degrees(np.abs(seen - desired.angles)).max() < 0.2
    assert np.degrees(np.abs(desired.angles).max()) > 20


def test_computed_torque_is_the_inverse_of_mujocos_motion() -> None:
    """The torque for an acceleration gives that acceleration."""
    plant, random = random_plant(4), np.random.default_rng(1)
    model = ChainModel(plant.chain.lumps, plant.gravity)
    angles, speeds, accelerations = random.normal(size=(3, 4))
    plant.data.qpos[:], plant.data.qvel[:] = angles, speeds
    plant.apply_torque(model.inverse_dynamics(angles, speeds, accelerations))
    plant.step()
    assert (plant.states()[1] - speeds) / plant.timestep == pytest.approx(accelerations)


def test_trajectory_speeds_and_accelerations_are_derivatives_of_its_angles() -> None:
    """From rest upright, and smooth."""
    motion = smooth_sinusoids(3, 0.2, 1e-4)
    assert (motion.angles[0] == 0.0).all()
    assert (motion.speeds[0] == 0.0).all()
    for value, rate in ((motion.angles, motion.speeds), (motion.speeds, motion.accelerations)):
        np.testing.assert_allclose(np.gradient(value, 1e-4, axis=0)[1:-1], rate[1:-1], rtol=0, atol=1e-3)


def rough_plant(nlink: int, frictionloss: float) -> MujocoPlant:
    """A chain with viscous friction and springs, and with dry friction if wanted, that over-compensates."""
    table = {"damping": 0.02, "stiffness": 0.3, "frictionloss": frictionloss}
    links = tuple(link.model_copy(update=table) for link in random_links(nlink, seed=3))
    return MujocoPlant("rough", PlantSettings(links=links, over_compensation=0.01))


def coasted_stepwise(plant: MujocoPlant, lumps: Lumps, impulses: Array, steps: int) -> int:
    """For how many steps a push coasts, in plain Python."""
    plant.push(Start.upright(impulses))
    angles, pushed = plant.states()
    speeds = pushed
    for step in range(steps):
        plant.apply_torque(ChainModel(lumps, plant.gravity).torque(angles, speeds))
        plant.step()
        angles, speeds = plant.states()
        if not np.abs(speeds - pushed).max() <= 0.1 * np.abs(np.cumsum(pushed)).max():
            return step
    return steps


@pytest.mark.parametrize("frictionloss", [0.0, 0.02])
@pytest.mark.parametrize("nlink", [1, 3, 5])
def test_compiled_loop_gives_the_numbers_of_the_stepwise_one(nlink: int, frictionloss: float) -> None:
    """Of a push that coasts, with a model of ideal lumps and with one of friction."""
    plant = rough_plant(nlink, frictionloss)
    chain = plant.chain
    whole, ideal = chain.lumps_of((*IDEAL, *FRICTION)), chain.lumps
    for lumps in (whole, ideal, whole.scaled(np.full(len(whole.vector), 1.1))):
        for impulses in rich_pushes(plant, 3, 4.0, fresh_seed(1, 0)):
            expected = coasted_stepwise(plant, lumps, impulses, 300)
            assert coasting_steps(plant, lumps, impulses, 300) == expected
            assert 0 < expected <= 300


def test_validation_pushes_are_not_those_of_the_search(problem: Problem) -> None:
    """Even with equal seeds, and another seed means other pushes."""
    plant, seed = problem.open_plant(), problem.spec.study.seed
    one, other = (rich_pushes(plant, 6, 4.0, fresh_seed(seed, given)) for given in (seed, seed + 1))
    assert not np.isclose(one, other).any()
    assert not np.isclose(one, problem.episode.pushes).any()


def test_better_models_coast_longer_and_track_better(problem: Problem) -> None:
    """Nominal, then 1 % wrong, then the truth; and the same twice."""
    wrong = true_factors(problem) * (1 + 0.01 * np.array([1, -1, 1, -1, 1, -1]))
    validation = validate_law(problem, law_of(problem, wrong), pushes=4)
    nominal, identified, true = validation.models
    assert [shown.model for shown in validation.models] == ["nominal", "identified", "true"]
    assert np.median(nominal.coasting) < np.median(identified.coasting) < np.median(true.coasting)
    assert nominal.rms_of() > 2 * max(identified.rms_of(), true.rms_of())
    again = validate_law(problem, law_of(problem, wrong), pushes=4)
    assert again.summary() == validation.summary()


def test_model_that_loses_control_is_said_to(problem: Problem) -> None:
    """Gravity taken for its opposite throws the chain off, which is not passed off as tracking."""
    nominal = problem.nominal
    wild = Lumps(-200 * nominal.lumps.gravity, nominal.lumps.coriolis)
    errors, tracked = ChainCourse(problem.open_plant(), nominal, True, 1, 0).tracking(wild)
    assert not tracked
    assert np.isfinite(errors).all()
    assert np.isinf(Validated("wild", np.zeros(1), errors, tracked).rms_of())


def test_finished_study_coasts_ten_times_longer_than_its_nominal_model_and_tracks_better(metaid: Metaid) -> None:
    """On the command line, in Python, as JSON, as a table and as a figure."""
    metaid("study", "create", "three-link-coast")
    metaid("study", "run", "three-link-coast", "--quiet")
    shown = json.loads(metaid("study", "validate", "three-link-coast", "--pushes", "3", "--json", "-o", "t.png").out)
    models = {row["model"]: row for row in shown["models"]}
    assert models["identified"]["coasting_s"] > 10 * models["nominal"]["coasting_s"]
    assert models["true"]["coasting_whole_horizon"] == 3
    for key in ("tracking_rms_deg", "tracking_max_deg"):
        assert models["identified"][key] < 0.5 * models["nominal"][key]
    assert shown == {"study": "three-link-coast", **package.validate("three-link-coast", pushes=3).summary()}
    with open("t.png", "rb") as file:
        assert file.read(4) == b"\x89PNG"
    table = metaid("study", "validate", "three-link-coast", "--pushes", "1", "--seed", "3").out
    assert all(word in table for word in ("nominal", "identified", "true"))


def test_impossible_validations_are_refused_in_one_line(metaid: Metaid, problem: Problem) -> None:
    """No such study, nothing survived yet, impossible numbers; nothing is written."""
    metaid("study", "create", "three-link-coast")
    for arguments, word in (
        (("nowhere",), "three-link-coast"),
        (("three-link-coast", "-o", "t.png"), "0 of 600 trials are done"),
        (("three-link-coast", "--pushes", "0"), "0"),
        (("three-link-coast", "--seed", "-1"), "-1"),
    ):
        refused = metaid("study", "validate", *arguments)
        assert refused.status == 2
        assert word in refused.err
        assert len(refused.err.strip().splitlines()) == 1
        assert refused.out == ""
    with pytest.raises(StudyError, match="1 to 1000"):
        validate_law(problem, law_of(problem, np.ones(6)), pushes=0)


def test_truth_is_left_out_where_the_plant_does_not_know_it() -> None:
    """Nominal and identified alone."""
    spec = load_study("three-link-coast")
    secret = spec.model_copy(update={"plant": spec.plant.model_copy(update={"truth_known": False})})
    models = validate_law(Problem(secret), law_of(Problem(secret), np.ones(6)), pushes=1).models
    assert [shown.model for shown in models] == ["nominal", "identified"]
