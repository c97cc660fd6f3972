"""What a newcomer types first, and what answers him."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Finished

Metaid = Callable[..., Finished]


@pytest.mark.parametrize("group", [(), ("study",), ("plant",), ("paper",)], ids=" ".join)
def test_group_without_a_command_prints_its_help(metaid: Metaid, group: tuple[str, ...]) -> None:
    """On stdout, with its lines as --help has them, and with status 0."""
    bare, asked = metaid(*group), metaid(*group, "--help")
    assert (bare.status, bare.err) == (0, "")
    assert bare.out == asked.out
    assert "\n  metaid " in bare.out or "\n    metaid " in bare.out


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
