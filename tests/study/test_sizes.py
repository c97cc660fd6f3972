"""Studies that no memory holds, and chains whose units are in doubt: one line, before anything is made."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from conftest import Finished

from metaid.files import shipped_names
from metaid.store import Store
from metaid.study import create_study, load_study, question

Metaid = Callable[..., Finished]
LARGE = {
    "readings at rest": ("noisy-three-link", ["steps=10000000"], "of memory (allowed: at most 8 GiB"),
    "steps of a trial": ("three-link-coast", ["steps=10000000", "repeats=1000"], "are too many for a trial"),
    "angles": ("five-link", ["steps=10000000", "measure=count", "rule=maxima"], "of memory (allowed: at most 8 GiB"),
    "pushes": ("three-link-coast", ["steps=2", "repeats=1000", "count=1000"], "of memory (allowed: at most 8 GiB"),
}


@pytest.mark.parametrize("case", LARGE)
@pytest.mark.parametrize("command", ["check", "create"])
def test_study_too_large_to_be_computed_is_refused_with_its_size(metaid: Metaid, command: str, case: str) -> None:
    """Before it is allocated, and nothing is made."""
    study, changes, message = LARGE[case]
    sets = [word for change in changes for word in ("--set", f"episode.{change}")]
    refused = metaid("study", command, study, *sets)
    assert refused.status == 2
    assert message in refused.err
    assert refused.err.count("\n") == 1
    assert not Path("metaid.db").exists()


def test_study_of_a_stranger_that_is_too_large_is_refused_and_the_others_are_listed(metaid: Metaid) -> None:
    """`show` and `run` say what it would need; `list` has its name, and all of what is known of the other."""
    spec = load_study("noisy-three-link")
    episode = spec.study.episode.model_copy(update={"steps": 10_000_000})
    large = spec.model_copy(update={"study": spec.study.model_copy(update={"episode": episode})})
    with closing(Store("metaid.db", create=True)) as store:
        store.create("large", large.model_dump_json(), 3)
        create_study(store, load_study("one-link-count"), "other")
    for command in (["show", "large"], ["show", "large", "--json"], ["run", "large"]):
        refused = metaid("study", *command)
        assert (refused.status, refused.err.count("\n")) == (2, 1)
        assert "GiB of memory" in refused.err
    listed = metaid("study", "list")
    assert listed.status == 0
    assert "large" in listed.out
    assert "other" in listed.out


PLANT = "{more}\n[[links]]\nlength = {length}\nmass = {mass}\n"


@pytest.mark.parametrize(
    ("length", "mass", "more", "asked"),
    [
        (500.0, 1000.0, "timestep = 0.002", "link 1 is 500 m long and weighs 1000 kg: is that meant? (in m and kg)"),
        (300.0, 1.0, "timestep = 0.002", "link 1 is 300 m long"),
        (0.3, 1000.0, "timestep = 0.002", "weighs 1000 kg"),
        (0.0005, 0.1, "timestep = 0.0001", "link 1 is 0.0005 m long"),
        (0.3, 1.0, "gravity = 981.0\ntimestep = 0.0005", "gravity is 981 m/s²: is that meant?"),
    ],
)
def test_units_that_are_in_doubt_are_asked_for(
    metaid: Metaid, length: float, mass: float, more: str, asked: str
) -> None:
    """In one line, by `check` and `create`, which do their work all the same."""
    Path("odd.toml").write_text(PLANT.format(more=more, length=length, mass=mass))
    Path("study.toml").write_text('plant = "odd.toml"\nnominal = "odd.toml"\ntrials = 9\n')
    for command in ("check", "create"):
        answered = metaid("study", command, "study.toml")
        assert answered.status == 0
        assert [line for line in answered.err.splitlines() if asked in line and line.startswith("warning: ")]


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_names("studies"))
def test_units_of_the_shipped_studies_are_beyond_doubt(name: str) -> None:
    """Nobody is asked in vain."""
    assert question(load_study(name)) is None
