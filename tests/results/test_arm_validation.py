"""What an identified arm is worth: it coasts and tracks where the nominal one does not."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from arm_studies import spec_of
from conftest import Finished
from random_arm import random_arm, wrong_tree

import metaid as package
from metaid.compiled.spatial import QuickArm
from metaid.errors import StudyError
from metaid.models.tree import Tree, joint_mass_matrix, joint_torque
from metaid.plant import ArmPlant, ArmSettings, ArmStart
from metaid.plant.description import draw_free_starts
from metaid.results import Validation, smooth_sinusoids, track
from metaid.results.coasting import arm_coasting_steps
from metaid.results.validation import Validated

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]
STEPS = 60
TREES = random_arm(4, 1, friction=False), random_arm(3, 3, (1,))


def plant_of(tree: Tree) -> ArmPlant:
    """A plant that is this arm."""
    return ArmPlant("arm", ArmSettings(mjcf="arm.xml"), tree)


def coasted_stepwise(plant: ArmPlant, law: Tree, metric: Tree, start: ArmStart, share: float) -> int:
    """For how many steps a push coasts, in plain Python."""
    plant.push(start)
    for step in range(STEPS + 1):
        angles, speeds = plant.states()
        matrix, change = joint_mass_matrix(metric, angles), speeds - start.speeds
        if not change @ matrix @ change <= share**2 * start.speeds @ matrix @ start.speeds:
            return step - 1
        plant.apply_torque(joint_torque(law, angles, speeds, np.zeros(plant.njoint)))
        plant.step()
    return STEPS


@pytest.mark.parametrize("tree", TREES, ids=["hinges", "slide"])
def test_compiled_loop_of_an_arm_gives_the_numbers_of_plain_python(tree: Tree) -> None:
    """Of pushes that coast, with hinges and a slide, with and without dry friction."""
    plant, metric = plant_of(tree), wrong_tree(tree, 1)
    starts = draw_free_starts(tree, 3, 0.3, seed=1)
    for law in (tree, metric):
        expected = [coasted_stepwise(plant, law, metric, start, 0.1) for start in starts]
        assert arm_coasting_steps(plant, (law.parameters, metric), starts, STEPS).tolist() == expected
        assert (min(expected) == STEPS) == (law is tree)


@pytest.mark.parametrize("tree", TREES, ids=["hinges", "slide"])
def test_compiled_dynamics_of_an_arm_are_those_of_its_regressor(tree: Tree) -> None:
    """With hinges and a slide, with and without dry friction, of bodies that can be and of others."""
    random = np.random.default_rng(0)
    for parameters in (tree.parameters, -30.0 * tree.parameters):
        compiled, arm = QuickArm(tree, parameters), tree.with_parameters(parameters)
        for angles, speeds, accelerations in random.normal(size=(5, 3, tree.njoint)):
            expected = joint_torque(arm, angles, speeds, accelerations)
            assert compiled.inverse_dynamics(angles, speeds, accelerations) == pytest.approx(expected)
            np.testing.assert_allclose(compiled.mass_matrix(angles), joint_mass_matrix(arm, angles), atol=1e-12)


@pytest.mark.parametrize("tree", TREES, ids=["hinges", "slide"])
def test_computed_torque_of_an_arm_follows_the_trajectory(tree: Tree) -> None:
    """In MuJoCo, which knows nothing of the equations used here; a wrong arm follows worse, a wild one is lost."""
    plant, truth, missed = plant_of(tree), QuickArm(tree, tree.parameters), []
    desired = smooth_sinusoids(tree.njoint, 0.1, plant.timestep, amplitude=0.1)
    start = ArmStart(desired.angles[0], np.zeros(tree.njoint))
    for law in (tree, wrong_tree(tree, 1)):
        seen = track(plant, start, QuickArm(tree, law.parameters), truth, desired, 10.0)
        missed.append(np.abs(seen - desired.angles).max())
    assert missed[0] < 0.1 * missed[1]
    wild = track(plant, start, QuickArm(tree, -300.0 * tree.parameters), truth, desired, 10.0)
    assert len(wild) < len(desired.angles)


def test_coasts_of_a_validation_stay_in_the_ranges_and_are_others_than_those_of_the_search(arms: Path) -> None:
    """Even with equal seeds; another seed means others."""
    spec, seen = spec_of(), []
    tree = spec.nominal.tree
    for seed in (0, 1):
        pushes = package.validate("exact", str(arms), pushes=8, seed=seed).pushes
        for when in (0.0, 1.0):
            assert (tree.low <= pushes[:, 0] + when * pushes[:, 1]).all()
            assert (pushes[:, 0] + when * pushes[:, 1] <= tree.high).all()
        seen.append(pushes)
    searched = np.array([start.pose for start in spec.starts])
    assert not np.isclose(seen[0], seen[1]).any()
    assert not np.isclose(seen[0][:, None, 0], searched).any()


def test_identified_arm_coasts_and_tracks_as_the_true_one_and_the_nominal_does_not(arms: Path, metaid: Metaid) -> None:
    """On the command line, as JSON, as a table and as a figure."""
    storage = ("--storage", str(arms))
    shown = json.loads(metaid("study", "validate", "exact", *storage, "--pushes", "3", "--json", "-o", "t.png").out)
    models = {row["model"]: row for row in shown["models"]}
    assert models["identified"]["coasting_whole_horizon"] == models["true"]["coasting_whole_horizon"] == 3
    assert models["nominal"]["coasting_s"] < 0.2 * models["identified"]["coasting_s"]
    for key in ("tracking_rms_deg", "tracking_max_deg"):
        assert models["identified"][key] == pytest.approx(models["true"][key], rel=1e-3)
        assert models["identified"][key] < 0.1 * models["nominal"][key]
    assert shown == {"study": "exact", **package.validate("exact", str(arms), pushes=3).summary()}
    assert Path("t.png").read_bytes().startswith(b"\x89PNG")
    table = metaid("study", "validate", "exact", *storage, "--pushes", "1").out
    assert all(word in table for word in ("nominal", "identified", "true", "coasting, s", "rms tracking error, °"))
    assert "√(l/g)" not in table


def test_arm_that_was_not_found_has_nothing_to_validate(arms: Path, metaid: Metaid) -> None:
    """One line says so and why, as of a chain; so it does of numbers that are not allowed."""
    refused = metaid("study", "validate", "bent", "--storage", str(arms), "-o", "t.png")
    assert (refused.status, refused.out, refused.err.count("\n")) == (2, "", 1)
    assert "'bent' has nothing to validate: its verdict is 'not found': the model does not explain" in refused.err
    assert not Path("t.png").exists()
    with pytest.raises(StudyError, match="1 to 1000 pushes"):
        package.validate("exact", str(arms), pushes=0)


def test_errors_of_slides_are_said_apart_in_millimetres() -> None:
    """And no error is said of a model that lost control."""
    errors = np.array([[0.1, 0.002], [-0.1, -0.004]])
    models = tuple(Validated(name, np.ones(1), errors, name == "nominal") for name in ("nominal", "identified"))
    shown = Validation("gantry", 0, np.zeros((1, 2, 2)), 0.002, 1.0, models, slides=np.array([False, True]))
    nominal, identified = shown.summary()["models"]
    assert nominal["tracking_rms_deg"] == nominal["tracking_max_deg"] == pytest.approx(np.degrees(0.1))
    assert nominal["tracking_max_mm"] == pytest.approx(4.0)
    assert nominal["tracking_rms_mm"] == pytest.approx(np.sqrt(10.0))
    assert {identified[f"tracking_{kind}"] for kind in ("rms_deg", "max_deg", "rms_mm", "max_mm")} == {None}
