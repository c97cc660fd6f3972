"""Runs the parts of the soak and says whether every promise was kept; the table of a whole run goes into the document.

python -m soak [PART …] [--scale F] [-o FILE.md]

A part is a module with `run(scale: float) -> list[SoakResult]`; at scale 1 it does all that is promised, at less it
only shows that it works.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path

from benchmarks.common import machine
from soak.common import SoakResult, table

PARTS = (
    "kills",
    "vanishing",
    "foreign",
    "workers",
    "cluster",
    "inputs",
    "kernels",
    "rigs",
    "promises",
    "confident",
    "logs",
)
MARKERS = "<!-- soak: written by make soak -->", "<!-- end of soak -->"


def main() -> None:
    """The parts asked for, one after the other; exit status 1 if a promise was not kept."""
    parser = argparse.ArgumentParser(prog="python -m soak")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"which (default: all of {', '.join(PARTS)})")
    parser.add_argument("--scale", type=float, default=1.0, help="how much of what is promised (default: 1)")
    parser.add_argument("-o", dest="output", type=Path, default=Path("docs/reliability.md"), help="where it goes")
    arguments = parser.parse_args()
    if unknown := [part for part in arguments.parts if part not in PARTS]:
        parser.error(f"unknown part '{unknown[0]}' (allowed: {', '.join(PARTS)})")
    begun = time.perf_counter()
    results: list[SoakResult] = []
    for part in arguments.parts or PARTS:
        print(f"{part} …", flush=True)
        results += import_module(f"soak.{part}").run(arguments.scale)
    for found in results:
        for failure in found.failures[:20]:
            print(f"{found.name}: {failure}", file=sys.stderr)
    print(table(results))
    if not arguments.parts and arguments.scale == 1.0:
        minutes = (time.perf_counter() - begun) / 60
        write(arguments.output, f"{_about(minutes)}\n\n{table(results)}")
        print(f"{arguments.output} is written")
    sys.exit(0 if all(found.kept for found in results) else 1)


def write(document: Path, text: str) -> None:
    """Puts `text` between the markers of a document."""
    first, last = MARKERS
    found = document.read_text(encoding="utf-8")
    between = re.compile(f"{re.escape(first)}.*{re.escape(last)}", re.DOTALL)
    if not between.search(found):
        sys.exit(f"{document} has no place for the table: {first} … {last}")
    document.write_text(between.sub(lambda _: f"{first}\n{text}\n{last}", found), encoding="utf-8")


def _about(minutes: float) -> str:
    facts = machine()
    return (
        f"`make soak` on {datetime.now(UTC):%Y-%m-%d}, {minutes:.1f} minutes; "
        f"{facts['processor']}; {facts['system']}; {facts['versions']}."
    )


if __name__ == "__main__":
    main()
