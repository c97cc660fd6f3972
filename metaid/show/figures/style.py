"""What all figures share: colours that every eye can tell apart, sizes that print, files by their ending."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK = "#1b1b1f"  # of text, axes and the truth; the report puts the reader's own ink in its place
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", INK)  # Okabe and Ito, for all eyes
SURVIVOR, FALL, RANGE = COLOURS[0], COLOURS[1], COLOURS[5]
VALUES = "cividis"  # of frequencies: even in lightness, and the same for most eyes
MANY = 600  # marks; more are drawn as pixels inside a vector file
SUFFIXES = (".png", ".svg", ".pdf")
COLUMN, PAGE = 3.5, 7.0  # inches: one column of a journal, and two

SETTINGS: dict[Any, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "figure.facecolor": "none",
    "figure.constrained_layout.w_pad": 0.1,  # inches: a browser's letters are wider than they are measured here
    "figure.constrained_layout.h_pad": 0.06,
    "axes.facecolor": "none",
    "savefig.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "metaid",  # the same figure is the same file
    **dict.fromkeys(("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"), INK),
}


@contextmanager
def style() -> Iterator[None]:
    """Figures made inside look like metaid's."""
    # Not rc_context: it would also undo what a notebook's backend sets when the first figure is made.
    before = {key: mpl.rcParams[key] for key in SETTINGS}
    mpl.rcParams.update(SETTINGS)
    try:
        yield
    finally:
        mpl.rcParams.update(before)


def new_axes(axes: Axes | None) -> Axes:
    """The given Axes, or those of a new pyplot figure, which a notebook shows by itself."""
    if axes is not None:
        return axes
    from matplotlib import pyplot

    with style():
        return pyplot.subplots(figsize=(0.7 * PAGE, 0.45 * PAGE), layout="constrained")[1]


def size_of(axes: Axes) -> tuple[float, float]:
    """Width and height, in inches, of the figure that `axes` are in."""
    box, dots = axes.figure.bbox, axes.figure.dpi
    return box.width / dots, box.height / dots


def every(count: int, room: float) -> range:
    """Which of so many ticks have a label where there is `room` for that many."""
    return range(0, count, max(math.ceil(count / room), 1))


def verbatim(text: str) -> str:
    """A user's text as matplotlib shows it letter by letter, dollar signs included."""
    return text.replace("$", r"\$")


def save(figure: Figure, path: Path) -> None:
    """Writes a figure as a file whose ending says the format, without a date: the same figure is the same file."""
    dated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    with style():
        figure.savefig(path, dpi=200, metadata=dated.get(path.suffix))
