"""What follows from a study's settings: made once, and pushing nothing before that is asked for."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import Finished

from metaid.errors import StudyError
from metaid.study import Problem, load_study, problem_of
from metaid.study import chain as module
from metaid.study.reading import read_study

Metaid = Callable[..., Finished]


def test_problem_pushes_nothing_before_its_episode_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor does a plant at rest show its noise."""
    asked: list[str] = []
    for name in ("make_episode", "rest_noise"):
        whole = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given, n=name, w=whole: (asked.append(n), w(*given))[1])
    problem = Problem(load_study("noisy-three-link", {"seed": 77}))
    assert problem.names
    asked.clear()
    problem = Problem(problem.spec)
    assert problem.coordinates.low.tolist() == problem.low.tolist()
    assert asked == []
    assert problem.episode.noise_floor.frequency > 0.0
    assert len(problem.robot.start_speeds) == len(problem.episode.pushes)
    assert asked == ["make_episode", "rest_noise"]


def test_pushes_that_contradict_themselves_are_refused_when_a_study_file_is_read() -> None:
    """Before anything is put into a DB."""
    changes = {"episode.pushes": [[0.1, 0.1]]}
    assert Problem(read_study("three-link-coast", changes)).names
    with pytest.raises(StudyError, match="every push needs 3 impulses"):
        load_study("three-link-coast", changes)


def test_problem_of_the_same_settings_is_made_once() -> None:
    """Whoever has read them; of other settings it is another."""
    one, other = (load_study("three-link-coast", {"seed": seed}) for seed in (1, 2))
    assert problem_of(one) is problem_of(load_study("three-link-coast", {"seed": 1}))
    assert problem_of(one) is not problem_of(other)


@pytest.mark.slow
@pytest.mark.parametrize("command", [["show"], ["model", "-o", "model.json"], ["run"], ["validate", "--pushes", "1"]])
def test_command_makes_what_follows_from_a_study_once(
    command: list[str], metaid: Metaid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many ask."""
    monkeypatch.chdir(tmp_path)
    changes = ["--set", "sampler=output-error", "--set", "trials=3"]
    metaid("study", "create", "two-link-tpe", *changes, "--name", "chain", "--set", "seed=5")
    if command != ["run"]:
        metaid("study", "run", "chain")
    sys.modules["metaid.study.loading"]._latest.clear()  # type: ignore[attr-defined]
    made: list[Any] = []
    begin = Problem.__init__
    monkeypatch.setattr(Problem, "__init__", lambda self, *given: (made.append(given), begin(self, *given))[1])
    metaid("study", command[0], "chain", *command[1:])
    assert len(made) == 1


@pytest.mark.slow
def test_reading_study_files_of_chains_loads_nothing_that_simulates() -> None:
    """With the pushes that their settings ask for, and the noise of a plant at rest."""
    names = "three-link", "three-link-coast", "noisy-three-link", "one-link-count", "ten-link"
    code = f"""
import sys
from metaid.study import load_study, problem_of
print([len(problem_of(load_study(name)).episode.pushes) for name in {names}])
print([name for name in ("mujoco", "numba") if name in sys.modules])
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines() == ["[2, 6, 6, 1, 20]", "[]"]
