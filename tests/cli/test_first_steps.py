"""What a newcomer types first, and what answers him."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Finished

import metaid as package

Metaid = Callable[..., Finished]


@pytest.mark.parametrize("group", [(), ("study",), ("plant",), ("paper",)], ids=" ".join)
def test_group_without_a_command_prints_its_help(metaid: Metaid, group: tuple[str, ...]) -> None:
    """On stdout, with its lines as --help has them, and with status 0."""
    bare, asked = metaid(*group), metaid(*group, "--help")
    assert (bare.status, bare.err) == (0, "")
    assert bare.out == asked.out
    assert "\n  metaid " in bare.out or "\n    metaid " in bare.out
    assert "..." not in bare.out.replace("[ARGS]...", "")  # each command is told of in whole words
    assert not [line for line in bare.out.splitlines() if line != line.rstrip()]


def test_studies_without_a_db_are_those_that_ship(metaid: Metaid) -> None:
    """Who has no DB yet is shown what can be run, and how; a DB that was named and is not there is refused."""
    listed = metaid("study", "list")
    assert listed.status == 0
    assert "three-link" in listed.out
    assert "metaid study run NAME --create" in listed.out
    assert not Path("metaid.db").exists()
    shown = json.loads(metaid("study", "list", "--json").out)
    assert (shown["studies"], shown["others"]) == ([], [])
    assert {"name", "plant", "sampler", "trials", "description"} == set(shown["shipped"][0])
    assert metaid("study", "list", "--storage", "elsewhere.db").status == 2


def test_lists_are_printed_as_json(metaid: Metaid) -> None:
    """The plants that ship, and the studies of a DB with what is not known yet as null."""
    plants = json.loads(metaid("plant", "list", "--json").out)["plants"]
    assert {"puma560": 6, "three-link": 3}.items() <= {each["name"]: each["joints"] for each in plants}.items()
    metaid("study", "create", "two-link-tpe")
    (study,) = json.loads(metaid("study", "list", "--json").out)["studies"]
    assert (study["name"], study["verdict"], study["trials"], study["best"]) == ("two-link-tpe", "unfinished", 0, None)


def test_study_of_the_db_is_checked(metaid: Metaid) -> None:
    """By the name that it has there; settings of a file are not changed in it."""
    metaid("study", "create", "two-link-tpe", "--name", "mine", "--set", "sampler=output-error", "--set", "trials=3")
    checked = metaid("study", "check", "mine")
    assert checked.status == 0
    assert "coriolis_1_2" in checked.out
    assert "'mine' is in metaid.db" in metaid("study", "check", "mine", "--set", "seed=2").err
    assert "unknown study 'nobody'" in metaid("study", "check", "nobody").err


def test_run_of_a_finished_study_says_that_it_was_finished(metaid: Metaid) -> None:
    """The first run says nothing of the kind."""
    chosen = ("--create", "--quiet", "--trials", "1")
    assert "finished already" not in metaid("study", "run", "spatial-three-link", *chosen).err
    again = metaid("study", "run", "spatial-three-link", "--quiet", "--trials", "1")
    assert again.err == "study 'spatial-three-link' was finished already; trials in metaid.db: 1\n"


def test_plant_file_given_as_a_study_is_said_to_be_one(metaid: Metaid) -> None:
    """And a study file that is given as a plant, and a robot's URDF that is given as a study."""
    Path("pendulum.toml").write_text("[[links]]\nlength = 0.5\nmass = 1.0\n")
    Path("search.toml").write_text('plant = "pendulum.toml"\n')
    Path("arm.urdf").write_text('<robot name="arm"/>')
    for command, said in (
        (("study", "create", "pendulum.toml"), "pendulum.toml: a plant file, and no study file"),
        (("study", "create", "arm.urdf"), "arm.urdf: describes a robot, and is no study file"),
        (("plant", "show", "search.toml"), "search.toml: a study file, and no plant file (its plant is pendulum.toml)"),
    ):
        refused = metaid(*command)
        assert refused.status == 2
        assert said in refused.err


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("chain.toml", "[[links]]\nlength = 300.0\nmass = 1.0\n"),
        (
            "arm.xml",
            '<mujoco><worldbody><body name="one"><joint name="first" axis="0 1 0"/><geom size="0.1"/>'
            '<body name="two" pos="0 0 300"><joint name="second" axis="0 1 0"/><geom size="0.1"/></body>'
            "</body></worldbody></mujoco>",
        ),
    ],
)
def test_lengths_of_300_m_are_asked_about(metaid: Metaid, name: str, text: str) -> None:
    """They are shown all the same: somebody may mean them."""
    Path(name).write_text(text)
    shown = metaid("plant", "show", name)
    assert shown.status == 0
    assert shown.err.startswith("warning: ")
    assert "300 m" in shown.err
    assert shown.err.endswith("\n")
    assert shown.err.count("\n") == 1


@pytest.mark.usefixtures("metaid")
def test_study_file_without_trials_has_as_many_as_its_sampler_needs() -> None:
    """A dozen where each trial is matched, and more where one number of each is minimised."""
    from metaid.study import load_study

    Path("own.toml").write_text('plant = "two-link"\nnominal = "two-link"\n')
    assert load_study("own.toml").study.trials == 12
    assert load_study("own.toml", {"sampler": "cmaes"}).study.trials == 2000


@pytest.mark.slow
def test_python_runs_the_package_as_the_command() -> None:
    """`python -m metaid` is `metaid`."""
    done = subprocess.run([sys.executable, "-m", "metaid", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"metaid, version {package.__version__}\n"
