"""What a search found of the lumps: their ranges at the minimum, and how they go together there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from metaid.models import DEVIATIONS, Array
from metaid.show.figures.style import INK, RANGE, SURVIVOR, every, new_axes, say_at, size_of

if TYPE_CHECKING:  # figures of logs do without studies
    from metaid.results import Findings

READABLE = 8  # lumps up to which a correlation is written in its cell
LABELS = 5.5  # names below one another, an inch of the figure
CLOSE_LABELS = 8.0  # the same in smaller letters
LEAST = 1e-9  # of what is drawn on a logarithmic scale: less is what rounding left


def plot_ranges(found: Findings, axes: Axes | None = None) -> Axes:
    """Each lump's range over the trials as good as the best, or its 95 % interval, and its true value, in % of the
    identified one.
    """
    axes = new_axes(axes)
    _ = found.best_factors  # refuses a study without survivors
    by_estimate = found.verdict.source == "estimate"
    lumps, places = found.known_lumps, np.arange(len(found.known_lumps))
    low, high, true = (100.0 * (lumps[key] / lumps["identified"] - 1.0) for key in ("low", "high", "true"))
    axes.barh(
        places,
        high - low,
        left=low,
        height=0.5,
        color=RANGE,
        label=found.interval_name if by_estimate else f"{len(found.equals)} indistinguishable trials",
    )
    axes.plot(np.zeros(len(places)), places, "|", color=SURVIVOR, markersize=9, label="identified")
    if found.true_factors is not None:
        axes.plot(true, places, "*", color=INK, markersize=6, linestyle="", label="truth")
    texts = [
        f"{lump['name']}: {lump['identified']:.5g}, from {lump['low']:.5g} to {lump['high']:.5g} {lump['unit']}"
        for lump in lumps.to_dict("records")
    ]
    say_at(axes, np.zeros(len(places)), places, texts)
    axes.set_yticks(places, lumps["name"])
    axes.use_sticky_edges = False  # or the axis would end where the longest bar begins
    axes.margins(x=0.08)
    axes.invert_yaxis()
    axes.set_xlabel("deviation from the identified value, %", loc="left")  # a power of ten may stand on the right
    axes.grid(True, axis="x")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return axes


def plot_known(found: Findings, axes: Axes | None = None) -> Axes:
    """How well each base parameter is known: its standard deviation and, where the truth is known, its error and that
    of the nominal arm, as shares of how wrong it may have been beforehand. Of lumps nothing is said beforehand: they
    have no such figure.
    """
    axes = new_axes(axes)
    lumps, beforehand = found.lumps, found.sought.step
    half = (lumps["high"] - lumps["low"]) / (2.0 * DEVIATIONS)
    places = np.arange(len(lumps))
    axes.axvline(1.0, color=INK, linewidth=0.7, linestyle=":")
    if lumps["true"].notna().any():
        wrong = ("nominal", "o", RANGE, "error of the nominal arm"), ("identified", "*", INK, "error")
        for column, mark, colour, label in wrong:
            error: Array = (lumps[column] - lumps["true"]).abs().to_numpy() / beforehand
            axes.plot(np.maximum(error, LEAST), places, mark, color=colour, markersize=4, linestyle="", label=label)
    left: Array = lumps["sd"].fillna(half).to_numpy() / beforehand
    axes.plot(left, places, "|", color=SURVIVOR, markersize=6, linestyle="", label="standard deviation")
    said = "standard deviation {:.3g} of what was not known beforehand"
    texts = [f"{name}: {said.format(share)}" for name, share in zip(lumps["name"], left, strict=True)]
    say_at(axes, left, places, texts)
    axes.set_xscale("log")
    _, height = size_of(axes)
    named = every(len(places), CLOSE_LABELS * height)
    axes.set_yticks(named, [lumps["name"][place] for place in named])
    axes.set(ylim=(len(places) - 0.5, -0.5), xlabel="share of what was not known beforehand")
    axes.grid(True, axis="x")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return axes


def plot_correlation(found: Findings, axes: Axes | None = None) -> Axes:
    """Correlation of the lumps' factors over the best trials: large where only a combination of them is well known."""
    closest = found.closest
    matrix = closest[found.names].corr().to_numpy()
    return draw_correlation(matrix, found.names, f"correlation over the {len(closest)} best trials", new_axes(axes))


def draw_correlation(matrix: Array, names: list[str], label: str, axes: Axes) -> Axes:
    """Draws how lumps go together.

    Args:
        matrix: the correlations (nlump x nlump).
        names: of the lumps (nlump).
        label: of the colour bar, which says what the correlation is over.
        axes: to draw on.
    """
    image = axes.imshow(matrix, vmin=-1.0, vmax=1.0, cmap="PuOr_r")
    axes.figure.colorbar(image, ax=axes, label=label)
    _, height = size_of(axes)
    named = every(len(names), LABELS * height)
    axes.set_xticks(named, [names[place] for place in named], rotation=90)
    axes.set_yticks(named, [names[place] for place in named])
    axes.tick_params(length=0)
    if len(names) <= READABLE:
        for (row, column), value in np.ndenumerate(matrix):
            colour = "white" if abs(value) > 0.6 else "black"
            axes.text(column, row, f"{value:.2f}", ha="center", va="center", fontsize=6, color=colour)
    return axes
