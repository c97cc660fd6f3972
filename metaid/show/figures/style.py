"""What all figures share: colours that every eye can tell apart, sizes that print, files by their ending."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import get_registered_canvas_class
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

INK = "#1b1b1f"  # of text, axes and the truth; the report puts the reader's own ink in its place
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", INK)  # Okabe and Ito, for all eyes
SURVIVOR, FALL, RANGE = COLOURS[0], COLOURS[1], COLOURS[5]
# How `plot` marks candidates that survived, and such as fell.
SURVIVED: dict[str, Any] = {"linestyle": "none", "color": SURVIVOR, "alpha": 0.6, "label": "survivor"}
FELL: dict[str, Any] = {
    "linestyle": "none",
    "marker": "x",
    "color": FALL,
    "markersize": 3,
    "markeredgewidth": 0.7,
    "label": "fall",
}
VALUES = "cividis"  # of frequencies: even in lightness, and the same for most eyes
# The same for lines, seen on white and on black: neither end of cividis is.
LINE_VALUES = LinearSegmentedColormap.from_list("line values", (COLOURS[0], "#8f8f96", COLOURS[4]))
MANY = 600  # marks; more are drawn as pixels inside a vector file
DPI = 200  # of pixels in any file
COLUMN, PAGE = 3.5, 7.0  # inches: one column of a journal, and two
WIDTHS = {"page": PAGE, "column": COLUMN}

POINTER = 8.0  # points, of the unseen marks that a pointer has to hit
ON_TOP = 10.0  # of all that is drawn: a pointer hits what is on top
_SAID: WeakKeyDictionary[Artist, tuple[str, ...]] = WeakKeyDictionary()

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
    # Or a figure that has its layout, or needs none, would be laid out anew.
    **dict.fromkeys(("figure.autolayout", "figure.constrained_layout.use"), False),
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


def say_at(axes: Axes, x: Any, y: Any, texts: Sequence[str]) -> None:
    """What a browser says where points are pointed at, which have no mark large enough.

    Args:
        axes: to draw on; nothing that is seen is.
        x: of the points (npoint).
        y: of the points (npoint).
        texts: what is said at each (npoint).
    """
    (unseen,) = axes.plot(x, y, "o", color=INK, markersize=POINTER, alpha=0.0, zorder=ON_TOP, label="_said")
    _SAID[unseen] = tuple(texts)


def said_in(figure: Figure) -> dict[str, tuple[str, ...]]:
    """All texts of a figure, each list under the id that its artist is given in an SVG."""
    said: dict[str, tuple[str, ...]] = {}
    for artist in [each for each in _SAID if each.get_figure(root=True) is figure]:
        artist.set_gid(f"said-{len(said)}")
        said[f"said-{len(said)}"] = _SAID[artist]
    return said


def with_titles(svg: str, said: dict[str, tuple[str, ...]]) -> str:
    """An SVG whose marks have their texts as titles, which browsers show when they are pointed at. Marks that are not
    all drawn have none.
    """
    for name, texts in said.items():
        titles = [f"<title>{escape(text)}</title>" for text in texts]
        head, opening, rest = svg.partition(f'<g id="{name}">')
        group, end, tail = rest.partition("</g>")
        if len(texts) == 1:
            group = titles[0] + group
        else:
            # What is before each mark, the mark, and at last what is after all of them.
            *pieces, after = re.split(r"(?<=<use )([^>]*)/>", group)
            if len(pieces) != 2 * len(texts):
                continue
            marks = zip(pieces[::2], pieces[1::2], titles, strict=True)
            group = "".join(f"{before}{mark}>{title}</use>" for before, mark, title in marks) + after
        svg = head + opening + group + end + tail
    return svg


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


@contextmanager
def laid_out(figure: Figure, ending: str) -> Iterator[None]:
    """A `figure` that has inside the layout of a file of that `ending`, and DPI dots an inch; inside `style`. Else
    savefig would draw all of it once more, for the layout alone.
    """
    layout, canvas, dpi = figure.get_layout_engine(), figure.canvas, figure.dpi
    try:
        get_registered_canvas_class(ending)(figure)  # letters are measured as that file has them
        figure.dpi = DPI
        if layout is not None:
            layout.execute(figure)
            figure.set_layout_engine(None)
        yield
    finally:
        figure.set_layout_engine(layout)
        figure.set_canvas(canvas)
        figure.dpi = dpi


def save(figure: Figure, path: Path) -> None:
    """Writes a figure as a file whose ending says the format, without a date: the same figure is the same file."""
    dated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    with style(), laid_out(figure, path.suffix.removeprefix(".")):
        figure.savefig(path, dpi=DPI, metadata=dated.get(path.suffix))
