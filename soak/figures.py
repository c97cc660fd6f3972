"""Prints every figure of every document anew and says which differ.

    python -m soak.figures                # all of them: hours
    python -m soak.figures paper.md        # those of one document
    python -m soak.figures --list          # which command prints what, and where

A table of a document stands below a line `<!-- printed by: COMMAND -->`. The command is run from the root of the
repository and has to print a table with these columns and, among its rows, these rows. Columns of seconds are not
compared, for machines differ; nor are numbers of the size of rounding. Exit status 1 if a figure differs.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

ROOT = Path(__file__).parent.parent
PRINTED = re.compile(r"<!-- printed by: (.+?) -->")
RULE = re.compile(r"\|(\s*:?-+:?\s*\|)+")
OF_TIME = re.compile(r"\b(s|ms|seconds|minutes|min|slowest|CPU|load|wall)\b")
SMALL = re.compile(r"[+-]?\d(?:\.\d+)?e-\d+")
ROUNDING = 1e-9  # smaller numbers are what rounding left, which differs by processor

Row = dict[str, str]


@dataclass(frozen=True)
class Figures:
    """A table of a `document`, at a `line` (from 1): its `rows`, each by column, and the command that prints them."""

    document: Path
    line: int
    command: str
    rows: tuple[Row, ...]

    @property
    def place(self) -> str:
        """Where it is."""
        return f"{self.document.relative_to(ROOT)}:{self.line}"


def documents() -> list[Path]:
    """All documents, the one at the root first."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def tables(text: str) -> Iterator[tuple[int, str, tuple[Row, ...]]]:
    """Every markdown table of a text: the line that it begins in (from 1), the text line before it that is not empty,
    and its rows.
    """
    lines = text.splitlines()
    number = 0
    while number + 1 < len(lines):
        if not (lines[number].startswith("|") and RULE.fullmatch(lines[number + 1].strip())):
            number += 1
            continue
        begun, heading = number, _cells(lines[number])
        before = next((line for line in reversed(lines[:begun]) if line.strip()), "")
        number += 2
        rows = []
        while number < len(lines) and lines[number].startswith("|"):
            rows.append(dict(zip(heading, _cells(lines[number]), strict=True)))
            number += 1
        yield begun + 1, before, tuple(rows)


def _cells(line: str) -> list[str]:
    return [cell.strip().strip("*") for cell in line.strip().strip("|").split("|")]


def figures(document: Path) -> list[Figures]:
    """The tables of a document that say which command prints them."""
    found = []
    for line, before, rows in tables(document.read_text(encoding="utf-8")):
        if marked := PRINTED.fullmatch(before.strip()):
            found.append(Figures(document, line, marked[1], rows))
    return found


def differences(stated: tuple[Row, ...], output: str) -> list[str]:
    """What a command's output has otherwise than the rows that a document states, in a line each."""
    columns = list(stated[0])
    printed = [rows for _, _, rows in tables(output) if rows and set(columns) <= set(rows[0])]
    if not printed:
        return [f"no table with the columns {', '.join(columns)} is printed"]
    compared = [column for column in columns if not OF_TIME.search(column)]
    found = [tuple(_settled(row[column]) for column in compared) for rows in printed for row in rows]
    missing = []
    for row in stated:
        wanted = tuple(_settled(row[column]) for column in compared)
        if wanted not in found:
            near = get_close_matches(" | ".join(wanted), [" | ".join(cells) for cells in found], 1, 0.0)
            missing.append(f"stated   {' | '.join(wanted)}\n    printed  {near[0] if near else 'nothing like it'}")
    return missing


def _settled(cell: str) -> str:
    """A cell without what rounding left."""
    return SMALL.sub(lambda found: "rounding" if 0.0 < abs(float(found[0])) < ROUNDING else found[0], cell)


def main() -> None:
    """Runs the commands of the documents asked for, each once."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("only", nargs="*", metavar="DOCUMENT", help="which, e.g. paper.md (default: all)")
    parser.add_argument("--list", action="store_true", help="run nothing: say which command prints what")
    given = parser.parse_args()
    names = {document.name for document in documents()}
    if unknown := set(given.only) - names:
        parser.error(f"unknown document '{min(unknown)}' (allowed: {', '.join(sorted(names))})")
    chosen = [document for document in documents() if not given.only or document.name in given.only]
    stated = [table for document in chosen for table in figures(document)]
    by_command: dict[str, list[Figures]] = {}
    for table in stated:
        by_command.setdefault(table.command, []).append(table)
    different = 0
    for command, printed in by_command.items():
        print(f"{command}: {', '.join(table.place for table in printed)}", flush=True)
        if given.list:
            continue
        bash = ["bash", "-c", re.sub(r"^python\b", sys.executable, command)]
        done = subprocess.run(bash, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        if done.returncode:
            different += len(printed)
            print(f"  ended with exit status {done.returncode}")
            continue
        for table in printed:
            found = differences(table.rows, done.stdout)
            different += bool(found)
            print("\n  ".join([f"  {table.place}: {'differs' if found else 'the same'}", *found]), flush=True)
    if not given.list:
        print(f"{len(stated)} tables, {different} of them differ")
        sys.exit(1 if different else 0)


if __name__ == "__main__":
    main()
