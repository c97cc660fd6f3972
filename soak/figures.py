"""Prints every figure of every document anew and says which differ.

    python -m soak.figures                 # all of them: an hour on two idle cores
    python -m soak.figures paper.md        # those of one document
    python -m soak.figures --list          # which command prints what, and where
    python -m soak.figures --keep FOLDER   # keeps what each command printed, to mend the tables by

A table of a document stands below a line `<!-- printed by: COMMAND -->`. The command is run from the root of the
repository and has to print a table with these columns and, among its rows, these rows. Of `COMMAND; COMMAND` each may
print some of the rows. Columns of seconds are not compared, for machines differ; nor are numbers of the size of
rounding. Exit status 1 if a figure differs. A command that ends with status 77 needs what is not installed: its tables
are not compared, and that is said. The tables of BENCHMARKS.md and docs/reliability.md are written by `make bench` and
`make soak`, and are none of these.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from benchmarks.common import NEEDS_MORE

ROOT = Path(__file__).parent.parent
PRINTED = re.compile(r"<!-- printed by: (.+?) -->")
RULE = re.compile(r"\|(\s*:?-+:?\s*\|)+")
# Not "N = 3, 60 s", which says how long a motion was.
OF_TIME = re.compile(r"(?<!\d )\b(s|ms|seconds|minutes|min|slowest|CPU|load|wall)\b")
SMALL = re.compile(r"[+-]?\d(?:\.\d+)?e-\d+")
DIFFERS, NOT_COMPARED = "differs", "not compared, for what its command needs is not installed"
ROUNDING = 1e-9  # smaller numbers are what rounding left, which differs by processor

Row = dict[str, str]


@dataclass(frozen=True)
class Figures:
    """A table of a `document`, at a `line` (from 1): its `rows`, each by column, and the commands that print them."""

    document: Path
    line: int
    commands: tuple[str, ...]
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
            found.append(Figures(document, line, tuple(marked[1].split("; ")), rows))
    return found


def differences(stated: tuple[Row, ...], outputs: Sequence[str]) -> list[str]:
    """What the commands' `outputs` have otherwise than the rows that a document states, in a line each. All that come
    from one output come from one table of it.
    """
    columns = list(stated[0])
    compared = [column for column in columns if not OF_TIME.search(column)]
    wanted = [tuple(_settled(row[column]) for column in compared) for row in stated]
    found = list[tuple[str, ...]]()
    for output in outputs:
        printed = [rows for _, _, rows in tables(output) if rows and set(columns) <= set(rows[0])]
        cells = [[tuple(_settled(row[column]) for column in compared) for row in rows] for rows in printed]
        found += max(cells, key=lambda rows: sum(row in rows for row in wanted), default=[])
    if not found:
        return [f"no table with the columns {', '.join(columns)} is printed"]
    missing = []
    for row in (row for row in wanted if row not in found):
        near = get_close_matches(" | ".join(row), [" | ".join(cells) for cells in found], 1, 0.0)
        missing.append(f"stated   {' | '.join(row)}\n      printed  {near[0] if near else 'nothing like it'}")
    return missing


def _settled(cell: str) -> str:
    """A cell without what rounding left."""
    return SMALL.sub(lambda found: "rounding" if 0.0 < abs(float(found[0])) < ROUNDING else found[0], cell)


@dataclass(frozen=True)
class Printed:
    """What a command printed, with which exit `status`, and the `minutes` that it took."""

    output: str
    status: int
    minutes: float


def run(command: str) -> Printed:
    """Runs a command of a document, with this Python."""
    began = time.perf_counter()
    bash = ["bash", "-c", re.sub(r"^python\b", sys.executable, command)]
    done = subprocess.run(bash, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    return Printed(done.stdout, done.returncode, (time.perf_counter() - began) / 60.0)


def begun(pool: Executor, stated: Sequence[Figures]) -> dict[str, Future[Printed]]:
    """What each command prints of those that print the tables that are `stated`, each run once by the `pool`."""
    commands = dict.fromkeys(command for table in stated for command in table.commands)
    return {command: pool.submit(run, command) for command in commands}


def judged(table: Figures, printed: Sequence[Printed]) -> tuple[str, list[str]]:
    """Whether a table is the same as what its commands have `printed`, in a few words, and what is otherwise."""
    if any(each.status == NEEDS_MORE for each in printed):
        return NOT_COMPARED, []
    for command, each in zip(table.commands, printed, strict=True):
        if each.status:
            return DIFFERS, [f"{command} ended with exit status {each.status}"]
    found = differences(table.rows, [each.output for each in printed])
    return DIFFERS if found else "the same", found


def main() -> None:
    """Runs the commands of the documents asked for, each once."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("only", nargs="*", metavar="DOCUMENT", help="which, e.g. paper.md (default: all)")
    parser.add_argument("--list", action="store_true", help="run nothing: say which command prints what")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="commands at a time (default: the cores)")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where to keep what each command printed")
    given = parser.parse_args()
    names = {document.name for document in documents()}
    if unknown := set(given.only) - names:
        parser.error(f"unknown document '{min(unknown)}' (allowed: {', '.join(sorted(names))})")
    chosen = [document for document in documents() if not given.only or document.name in given.only]
    stated = [table for document in chosen for table in figures(document)]
    if given.list:
        print("\n".join(f"{table.place}: {'; '.join(table.commands)}" for table in stated))
        return
    began = time.perf_counter()
    with ThreadPoolExecutor(given.workers) as pool:
        running = begun(pool, stated)
        verdicts = Counter[str]()
        for table in stated:
            printed = [running[command].result() for command in table.commands]
            verdict, lines = judged(table, printed)
            verdicts[verdict] += 1
            print("\n    ".join([f"{table.place}: {verdict}", *lines]), flush=True)
    taken = {command: each.result() for command, each in running.items()}
    print("\n".join(f"{each.minutes:5.1f} minutes  {command}" for command, each in taken.items()))
    if given.keep:
        given.keep.mkdir(parents=True, exist_ok=True)
        for number, (command, each) in enumerate(taken.items(), 1):
            (given.keep / f"{number:02}.md").write_text(f"{command}\n\n{each.output}", encoding="utf-8")
    told = ", ".join(f"{verdict} {count}" for verdict, count in verdicts.items())
    print(f"{len(stated)} tables in {(time.perf_counter() - began) / 60.0:.0f} minutes: {told}")
    sys.exit(1 if verdicts[DIFFERS] else 0)


if __name__ == "__main__":
    main()
