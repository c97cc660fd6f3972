"""Pictures of what logs say, each as the file that names it: `-o torque.pdf`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

import metaid
from metaid.cli.common import FIGURE_SUFFIXES, say, whole_file
from metaid.errors import RecordError

if TYPE_CHECKING:
    from metaid.recorded import RecordedResult

FIGURES = ("torque", "friction", "gravity", "bodies")


def figure_of(output: Path) -> str:
    """The figure that a file is of: its name, or what follows the last hyphen of it.  Raises click.UsageError."""
    name = output.stem.rpartition("-")[2]
    if name not in FIGURES:
        raise click.UsageError(
            f"-o {output}: the name says the figure (allowed: {', '.join(FIGURES)}, or anything and a hyphen before it)"
        )
    return name


def draw(result: RecordedResult, figures: Mapping[Path, str]) -> None:
    """Writes figures to files, each by its name."""
    if not figures:
        return
    gallery = metaid.figures.LogGallery(result)
    for output, name in figures.items():
        if name not in gallery.makers:
            raise RecordError(f"{output}: gravity loads no joint (allowed: {', '.join(gallery.makers)})")
        with whole_file(output, FIGURE_SUFFIXES) as partial:
            metaid.figures.save(gallery.picture(name).figure, partial)
        say(f"{output}: written", err=True)
