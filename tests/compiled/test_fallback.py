"""What happens where the compiled loop cannot be trusted, and on plants that are not MuJoCo's."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import random_plant

from metaid.compiled import CompiledLoop, Objective
from metaid.episode import Episode, rich_pushes
from metaid.models import Array
from metaid.plant import MujocoPlant, Plant, Start


class Rig:
    """A plant that only answers to the interface, as hardware would; here another MuJoCo plant stands behind it."""

    def __init__(self, inner: MujocoPlant) -> None:
        self._inner = inner
        self.name, self.njoint, self.timestep, self.gravity = "rig", inner.njoint, inner.timestep, inner.gravity

    def push(self, start: Start) -> None:
        self._inner.push(start)

    def states(self) -> tuple[Array, Array]:
        return self._inner.states()

    def apply_torque(self, torque: Array) -> None:
        self._inner.apply_torque(torque)

    def step(self) -> None:
        self._inner.step()

    def stop(self) -> None:
        self._inner.stop()

    def close(self) -> None:
        self._inner.close()


def test_plant_behind_the_interface_gives_the_same_outcomes() -> None:
    """Six methods and four attributes are all that an episode needs of a plant."""
    inner = random_plant(2)
    rig = Rig(random_plant(2))
    assert isinstance(rig, Plant)
    episode = Episode(rich_pushes(rig, 4, 4.0, seed=1), 150)
    nominal = inner.chain.lumps
    compiled, plain = (Objective(plant, nominal, episode, "spectral") for plant in (inner, rig))
    for factors in (np.array([1.1, 0.9, 1.2]), np.ones(3), np.array([0.6, 0.6, 1.0])):
        one, other = compiled.evaluate(factors), plain.evaluate(factors)
        assert (one.fell, one.steps, one.periods) == (other.fell, other.steps, other.periods)
        assert one.value == pytest.approx(other.value, rel=1e-9, abs=1e-9)


def test_compiled_loop_that_disagrees_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong compiled loop is found out at start-up, said so, and the plain loop gives the right outcome."""
    plant = random_plant(2)
    episode = Episode(rich_pushes(plant, 2, 4.0, seed=1), 60)
    factors = np.array([1.1, 0.9, 1.2])
    right = Objective(plant, plant.chain.lumps, episode, "spectral").evaluate(factors)
    true_run = CompiledLoop.run
    monkeypatch.setattr(
        CompiledLoop, "run", lambda self, candidate: true_run(self, candidate.scaled(1.05 * np.ones(3)))
    )
    with pytest.warns(UserWarning, match="compiled loop disagrees"):
        wrong = Objective(plant, plant.chain.lumps, episode, "spectral")
    assert wrong.evaluate(factors).value == pytest.approx(right.value, rel=1e-9)


@pytest.mark.parametrize("factor", [30.0, 1e3])
def test_diverging_candidate_is_a_fall_and_leaves_no_log_behind(factor: float, tmp_path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    """However wild the torques, the episode ends as a fall with a finite value, and MuJoCo writes no log file."""
    monkeypatch.chdir(tmp_path)
    plant = random_plant(3)
    objective = Objective(plant, plant.chain.lumps, Episode(rich_pushes(plant, 2, 4.0, seed=1), 500), "spectral")
    for factors in (np.full(6, factor), np.array([1, 1, 1, factor, factor, factor])):
        outcome = objective.evaluate(factors)
        assert outcome.fell
        assert np.isfinite(outcome.value)
        assert outcome.value > 0.5 / plant.timestep
    assert objective.evaluate(np.ones(6)).value < 1e-9
    assert list(tmp_path.iterdir()) == []
