"""Tables of the documents say which command prints them, and are compared with what it prints."""

from __future__ import annotations

import re
import shlex
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from benchmarks.common import NEEDS_MORE
from soak.figures import (
    DIFFERS,
    NOT_COMPARED,
    ROOT,
    Figures,
    Printed,
    begun,
    differences,
    documents,
    figures,
    judged,
    tables,
)

pytestmark = pytest.mark.slow

RESULTS = (
    "README.md",
    "arms.md",
    "cluster.md",
    "friction.md",
    "higher-dof.md",
    "method.md",
    "paper.md",
    "peers.md",
    "real-plants.md",
)
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
    commands = {part for document in documents() for table in figures(document) for part in table.commands}
    assert len(commands) > 10
    for command in commands:
        python, option, module, *_ = shlex.split(command)
        assert (python, option) == ("python", "-m"), command
        assert (ROOT / f"{module.replace('.', '/')}.py").exists(), command


def test_a_command_of_several_tables_is_run_once(tmp_path: Path) -> None:
    """Some take minutes."""
    path = tmp_path / "runs.txt"
    tables_of_it = [Figures(ROOT / "README.md", line, (f"echo run | tee -a {path}",), ()) for line in (1, 2)]
    with ThreadPoolExecutor(2) as pool:
        outputs = [each.result().output for each in begun(pool, tables_of_it).values()]
    assert outputs == ["run\n"]
    assert path.read_text() == "run\n"


def stated(text: str) -> list[str]:
    """How a table that a document states differs from what is printed."""
    ((_, _, rows),) = tables(text)
    return differences(rows, [PRINTED])


def test_the_same_figures_are_the_same() -> None:
    """In fewer columns and rows, on a slower machine, and with other errors of rounding."""
    assert not stated("| links | worst error | seconds |\n| --- | --: | --- |\n| 2 | **5e-14 of 2** | 77 |\n")


def test_a_column_that_names_seconds_of_motion_is_compared() -> None:
    """Another error after 60 s is one, and another time of computing is none."""
    ((_, _, rows),) = tables("| method | N = 3, 60 s | computing, s |\n| --- | --- | --- |\n| DIDIM | 2 | 1 |\n")
    printed = "| method | N = 3, 60 s | computing, s |\n| --- | --- | --- |\n| DIDIM | {} | 5 |\n"
    assert not differences(rows, [printed.format(2)])
    assert len(differences(rows, [printed.format(3)])) == 1


def test_rows_of_one_output_are_of_one_table() -> None:
    """Rows of two tables of the same columns do not make up one, but those of two commands do."""
    ((_, _, rows),) = tables("| links | found |\n| --- | --- |\n| 2 | 1 |\n| 3 | 4 |\n")
    first, second = (f"| links | found |\n| --- | --- |\n| {row} |\n\n" for row in ("2 | 1", "3 | 4"))
    assert differences(rows, [first + second])
    assert not differences(rows, [first, second])


@pytest.mark.parametrize(("status", "verdict"), [(0, "the same"), (1, DIFFERS), (NEEDS_MORE, NOT_COMPARED)])
def test_a_command_that_cannot_be_run_here_is_no_difference(status: int, verdict: str) -> None:
    """One that fails otherwise is."""
    ((_, _, rows),) = tables(PRINTED)
    assert judged(Figures(ROOT, 1, ("python -m x",), rows), [Printed(PRINTED, status, 0.1)])[0] == verdict


@pytest.mark.parametrize(("cell", "near"), [("| 3 | 5 of 5 |", "3 | 4 of 5"), ("| 4 | 4 of 5 |", "3 | 4 of 5")])
def test_another_figure_is_shown_beside_the_printed_one(cell: str, near: str) -> None:
    """The row of the document, and the one most like it."""
    (found,) = stated(f"| links | found |\n| --- | --- |\n{cell}\n")
    assert cell.strip("| ") in found
    assert near in found


def test_a_column_that_is_not_printed_is_named() -> None:
    """A table of other columns is no table of that command."""
    assert stated("| joints |\n| --- |\n| 2 |\n") == ["no table with the columns joints is printed"]
