"""Friction in the joints: what it does to a plant, in the law, and that its lumps are found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chain_studies import chain_study, random_chain
from conftest import best_error, rubbing_plant

from metaid import api, results
from metaid.compiled import Objective
from metaid.episode import Episode, pushed_speeds, rich_pushes, run_stepwise
from metaid.errors import StudyError
from metaid.models import IDEAL, ChainModel, Lumps, compensation_basis
from metaid.plant import MujocoPlant, Start
from metaid.store import Store
from metaid.study import Problem, create_study, load_study, run_study

pytestmark = pytest.mark.slow

ALL = (*IDEAL, "damping", "coulomb")
TRIALS_ALONE = {"estimate.enabled": False}  # where only the best trial is looked at


def energy(plant: MujocoPlant) -> float:
    """Kinetic and potential energy, in J, from the lumps."""
    angles, speeds = np.cumsum(plant.data.qpos), np.cumsum(plant.data.qvel)
    kinetic = 0.5 * speeds @ plant.chain.mass_matrix(angles) @ speeds
    return float(kinetic + plant.gravity * plant.chain.lumps.gravity @ np.cos(angles))


@pytest.mark.parametrize("friction", [{"damping": 0.05}, {"damping": 0.0, "frictionloss": 0.05}], ids=str)
def test_friction_takes_energy_from_a_swinging_chain(friction: dict[str, float]) -> None:
    """Left alone, it has less energy at every twentieth of a second; without friction it keeps what it has."""

    def lost(plant: MujocoPlant) -> np.ndarray:
        plant.push(Start.upright(rich_pushes(plant, 1, 3.0, seed=1)[0]))
        energies = [energy(plant)]
        for _ in range(8):
            for _ in range(500):
                plant.step()
            energies.append(energy(plant))
        return -np.diff(energies)

    kept = np.abs(lost(rubbing_plant(3, damping=0.0, timestep=1e-4))).max()
    assert (lost(rubbing_plant(3, **friction, timestep=1e-4)) > 5 * kept).all()


@pytest.mark.parametrize("nlink", [1, 3, 5])
@pytest.mark.parametrize("friction", [{"damping": 0.05}, {"damping": 0.02, "frictionloss": 0.05}], ids=str)
def test_chain_coasts_when_its_friction_is_compensated_too(nlink: int, friction: dict[str, float]) -> None:
    """With all true lumps nothing accelerates; without those of friction it is slowed down."""
    plant = rubbing_plant(nlink, **friction)
    episode = Episode(rich_pushes(plant, 2 * nlink, 3.0, seed=1), 150)
    every, ideal = plant.true_lumps(), plant.chain.lumps
    assert every is not None
    exact, slowed = (Objective(plant, lumps, episode, "spectral") for lumps in (every, ideal))
    assert exact.evaluate(np.ones(len(every.vector))).value < 1e-6
    assert slowed.evaluate(np.ones(len(ideal.vector))).value > 0.01


@pytest.mark.parametrize("nlink", [1, 2, 5])
def test_law_with_friction_and_inertia_is_linear_in_all_its_lumps(nlink: int) -> None:
    """The basis that H is taken of, times the lumps, is the law that is sent."""
    kinds, random = (*ALL, "inertia"), np.random.default_rng(4)
    lumps = rubbing_plant(nlink, 0.03, 0.1).chain.lumps_of(kinds)
    angles, speeds = random.uniform(-2, 2, nlink), random.uniform(-5, 5, nlink)
    leaning = np.cumsum(angles)
    force = compensation_basis(leaning, np.cumsum(speeds), 9.81, kinds, -30.0 * leaning) @ lumps.vector
    torque = ChainModel(lumps, 9.81, stiffness=30.0).torque(angles, speeds)
    assert np.cumsum(force[::-1])[::-1] == pytest.approx(torque)


def test_compiled_law_is_the_plain_one_with_every_term() -> None:
    """Friction of both kinds, a stiffness and inertia lumps, near the truth and off it."""
    plant = rubbing_plant(3, 0.02, 0.03)
    episode = Episode(rich_pushes(plant, 2, 3.0, seed=1), 150, stiffness=100.0)
    truth = plant.chain.lumps_of((*ALL, "inertia"))
    objective = Objective(plant, truth, episode, "spectral")
    for factors in 1.0 + 0.1 * np.random.default_rng(1).uniform(-1.0, 1.0, (3, len(truth.vector))):
        compiled = objective.record(factors)
        plain, _ = run_stepwise(plant, truth.scaled(factors), episode)
        assert compiled.fall_step is plain.fall_step is None
        assert np.allclose(compiled.acceleration_energy, plain.acceleration_energy, rtol=1e-6)
        assert np.allclose(compiled.speed_energy, plain.speed_energy, rtol=1e-6)


@pytest.mark.parametrize("frictionloss", [0.0, 0.02])
def test_sensitivity_to_friction_is_what_the_plant_shows(frictionloss: float) -> None:
    """Near the truth the squared measure is κ |z|², for friction lumps as for the others."""
    plant = rubbing_plant(3, 0.03, frictionloss)
    searched = plant.chain.kinds
    spec = load_study("full-three-link")
    search = spec.study.search.model_copy(update={"lumps": searched})
    study = spec.study.model_copy(update={"search": search})
    known = {"plant": plant.settings, "nominal": plant.settings.links, "study": study}
    problem = Problem(spec.model_copy(update=known))
    objective, metric = problem.make_objective(), problem.metric
    assert metric.curvature is not None
    for z in 1e-4 * np.random.default_rng(1).normal(size=(5, len(problem.names))):
        value = objective.evaluate(metric.factors(z)).value
        assert value**2 == pytest.approx(metric.curvature * float(z @ z), rel=0.05)


def test_law_of_a_study_that_does_not_search_friction_has_none() -> None:
    """Whatever the nominal model says of it: what is not searched is not believed either."""
    spec = load_study("full-three-link", {"search.lumps": ["gravity", "coriolis"]})
    problem = Problem(spec)
    assert problem.names == Problem(load_study("three-link-coast")).names
    assert problem.robot.lumps.damping is None


def test_default_lumps_leave_the_trials_as_they_were(tmp_path: Path) -> None:
    """Naming the two kinds, in any order, is not naming any, to the last bit."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    for name, changes in (("one", {}), ("other", {"search.lumps": ["coriolis", "gravity"]})):
        create_study(store, load_study("three-link-coast", {**changes, **TRIALS_ALONE}), name)
        run_study(store, name, trials=60)
    assert results.trials_frame(store, "one").equals(results.trials_frame(store, "other"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"search.lumps": ["gravity"]}, "lumps: needs gravity and coriolis, each kind once"),
        ({"search.lumps": ["gravity", "coriolis", "damping", "damping"]}, "each kind once"),
        ({"search.lumps": ["gravity", "coriolis", "friction"]}, "'damping' or 'coulomb'"),
        ({"search.lumps": list(ALL)}, "frictionloss of link 1 is 0 in the nominal model"),
        ({"search.start": {"coulomb_1": 1.0}}, "unknown lump 'coulomb_1'"),
    ],
)
def test_lumps_that_cannot_be_searched_are_refused(changes: dict[str, Any], message: str) -> None:
    """One line that says what is allowed."""
    with pytest.raises(StudyError, match=message):
        load_study("full-three-link", changes)


def test_shipped_study_identifies_the_full_dynamics(tmp_path: Path) -> None:
    """All lumps of A, c and g, and friction, from a nominal model whose every parameter but length is far off; computed
    torque with them tracks as well as with the truth.
    """
    spec = load_study("full-three-link")
    for true, believed in zip(spec.plant.links, spec.nominal, strict=True):  # type: ignore[union-attr]
        for parameter, least in (("mass", 0.2), ("com", 0.1), ("inertia", 0.25), ("damping", 0.25)):
            assert abs(getattr(believed, parameter) / getattr(true, parameter) - 1.0) > least
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, spec)
    run_study(store, spec.name)
    shown = results.summary(store, spec.name)
    assert shown["verdict"] == "found"
    assert len(shown["lumps"]) == 12
    assert shown["max_error"] < 1e-6
    nominal, identified, true = api.validate(spec.name, store.url, pushes=2).models
    assert identified.rms_of() == pytest.approx(true.rms_of(), rel=0.05)
    assert nominal.rms_of() > 20 * true.rms_of()


def test_a_push_coasts_with_the_identified_friction_and_not_without(tmp_path: Path) -> None:
    """cmaes finds the friction of a damped chain, from a nominal model wrong by 30 %, in plain coordinates too."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    changes = {"sampler": "cmaes", "trials": 1200, "search.lumps": [*IDEAL, "damping"], **TRIALS_ALONE}
    for coordinates in ("nominal-metric", "plain"):
        spec = load_study("full-three-link", {**changes, "search.coordinates": coordinates})
        create_study(store, spec, coordinates)
        run_study(store, coordinates)
    assert best_error(store, "nominal-metric") < 0.01
    assert best_error(store, "plain") < 0.1


def test_friction_that_is_not_searched_biases_the_other_lumps(tmp_path: Path) -> None:
    """The search finds the best that a frictionless law can do, which is not the truth."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    changes = {"sampler": "cmaes", "trials": 300, "search.lumps": list(IDEAL), **TRIALS_ALONE}
    spec = load_study("full-three-link", changes)
    create_study(store, spec, "without")
    run_study(store, "without")
    shown = results.summary(store, "without")
    assert shown["best"]["value"] > 0.01
    assert best_error(store, "without") > 0.05
    assert shown["verdict"] == "not found"


def test_dry_friction_is_identified_beside_viscous(tmp_path: Path) -> None:
    """All 12 lumps of a three-link chain with both kinds, within 1 %."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    spec = load_study("full-three-link", {"sampler": "cmaes", "trials": 1500, **TRIALS_ALONE})
    dry = {
        "links": tuple(
            link.model_copy(update={"frictionloss": loss})
            for link, loss in zip(spec.plant.links, (0.15, 0.08, 0.04), strict=True)
        )
    }
    nominal = tuple(
        link.model_copy(update={"frictionloss": loss})
        for link, loss in zip(spec.nominal, (0.18, 0.06, 0.05), strict=True)
    )
    search = spec.study.search.model_copy(update={"lumps": ALL})
    study = spec.study.model_copy(update={"search": search})
    made = spec.model_copy(update={"plant": spec.plant.model_copy(update=dry), "nominal": nominal, "study": study})
    create_study(store, made, "dry")
    run_study(store, "dry")
    assert len(results.lumps_frame(store, "dry")) == 12
    assert best_error(store, "dry") < 0.01


def test_scaled_lumps_of_many_candidates_are_those_of_each() -> None:
    """Leading axes of the factors are leading axes of every lump, searched or not."""
    chain = rubbing_plant(3, 0.02, 0.03).chain
    lumps: Lumps = chain.lumps_of((*IDEAL, "damping"))
    factors = np.random.default_rng(1).uniform(0.5, 2.0, (4, len(lumps.vector)))
    many = lumps.scaled(factors)
    for i, row in enumerate(factors):
        one = lumps.scaled(row)
        for kind in ("gravity", "coriolis", "damping", "coulomb", "inertia"):
            assert (many.of(kind)[i] == one.of(kind)).all()


def test_push_speeds_do_not_know_friction() -> None:
    """An impulse is over before friction can act."""
    pushes = rich_pushes(rubbing_plant(3, 0.0), 2, 3.0, seed=1)
    assert (pushed_speeds(rubbing_plant(3, 0.1, 0.1), pushes) == pushed_speeds(rubbing_plant(3, 0.0), pushes)).all()


def test_friction_that_nobody_knows_is_found_though_pushes_differ(tmp_path: Path) -> None:
    """42 pushes leave no doubt of it: a fit begins where it ends, but for the speeds that pushes start with."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    fine = {"angle_noise": 1e-4, "speed_sensor": False, "push_noise": 0.02}
    wanted = {"trials": 2, "seed": 27, "estimate": {"faults": "proposed"}}
    episode = {"measure": "smoothed", "count": 21}
    create_study(store, chain_study(random_chain(2, 27), fine, {"damping": 0.05}, episode=episode, **wanted), "rubbing")
    run_study(store, "rubbing")
    verdict = results.read_snapshot(store, "rubbing").verdict
    assert verdict.word == "found"
    assert (verdict.lumps["identified"] / verdict.lumps["true"] - 1.0).abs().max() < 1e-4
