"""The options of a plant file: springs in joints, and the declared fault of receiving too large a torque."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from analytic_chain import simulate
from conftest import Finished, random_links

from metaid.compiled import CompiledLoop
from metaid.episode import Episode, FallRule, pushed_speeds, run_stepwise, tip_push
from metaid.errors import PlantError
from metaid.models import ChainModel, Lumps
from metaid.plant import LinkSettings, MujocoPlant, PlantSettings, Start, load_plant

STIFFNESS = np.array([0.3, 0.05])
FAULT = 0.02


@pytest.fixture
def faulty() -> MujocoPlant:
    """Two links with a spring in each joint and a fault."""
    links = random_links(2, seed=1)
    sprung = tuple(link.model_copy(update={"stiffness": k}) for link, k in zip(links, STIFFNESS.tolist(), strict=True))
    return MujocoPlant("faulty", PlantSettings(links=sprung, over_compensation=FAULT))


def test_plant_is_loaded_of_a_dict_as_of_a_file(tmp_path: Path) -> None:
    """The same chain; what is wrong in it is said as of a file."""
    links = [{"length": 0.3, "mass": 0.5}, {"length": 0.2, "mass": 0.4}]
    (tmp_path / "mine.toml").write_text(tomli_w.dumps({"links": links, "gravity": 3.7}))
    mine = load_plant({"links": links, "gravity": 3.7})
    assert mine.settings == load_plant(tmp_path / "mine.toml").settings
    with pytest.raises(PlantError, match=r"^dict: links: entry 2: mass: should be .*, not -1$"):
        load_plant({"links": [links[0], links[1] | {"mass": -1}]})


def test_springs_and_over_compensation_are_what_they_say(faulty: MujocoPlant) -> None:
    """The motion is that of Newton's equations with −k q in each joint and gravity factors larger by the fault."""
    candidate = faulty.chain.lumps.scaled(np.array([1.05, 1.1, 0.9]))
    received = Lumps(candidate.gravity + FAULT * faulty.chain.lumps.gravity, candidate.coriolis)
    pushes = tip_push(faulty, 0.1)
    _, trajectory = run_stepwise(faulty, candidate, Episode(pushes, 2000, FallRule(1e9)))
    law = lambda q, v: ChainModel(received, faulty.gravity).torque(q, v) - STIFFNESS * q  # noqa: E731
    expected = simulate(faulty.chain, faulty.gravity, faulty.timestep, 2000, pushed_speeds(faulty, pushes)[0], law)
    assert np.abs(trajectory.angles - expected).max() < 1e-9


def test_compiled_loop_honours_both(faulty: MujocoPlant) -> None:
    """Joint angles are those of the plain loop."""
    episode = Episode(tip_push(faulty, 0.1), 2000, keep_angles=True)
    candidate = faulty.chain.lumps.scaled(np.array([1.05, 1.1, 0.9]))
    (compiled,), (plain,) = (
        CompiledLoop(faulty, episode).run(candidate).angles,
        run_stepwise(faulty, candidate, episode)[0].angles,
    )
    assert np.abs(compiled - plain).max() < 1e-9


def test_fault_does_not_change_the_true_lumps(faulty: MujocoPlant) -> None:
    """The truth is the chain's; the fault is what a search is deceived by."""
    assert (
        faulty.chain.lumps.vector == MujocoPlant("p", PlantSettings(links=random_links(2, 1))).chain.lumps.vector
    ).all()


def test_spring_too_stiff_for_the_timestep_is_refused() -> None:
    """A spring that turns a link in less than a step would be guessed, not simulated."""
    stiff = random_links(1, seed=1)[0].model_copy(update={"stiffness": 1e4})
    with pytest.raises(PlantError, match="too long for its fastest motion"):
        MujocoPlant("stiff", PlantSettings(links=(stiff,)))


def test_show_names_springs_and_fault(metaid: Callable[..., Finished]) -> None:
    """What was fitted stands in the plant, by name."""
    shown = json.loads(metaid("plant", "show", "paper-like-two-link", "--json").out)
    assert shown["over_compensation"] == 0.0085
    assert [link["stiffness"] for link in shown["links"]] == [0.0, 0.05]
    assert "gravity factors larger by 0.0085" in " ".join(metaid("plant", "show", "paper-like-two-link").out.split())


def link(**changes: float) -> LinkSettings:
    """A rod of a metre and a kilogram, but for `changes`."""
    return LinkSettings(**{"length": 1.0, "mass": 1.0, **changes})


def test_inertia_below_what_the_mass_allows_is_refused_with_the_least() -> None:
    """A body has a radius of gyration, of at least a thousandth of its link; one that has just that is allowed."""
    with pytest.raises(ValueError, match=r"inertia 9e-07 is below what the mass allows.* at least 1e-06 kg m²"):
        link(inertia=0.9e-6)
    assert link(inertia=1e-6).inertia == 1e-6


@pytest.mark.parametrize(
    "nothing", [{"length": 0.0}, {"mass": 0.0}, {"mass": -1.0}, {"length": 5e-324}, {"com": 0.0}, {"com": 5e-324}]
)
def test_link_of_no_length_or_mass_is_refused(nothing: dict[str, float]) -> None:
    """Nor one so small that squares of it are nothing."""
    with pytest.raises(ValueError, match=r"greater than|at least"):
        link(**nothing)


def test_chain_whose_mass_matrix_is_singular_is_refused() -> None:
    """Links that weigh nothing beside what they carry leave their joints' motion to rounding."""
    with pytest.raises(PlantError, match="mass matrix is singular"):
        MujocoPlant("feather", PlantSettings(links=(link(mass=1e-6), link(mass=1e-6), link(mass=1e6))))


def test_timestep_too_long_for_gravity_or_damping_is_refused_with_the_longest() -> None:
    """The longest that is named is allowed, and a little more is not."""
    damped = link(damping=50.0), link(damping=20.0)
    for settings, links, what in (({"gravity": 9.81}, (link(),), "rad/s"), ({}, damped, "damping of its joints")):
        with pytest.raises(PlantError, match=rf"too long for .*{what}.*allowed: at most [\d.]+ s") as refusal:
            MujocoPlant("fast", PlantSettings(links=links, timestep=0.1, **settings))
        longest = float(str(refusal.value).split("at most ")[1].split(" s")[0])
        MujocoPlant("fast", PlantSettings(links=links, timestep=0.97 * longest, **settings))
        with pytest.raises(PlantError, match="too long for"):
            MujocoPlant("fast", PlantSettings(links=links, timestep=1.06 * longest, **settings))


def test_damped_chain_at_its_longest_timestep_comes_to_rest() -> None:
    """What the check lets through does not blow up."""
    plant = MujocoPlant("slow", PlantSettings(links=(link(damping=50.0), link(damping=20.0)), timestep=0.0028))
    plant.push(Start.upright(np.array([0.0, 0.5])))
    weightless = ChainModel(plant.chain.lumps, plant.gravity).torque(*plant.states())
    for _ in range(5000):
        plant.apply_torque(weightless)
        plant.step()
        weightless = ChainModel(plant.chain.lumps, plant.gravity).torque(*plant.states())
    assert np.abs(plant.states()[1]).max() < 1e-6
