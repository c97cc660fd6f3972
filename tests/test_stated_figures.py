"""Tables of the documents say which command prints them, and are compared with what it prints."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from soak.figures import ROOT, differences, documents, figures, tables

RESULTS = ("full-dynamics.md", "higher-dof.md", "method.md", "paper.md", "real-plants.md")
MANY = 30  # numbers of a table that somebody measured
PRINTED = """
| links | found | worst error | seconds |
| --- | --- | --- | --- |
| 2 | 5 of 5 | 2.7e-13 of 2 | 0.4 |
| 3 | 4 of 5 | 0.02 | 1.4 |
"""


@pytest.mark.parametrize("document", [document for document in documents() if document.name in RESULTS])
def test_tables_of_results_say_what_prints_them(document: Path) -> None:
    """A table of many numbers stands below a command, or below the reason why there is none."""
    for line, before, rows in tables(document.read_text()):
        numbers = sum(len(re.findall(r"\d+(?:\.\d+)?", cell)) for row in rows for cell in row.values())
        if numbers >= MANY:
            assert re.search(r"<!-- (printed by|by hand): .+ -->", before), f"{document.name}:{line}"


def test_commands_are_there() -> None:
    """Each runs a module of the repository."""
    commands = {part for document in documents() for table in figures(document) for part in table.command.split("; ")}
    assert len(commands) > 10
    for command in commands:
        python, option, module, *_ = shlex.split(command)
        assert (python, option) == ("python", "-m"), command
        assert (ROOT / f"{module.replace('.', '/')}.py").exists(), command


def stated(text: str) -> list[str]:
    """How a table that a document states differs from what is printed."""
    ((_, _, rows),) = tables(text)
    return differences(rows, PRINTED)


def test_the_same_figures_are_the_same() -> None:
    """In fewer columns and rows, on a slower machine, and with other errors of rounding."""
    assert not stated("| links | worst error | seconds |\n| --- | --: | --- |\n| 2 | **5e-14 of 2** | 77 |\n")


@pytest.mark.parametrize(("cell", "near"), [("| 3 | 5 of 5 |", "3 | 4 of 5"), ("| 4 | 4 of 5 |", "3 | 4 of 5")])
def test_another_figure_is_shown_beside_the_printed_one(cell: str, near: str) -> None:
    """The row of the document, and the one most like it."""
    (found,) = stated(f"| links | found |\n| --- | --- |\n{cell}\n")
    assert cell.strip("| ") in found
    assert near in found


def test_a_column_that_is_not_printed_is_named() -> None:
    """A table of other columns is no table of that command."""
    assert stated("| joints |\n| --- |\n| 2 |\n") == ["no table with the columns joints is printed"]
