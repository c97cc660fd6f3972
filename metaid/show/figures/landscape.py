"""What the measure looks like over the factors: where candidates fall, and how the frequency grows from its least."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from numpy.typing import NDArray

from metaid.models import Array
from metaid.show.figures.style import FALL, FELL, INK, LINE_VALUES, MANY, SURVIVED, SURVIVOR, new_axes

if TYPE_CHECKING:  # figures of logs do without studies
    from metaid.results import Findings, Plane, Sweep

LINES = 400  # of parallel coordinates at most: half of them the best, the others evenly over the trials


def plot_boundary(
    found: Findings, first: str, second: str, axes: Axes | None = None, boundary: Plane | None = None
) -> Axes:
    """Falls and survivors over the factors of two lumps, with the best and the truth.

    Args:
        found: the study.
        first: the name of the lump along the horizontal axis.
        second: the name of the lump along the vertical axis.
        axes: to draw on; default: a new one.
        boundary: from `metaid.results.plane`; adds where candidates fall in the plane through the best one. In it the
            other lumps are the best one's, whereas trials lie off it.

    Raises:
        StorageError: there is no such lump.
    """
    axes = new_axes(axes)
    one, two = found.index(first), found.index(second)
    if boundary is not None:
        fell = boundary.fell.astype(float)
        axes.contourf(boundary.first, boundary.second, fell, levels=[0.5, 1.5], colors=[FALL], alpha=0.15)
        if fell.any() and not fell.all():
            axes.contour(boundary.first, boundary.second, fell, levels=[0.5], colors=[FALL], linewidths=1.2)
            axes.plot([], [], color=FALL, label="edge of falling, the others at their best")
    many = len(found.trials) > MANY
    survivors, falls = found.drawn_rows(found.survivors), found.drawn_rows(found.falls)
    x, y = survivors[first], survivors[second]
    axes.plot(x, y, **SURVIVED, marker="o", markersize=2.5, markeredgewidth=0, rasterized=many)
    if len(falls):
        axes.plot(falls[first], falls[second], **FELL, rasterized=many)
    if len(survivors):
        axes.plot(
            *found.drawn(found.best_factors)[[one, two]],
            "D",
            color="none",
            markeredgecolor=INK,
            markersize=6,
            label="best",
        )
    if found.true_factors is not None:
        axes.plot(*found.drawn(found.true_factors)[[one, two]], "*", color=INK, markersize=9, label="truth")
    axes.set(xlabel=found.sought.label(first), ylabel=found.sought.label(second))
    axes.grid(True)
    axes.legend(loc="best")
    return axes


def plot_sweep(found: Findings, swept: Sweep, axes: Axes | None = None) -> Axes:
    """The frequency against one lump's factor, the others at their best: the paper's Table I as a curve."""
    axes = new_axes(axes)
    axes.plot(swept.factors, swept.values, color=SURVIVOR, marker=".", markersize=3, label=found.problem.measure.name)
    for run in _runs(swept.fell):
        edges = swept.factors[[max(run[0] - 1, 0), run[-1]]]
        axes.axvspan(*edges, color=FALL, alpha=0.15, linewidth=0)
    if swept.fell.any():
        axes.fill_between([], [], [], color=FALL, alpha=0.15, linewidth=0, label="falls")
    if found.true_factors is not None:
        axes.axvline(found.true_factors[swept.lump], color=INK, linewidth=0.8, linestyle="--", label="truth")
    axes.set_title(found.names[swept.lump])
    axes.set_ylim(0.0, 1.08 * max(np.nanmax(swept.values, initial=0.0), found.problem.resolution))
    axes.set(xlabel="factor of nominal", ylabel=found.label)
    axes.grid(True)
    axes.legend(loc="best")
    return axes


def _runs(mask: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Indices of each unbroken run of True."""
    indices = np.flatnonzero(mask)
    return [run for run in np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1) if len(run)]


def plot_parallel(found: Findings, axes: Axes | None = None) -> Axes:
    """Parallel coordinates: every line a trial, its colour the frequency; falls dotted, the truth in ink.

    Of many trials the best are drawn, and the others evenly thinned.
    """
    from metaid.results import best_and_even, evenly

    axes = new_axes(axes)
    places = np.arange(len(found.names))

    def lines(trials: pd.DataFrame) -> list[Array]:
        factors = found.drawn(trials[found.names].to_numpy(dtype=np.float64))
        return list(np.stack([np.broadcast_to(places, factors.shape), factors], axis=-1))

    shown = best_and_even(found.survivors, LINES, LINES // 2).sort_values("value", ascending=False)
    falls = evenly(found.falls, LINES // 4)
    if len(falls):
        axes.add_collection(
            LineCollection(lines(falls), colors=FALL, linewidths=0.6, linestyles=":", alpha=0.7, label="fall")
        )
    values = shown["value"].to_numpy()
    norm = LogNorm() if len(values) and values.min() > 0.0 else Normalize()
    drawn = LineCollection(lines(shown), array=values, cmap=LINE_VALUES, norm=norm, linewidths=0.6, alpha=0.8)
    axes.add_collection(drawn)
    axes.figure.colorbar(drawn, ax=axes, label=found.label, pad=0.01)
    if found.true_factors is not None:
        (truth,) = axes.plot(places, found.drawn(found.true_factors), "*", color=INK, markersize=7, label="truth")
        truth.set(markeredgecolor="white", markeredgewidth=0.5)  # a wider edge leaves no star
    for place in places.tolist():
        axes.axvline(place, color=INK, linewidth=0.4, alpha=0.5)
    axes.autoscale_view()
    crowded = len(places) > axes.bbox.width / axes.figure.dpi  # more than a label an inch
    axes.set_xticks(places, found.names, rotation=90 if crowded else 0)
    axes.set_ylabel(found.sought.axis)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best")
    return axes
