"""The second stage: inertia lumps, from joints that are made to swing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from conftest import Finished, best_error, random_plant
from test_friction import rubbing_plant

from metaid import api, results
from metaid.compiled.objective import Objective
from metaid.episode.episode import Episode
from metaid.episode.pushes import rich_pushes
from metaid.episode.stepwise import run_stepwise
from metaid.errors import StorageError, StudyError
from metaid.models.lumps import IDEAL
from metaid.plant.mujoco_plant import MujocoPlant
from metaid.plant.settings import PlantSettings
from metaid.results.findings import read_findings
from metaid.results.snapshot import read_snapshot
from metaid.show.figures import Gallery
from metaid.store.database import Store
from metaid.study.create import create_study
from metaid.study.identifiability import identifiability
from metaid.study.kinds import load_chain_study
from metaid.study.problem import Problem
from metaid.study.progress import Progress
from metaid.study.run import run_study

Metaid = Callable[..., Finished]


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(str(tmp_path / "metaid.db"), create=True)


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A DB with the shipped study `full-three-link`, run; not to be changed."""
    store = Store(str(tmp_path_factory.mktemp("full") / "metaid.db"), create=True)
    create_study(store, load_chain_study("full-three-link"))
    run_study(store, "full-three-link")
    return store


@pytest.mark.parametrize("plant", [random_plant(1), random_plant(3), rubbing_plant(5)], ids=["1", "3", "damped 5"])
def test_every_joint_swings_at_the_root_of_the_stiffness(plant: MujocoPlant) -> None:
    """With all lumps exact a joint is where it started after each period, and in between follows the sinusoid."""
    stiffness, period = 400.0, 2 * np.pi / 20.0
    steps = round(3 * period / plant.timestep)
    lumps = plant.chain.lumps_of((*plant.chain.kinds, "inertia"))
    episode = Episode(rich_pushes(plant, 1, 3.0, seed=1), steps, stiffness=stiffness)
    record, seen = run_stepwise(plant, lumps, episode)
    times = plant.timestep * np.arange(steps + 1)
    expected = seen.speeds[0] / 20.0 * np.sin(20.0 * times)[:, None]
    assert np.abs(seen.angles - expected).max() < 0.05 * np.abs(expected).max()  # the step is 1/25 of a radian
    assert (record.half_periods >= 5).all()
    crossings = record.half_periods / record.crossing_span / 2.0
    assert crossings == pytest.approx(20.0 / (2 * np.pi), rel=1e-3)


@pytest.mark.parametrize("timestep", [0.0005, 0.002, 0.008])
def test_truth_deviates_by_nothing_however_long_the_step(timestep: float) -> None:
    """The deviation is taken over a step from the state at its start, so Euler's own error is none of it."""
    plant = rubbing_plant(3, timestep=timestep)
    lumps = plant.chain.lumps_of((*plant.chain.kinds, "inertia"))
    episode = Episode(rich_pushes(plant, 6, 3.0, seed=1), round(0.3 / timestep), stiffness=400.0)
    objective = Objective(plant, lumps, episode, "spectral")
    assert objective.evaluate(np.ones(len(lumps.vector))).value < 1e-6


def test_sensitivity_to_inertia_is_what_the_plant_shows() -> None:
    """Near the truth the squared deviation is κ |z|² in the second stage too."""
    spec = load_chain_study("full-three-link")
    known = spec.model_copy(update={"nominal": spec.plant.links})  # type: ignore[union-attr]
    problem = Problem(known).stages()[1]
    objective, coordinates = problem.make_objective(), problem.coordinates
    assert coordinates.curvature is not None
    for z in 1e-4 * np.random.default_rng(1).normal(size=(5, 3)):
        value = objective.evaluate(coordinates.factors(z)).value
        assert value**2 == pytest.approx(coordinates.curvature * float(z @ z), rel=0.05)


@pytest.mark.parametrize(("study", "limit"), [("full-three-link", 0.01), ("full-five-link", 0.02)])
def test_shipped_studies_identify_the_full_dynamics(study: str, limit: float, store: Store) -> None:
    """All lumps of A, c and g, and friction, from a nominal model whose every parameter but length is far off."""
    spec = load_chain_study(study)
    for true, believed in zip(spec.plant.links, spec.nominal, strict=True):  # type: ignore[union-attr]
        for parameter, least in (("mass", 0.2), ("com", 0.1), ("inertia", 0.25), ("damping", 0.25)):
            assert abs(getattr(believed, parameter) / getattr(true, parameter) - 1.0) > least
    create_study(store, spec)
    run_study(store, study)
    shown = results.summary(store, study)
    n = len(spec.nominal)
    assert len(shown["lumps"]) == n * (n + 1) // 2 + 2 * n
    assert best_error(store, study) < limit
    assert max(abs(1.0 / lump["factor"] - 1.0) for lump in shown["lumps"]) > 0.25


@pytest.mark.parametrize("changes", [{"search.coordinates": "nominal-metric"}, {"search.coordinates": "plain"}])
def test_cmaes_identifies_the_full_dynamics_too(changes: dict[str, Any], store: Store) -> None:
    """In either coordinates, with more trials."""
    changes = {"sampler": "cmaes", "trials": 1800, "inertia.trials": 300, **changes}
    create_study(store, load_chain_study("full-three-link", changes))
    run_study(store, "full-three-link")
    assert best_error(store, "full-three-link") < 0.02


def test_study_of_an_ideal_chain_may_have_a_second_stage(store: Store) -> None:
    """Friction and inertia are asked for independently."""
    create_study(store, load_chain_study("three-link-coast", {"sampler": "newton", "inertia.trials": 60}))
    run_study(store, "three-link-coast")
    shown = results.summary(store, "three-link-coast")
    assert [lump["name"] for lump in shown["lumps"]][-3:] == ["inertia_1", "inertia_2", "inertia_3"]
    assert best_error(store, "three-link-coast") < 0.001


@pytest.mark.parametrize("stops", [(50,), (102, 105), (103,), (1, 99, 101, 117)])
@pytest.mark.parametrize("sampler", ["newton", "cmaes"])
def test_runs_stopped_in_either_stage_end_with_the_same_table(
    sampler: str, stops: tuple[int, ...], store: Store
) -> None:
    """By an interrupt or by a number of trials, before, at and after the boundary, on one worker and on two."""
    spec = load_chain_study("full-three-link", {"sampler": sampler, "trials": 102, "inertia.trials": 40})
    for name in ("whole", "parts", "counted"):
        create_study(store, spec, name)
    run_study(store, "whole")
    for stop in stops:

        def watch(progress: Progress, stop: int = stop) -> None:
            if progress.trials >= stop:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            run_study(store, "parts", workers=1, watch=watch)
        run_study(store, "counted", trials=stop, workers=1)
        assert len(results.trials_frame(store, "counted")) == stop
    whole = results.trials_frame(store, "whole")
    for name in ("parts", "counted"):
        run_study(store, name)
        assert results.trials_frame(store, name).equals(whole)
    assert whole["stage"].tolist() == [1] * 102 + [2] * (len(whole) - 102)
    assert len(whole) > 110


def test_trials_of_both_stages_are_one_optuna_study(full: Store) -> None:
    """Numbers go on; each trial has its stage and its own parameters."""
    study = optuna.load_study(study_name="full-three-link", storage=full.url)
    stages = [trial.user_attrs["stage"] for trial in study.trials]
    assert [trial.number for trial in study.trials] == list(range(len(stages)))
    assert stages == sorted(stages)
    assert set(stages) == {1, 2}
    for trial in study.trials:
        assert all(name.startswith("inertia") == (trial.user_attrs["stage"] == 2) for name in trial.params)
        assert len(trial.params) == (9 if trial.user_attrs["stage"] == 1 else 3)


def test_second_stage_takes_what_the_first_has_found(full: Store) -> None:
    """Its law holds the best lumps of the first, and it starts at inertia lumps as heavy as the gravity lumps were."""
    trials = results.trials_frame(full, "full-three-link")
    first, second = read_snapshot(full, "full-three-link").stages
    best = trials[trials["stage"] == 1].nsmallest(1, "value")
    assert second.problem.lumps.gravity == pytest.approx(
        best[["gravity_1", "gravity_2", "gravity_3"]].to_numpy()[0] * first.problem.lumps.gravity
    )
    start = trials[trials["stage"] == 2].iloc[0]
    for i in (1, 2, 3):
        assert start[f"inertia_{i}"] == pytest.approx(best[f"gravity_{i}"].item())


def test_contract_of_study_show_holds_with_two_stages(full: Store) -> None:
    """The fields of a study with one stage, as they were, and `stages` besides."""
    shown = results.summary(full, "full-three-link")
    fields = {"name", "plant", "sampler", "measure", "seed", "trials", "best", "lumps", "max_error"}
    fields |= {"verdict", "reasons", "source", "model_error", "misfit", "periods", "estimate", "why_no_estimate"}
    assert fields | {"stages"} == set(shown)
    first, second = shown["stages"]
    assert first["best"].items() <= shown["best"].items()
    assert (first["searched"], second["searched"]) == ([*IDEAL, "damping"], ["inertia"])
    assert first["trials"]["total"] + second["trials"]["total"] == shown["trials"]["total"]
    assert second["best"]["number"] >= first["trials"]["total"]
    assert all(lump["error"] is not None for lump in shown["lumps"])


def test_a_study_with_two_stages_is_shown_drawn_and_reported(store: Store, metaid: Metaid) -> None:
    """In the terminal, as a page with the figures of both stages, as CSV, and before it has begun."""
    spec = load_chain_study("full-three-link", {"trials": 100, "inertia.trials": 40})
    assert isinstance(spec.plant, PlantSettings)
    two = {"plant": spec.plant.model_copy(update={"links": spec.plant.links[:2]}), "nominal": spec.nominal[:2]}
    for name in ("finished", "new"):
        create_study(store, spec.model_copy(update=two), name)
    run_study(store, "finished")
    storage = ("--storage", store.url)
    shown = " ".join(metaid("study", "show", "finished", *storage).out.split())
    assert "inertia_2" in shown
    assert "damping_2" in shown
    assert "stage 2" in shown
    assert metaid("study", "report", "finished", *storage, "-o", "page.html").status == 0
    page = Path("page.html").read_text()
    assert "Second stage" in page
    assert all(f'id="figure-{name}"' in page for name in ("convergence", "inertia-convergence"))
    assert "inertia_2" in page
    assert "friction is not searched" not in page.lower()
    metaid("study", "export", "finished", *storage, "-o", "trials.csv")
    header = Path("trials.csv").read_text().partition("\n")[0].split(",")
    assert {"stage", "gravity_1", "inertia_1"} <= set(header)
    before = metaid("study", "show", "new", *storage)
    assert before.status == 0
    assert "inertia_1" in before.out


def test_figures_of_the_second_stage_are_of_its_own_trials(full: Store) -> None:
    """Each gallery sweeps the lumps of its stage."""
    found = read_findings(full, "full-three-link")
    assert found.second is not None
    assert found.names[-1] == "damping_3"
    assert found.second.names == ["inertia_1", "inertia_2", "inertia_3"]
    gallery = Gallery(found.second)
    assert [swept.lump for swept in gallery.sweeps] == [0, 1, 2]
    for swept in gallery.sweeps:
        best = swept.factors[np.nanargmin(swept.values)]
        assert best == pytest.approx(found.second.best_factors[swept.lump], abs=0.03)


def test_identified_inertia_is_what_validation_controls_with(full: Store) -> None:
    """Computed torque with all of A, c, g and friction tracks as well as with the truth."""
    nominal, identified, true = api.validate("full-three-link", full.url, pushes=2).models
    assert true.rms_error < 1e-3
    assert identified.rms_error == pytest.approx(true.rms_error, rel=0.05)
    assert nominal.rms_error > 20 * true.rms_error


def test_check_says_what_both_stages_can_determine(metaid: Metaid) -> None:
    """Before any trial, from the nominal model."""
    shown = metaid("study", "check", "full-three-link")
    assert shown.status == 0
    assert "inertia_3" in shown.out
    assert "NO" not in shown.out
    for problem in Problem(load_chain_study("full-five-link")).stages():
        assert max(identifiability(problem).resolution) < 0.03


def test_trials_of_the_second_stage_that_do_not_follow_are_refused(store: Store) -> None:
    """A changed factor of stage one changes what stage two should have been, and is noticed."""
    create_study(store, load_chain_study("full-three-link", {"trials": 40, "inertia.trials": 20}), "study")
    run_study(store, "study", trials=50)
    with store._engine.begin() as connection:
        connection.exec_driver_sql(
            "UPDATE trial_params SET param_value = param_value * 1.01 WHERE param_name = 'inertia_2'"
        )
    with pytest.raises(StorageError, match="trial 40 and on do not follow"):
        run_study(store, "study")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"episode.measure": "count"}, "a second stage needs the Coriolis lumps, so measure = 'spectral'"),
        ({"inertia.trials": 0}, "trials"),
        ({"inertia.stiffness": -1.0}, "stiffness"),
        ({"inertia.lumps": 3}, "unknown key 'lumps'"),
    ],
)
def test_second_stage_that_cannot_be_is_refused(changes: dict[str, Any], message: str) -> None:
    """One line that says what is allowed."""
    with pytest.raises(StudyError, match=message):
        load_chain_study("full-three-link", {"sampler": "cmaes", **changes})
