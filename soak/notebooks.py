"""Runs the notebooks and says where a stored output is not what is printed now.

    python -m soak.notebooks               # all of them
    python -m soak.notebooks 02 --store    # the outputs of one stored anew where they differ

Texts are compared word by word, numbers within what rounding changes, figures by their size and panels. Paths of
temporary folders and seconds differ from run to run. Exit status 1 if an output differs.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).parent.parent
NUMBER = re.compile(r"(?<![\w.])[+-]?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?")
OWN = re.compile(r"(?:/tmp|/var)/[\w/.-]+|0x[0-9a-f]{6,}|[\d.]+ (?:s|ms|seconds|minutes)\b")
RELATIVE = 1e-6  # of a number: processors and BLAS builds differ by less
ROUNDING = 1e-9  # smaller numbers are what rounding left

Cell = dict[str, Any]


def notebooks() -> list[Path]:
    """All of them."""
    return sorted((ROOT / "notebooks").glob("*.ipynb"))


def run_notebook(path: Path, folder: Path) -> nbformat.NotebookNode:
    """The notebook with what it prints now, run from top to bottom in a `folder`."""
    notebook = read(path)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    return notebook


def read(path: Path) -> nbformat.NotebookNode:
    """A notebook as it is stored."""
    notebook: nbformat.NotebookNode = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    return notebook


def differences(stored: nbformat.NotebookNode, made: nbformat.NotebookNode) -> list[str]:
    """Where a stored output is not what was printed now, a line each with the number of the cell."""
    found = []
    for number, (old, new) in enumerate(zip(stored.cells, made.cells, strict=True)):
        before, now = (list(shown(cell)) for cell in (old, new))
        if len(before) != len(now):
            found.append(f"cell {number}: {len(before)} outputs are stored, {len(now)} are made")
        for was, is_now in zip(before, now, strict=False):
            if not same(was, is_now):
                found.append(f"cell {number}: stored   {was}\n  now      {is_now}")
    return found


def shown(cell: Cell) -> Iterator[str]:
    """What a cell shows, as text, without warnings and blanks that only align it: of a figure its size and panels."""
    printed = ""
    for output in cell.get("outputs", []):
        if output["output_type"] == "stream":
            printed += output["text"] if output["name"] == "stdout" else ""
            continue
        data = output["data"]
        drawn = " drawn" if "image/png" in data else ""
        yield " ".join(data.get("text/plain", "").split()) + drawn
    if printed:
        yield " ".join(printed.split())


def same(one: str, other: str) -> bool:
    """Whether two texts differ by no more than rounding, seconds and paths of temporary folders."""
    one, other = (OWN.sub("its own", text) for text in (one, other))
    if NUMBER.sub("#", one) != NUMBER.sub("#", other):
        return False
    pairs = zip(NUMBER.findall(one), NUMBER.findall(other), strict=True)
    return all(_near(*pair) for pair in pairs)


def _near(one: str, other: str) -> bool:
    """Whether two printed numbers differ by at most a unit of the last digit of the shorter one, or by rounding."""
    first, second = (float(text.replace(",", "")) for text in (one, other))
    if one == other or max(abs(first), abs(second)) < ROUNDING:
        return True
    if "." not in one + other and "e" not in one + other:
        return False  # what is counted is the same
    return abs(first - second) <= max(1.001 * max(_unit(one), _unit(other)), RELATIVE * max(abs(first), abs(second)))


def _unit(number: str) -> float:
    """Of the last digit that is printed."""
    digits, _, power = number.partition("e")
    return float(10.0 ** (int(power or 0) - len(digits.partition(".")[2])))


def main() -> None:
    """Runs the notebooks asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("only", nargs="*", metavar="NUMBER", help="which, e.g. 02 (default: all)")
    parser.add_argument("--store", action="store_true", help="store the outputs of now where they differ")
    given = parser.parse_args()
    numbers = [path.stem[:2] for path in notebooks()]
    if unknown := set(given.only) - set(numbers):
        parser.error(f"unknown notebook '{min(unknown)}' (allowed: {', '.join(numbers)})")
    different = 0
    for path in notebooks():
        if given.only and path.stem[:2] not in given.only:
            continue
        with tempfile.TemporaryDirectory() as folder:
            made = run_notebook(path, Path(folder))
        found = differences(read(path), made)
        different += bool(found)
        print("\n".join([f"{path.name}: {'differs' if found else 'the same'}", *found]), flush=True)
        if found and given.store:
            store(made, path)
    sys.exit(1 if different else 0)


def store(made: nbformat.NotebookNode, path: Path) -> None:
    """Writes a notebook with its outputs, without warnings and what a kernel says of itself."""
    for cell in made.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if output.get("name") != "stderr"]
    made.metadata = read(path).metadata
    nbformat.write(made, path)  # type: ignore[no-untyped-call]


if __name__ == "__main__":
    main()
