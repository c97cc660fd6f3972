"""Samplers that minimise the kinetic measure of an arm: their metric, their verdict, and that they resume."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from conftest import Finished, made_once

from metaid import api, results
from metaid.store import Store
from metaid.study import Problem, create_study, load_study, run_study

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]
# One hinge about a tilted axis: five base parameters.
SWING = """<mujoco><worldbody><body pos="0 0 1"><joint name="swing" axis="0 1 0.2" range="-170 170" armature="0.02"
damping="0.1"/><geom type="capsule" fromto="0 0 0 0.1 0 -0.5" size="0.03" mass="{mass}"/></body></worldbody></mujoco>"""
STUDY = """plant = "swing.toml"
nominal = "believed.toml"
sampler = "{sampler}"
trials = {trials}
[episode]
coasts = 8
springs = 4
[estimate]
enabled = {enabled}
"""


def write_study(folder: Path, sampler: str, trials: int, enabled: bool = False) -> Path:
    """A study of a small arm, whose nominal arm is a third too light, in a `folder`."""
    for name, mass in (("swing", 2.0), ("believed", 1.4)):
        (folder / f"{name}.xml").write_text(SWING.format(mass=mass), encoding="utf-8")
        (folder / f"{name}.toml").write_text(f'mjcf = "{name}.xml"\n', encoding="utf-8")
    path = folder / f"{sampler}.toml"
    path.write_text(STUDY.format(sampler=sampler, trials=trials, enabled=str(enabled).lower()), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DB of real runs of CMA-ES without an estimate, not to be changed: `long`, and `short`, which was cut off."""

    def make(folder: Path) -> None:
        with closing(Store(str(folder / "arms.db"), create=True)) as store:
            for name, trials in (("long", 600), ("short", 8)):
                run_study(store, create_study(store, load_study(write_study(folder, "cmaes", trials)), name))

    return made_once(tmp_path_factory, "minimised-arms", make) / "arms.db"


def test_kinetic_measure_grows_away_from_the_truth_as_its_sensitivity_says() -> None:
    """By the mass matrix of the true arm: (2π f)² = δᵀ H δ (Eq. 62)."""
    spec = load_study("spatial-three-link")
    problem = Problem(spec)
    truth = problem.robot.prior.base.of(spec.plant.arm.tree.parameters)
    h = problem.robot.sensitivity(truth)
    error = 1e-4 * problem.robot.prior.root @ np.random.default_rng(0).standard_normal(len(truth))
    with closing(problem.make_objective()) as objective:
        value = objective.evaluate(truth + error).value
    assert value == pytest.approx(np.sqrt(error @ h @ error) / (2.0 * np.pi), rel=0.02)


def test_coordinates_are_as_wide_as_what_is_believed_and_give_the_distance_to_the_truth() -> None:
    """A coordinate's root mean square beforehand is 0.3, and the measure says how far the truth is (Eq. 63)."""
    spec = load_study("spatial-three-link", {"sampler": "cmaes"})
    problem = Problem(spec)
    inverse = np.linalg.inv(problem.coordinates.spread)
    believed = inverse @ problem.robot.prior.covariance @ inverse.T
    assert np.sqrt(np.trace(believed) / len(believed)) == pytest.approx(0.3, rel=0.01)
    assert problem.coordinates.curvature is not None
    truth = problem.robot.prior.base.of(spec.plant.arm.tree.parameters)
    with closing(problem.make_objective()) as objective:
        value = objective.evaluate(problem.robot.prior.values).value
    distance = float(np.linalg.norm(problem.coordinates.z(truth)))
    assert 0.3 < value / np.sqrt(problem.coordinates.curvature) / distance < 3.0


def test_search_finds_an_arm_without_a_twin(searched: Path) -> None:
    """The best trial is the result: ranges that hold the truth, and no standard deviations."""
    with closing(Store(str(searched))) as store:
        shown, frame = results.summary(store, "long"), results.lumps_frame(store, "long")
    assert (shown["verdict"], shown["source"]) == ("found", "best trial")
    assert (shown["estimate"], shown["why_no_estimate"]) == (None, "[estimate] enabled is false")
    assert max(shown["model_error"].values()) < 1e-3
    known = frame[frame["determined"]]
    assert len(known) >= 3
    assert known["sd"].isna().all()
    assert ((known["low"] < known["true"]) & (known["true"] < known["high"])).all()


def test_search_that_was_cut_short_has_found_nothing(searched: Path) -> None:
    """No lump is known, and the reason names the value and what the measure can tell."""
    with closing(Store(str(searched))) as store:
        shown = results.summary(store, "short")
    assert (shown["verdict"], shown["source"]) == ("not found", "best trial")
    assert "that kinetic can tell from none" in shown["reasons"][0]
    assert all(lump["low"] is None and not lump["determined"] for lump in shown["lumps"])
    assert shown["model_error"] is None


def test_model_of_a_best_trial_can_be_taken_away(searched: Path) -> None:
    """With the base parameters of its law, and without a covariance."""
    found = api.model("long", str(searched))
    with closing(Store(str(searched))) as store:
        best = results.trials_frame(store, "long").sort_values("value", kind="stable").iloc[0]
    assert found.covariance is None
    assert found.lumps["value"].tolist() == best[found.lumps["name"].tolist()].tolist()


def test_minimising_trials_of_an_arm_do_not_depend_on_how_often_a_run_stopped(searched: Path, tmp_path: Path) -> None:
    """Nor on the number of workers: bit for bit."""
    with closing(Store(str(tmp_path / "again.db"), create=True)) as again, closing(Store(str(searched))) as store:
        name = create_study(again, load_study(write_study(tmp_path, "cmaes", 600)))
        run_study(again, name, trials=17)
        run_study(again, name, workers=2)
        assert results.trials_frame(again, name).to_csv() == results.trials_frame(store, "long").to_csv()


def test_estimate_is_the_result_of_any_sampler_unless_it_is_switched_off(tmp_path: Path) -> None:
    """A few trials of CMA-ES that show their motion tell all base parameters."""
    with closing(Store(str(tmp_path / "metaid.db"), create=True)) as store:
        name = create_study(store, load_study(write_study(tmp_path, "cmaes", 8, enabled=True)))
        run_study(store, name)
        shown = results.summary(store, name)
    assert (shown["verdict"], shown["source"], shown["estimate"]["known_from"]) == ("found", "estimate", 1)


def test_output_error_without_an_estimate_is_refused_in_one_line(metaid: Metaid, tmp_path: Path) -> None:
    """It has nothing else to go by."""
    refused = metaid("study", "create", str(write_study(tmp_path, "output-error", 4)))
    assert (refused.status, refused.out, refused.err.count("\n")) == (2, "", 1)
    assert "sampler 'output-error' needs an estimate" in refused.err
