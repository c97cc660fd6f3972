"""How a search went: the best frequency, the error, and every lump's factor over the trials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, MaxNLocator

from metaid.models import Array
from metaid.show.figures.style import COLOURS, FALL, FELL, INK, MANY, RANGE, SURVIVED, SURVIVOR, new_axes, say_at

if TYPE_CHECKING:  # figures of logs do without studies
    from metaid.results import Findings

FEW = 60  # trials, each of which is a large mark


def plot_convergence(found: Findings, axes: Axes | None = None) -> Axes:
    """The best frequency so far over the trials; falls are marked along the top."""
    axes = new_axes(axes)
    survivors = found.survivors
    best = survivors["value"].cummin()
    axes.plot(
        survivors["number"],
        survivors["value"],
        ".",
        color=RANGE,
        markersize=_size(len(survivors)),
        label="survivor",
        rasterized=len(best) > MANY,
    )
    axes.step(survivors["number"], best, where="post", color=SURVIVOR, label="best so far")
    better = survivors[survivors["value"] < best.shift(fill_value=np.inf)]
    told = survivors if len(survivors) <= FEW else better
    unit = found.problem.measure.unit
    texts = [f"trial {number}: {value:.4g} {unit}" for number, value in zip(told["number"], told["value"], strict=True)]
    say_at(axes, told["number"], told["value"], texts)
    _mark_falls(found, axes)
    if unit == "Hz":
        _logarithmic(axes, survivors["value"].to_numpy(), found.problem.resolution)
    if survivors["value"].min() < 10 * found.problem.resolution:
        axes.axhline(
            found.problem.resolution, color=INK, linewidth=0.7, linestyle=":", label="resolution of the measure"
        )
    return _finish(axes, found.label)


def plot_error(found: Findings, axes: Axes | None = None) -> Axes:
    """How wrong the best candidate so far is, in %: its largest error of a lump, or of an arm its dynamics on states
    that no trial has seen. It needs a plant that knows its truth.
    """
    axes, bests = new_axes(axes), found.bests
    if len(bests) > FEW and found.nominal_error is not None:  # a hundred states each
        bests = bests.iloc[np.unique(np.geomspace(1, len(bests), FEW).round().astype(int)) - 1]
    curves = found.error_curves(bests)
    label = f"{next(iter(curves))}, %" if len(curves) == 1 else "error of the best so far, %"
    if not curves:
        why = "the plant does not tell its truth" if found.true_factors is None else "no lump is identified"
        axes.text(0.5, 0.5, why, transform=axes.transAxes, ha="center")
        return _finish(axes, label)
    last, colours = found.trials["number"].max(), [SURVIVOR] if len(curves) == 1 else COLOURS[2:]
    for (name, errors), colour in zip(curves.items(), colours, strict=False):
        percent, numbers = 100.0 * errors, bests["number"]
        axes.step(np.append(numbers, last), np.append(percent, percent[-1:]), where="post", color=colour, label=name)
        texts = [f"trial {number}: {error:.3g} %" for number, error in zip(numbers, percent, strict=True)]
        say_at(axes, numbers, percent, texts)
    axes.axhline(1.0, color=INK, linewidth=0.7, linestyle=":", label="1 %")
    axes.set_yscale("log")
    return _finish(axes, label)


def plot_factor(found: Findings, lump: str, axes: Axes | None = None) -> Axes:
    """One lump's factor over the trials, falls marked; the truth, where it is known, as a line. A base parameter is
    shown as how far it is from the nominal one, in its standard deviations beforehand.
    """
    axes = new_axes(axes)
    index = found.index(lump)
    survivors, falls = found.drawn_rows(found.survivors), found.drawn_rows(found.falls)
    many = len(found.trials) > MANY
    size = _size(len(survivors))
    axes.plot(survivors["number"], survivors[lump], **SURVIVED, marker=".", markersize=size, rasterized=many)
    if len(falls):
        axes.plot(falls["number"], falls[lump], **FELL, rasterized=many)
    if found.true_factors is not None:
        axes.axhline(found.drawn(found.true_factors)[index], color=INK, linewidth=0.8, linestyle="--", label="truth")
    axes.set_title(lump)
    return _finish(axes, found.sought.axis)


def _mark_falls(found: Findings, axes: Axes) -> None:
    falls = found.falls["number"].to_numpy()
    if not len(falls):  # an empty line that is not clipped has a place all the same: the layout would make room for it
        return
    axes.plot(
        falls,
        np.full(len(falls), 1.0),
        "|",
        color=FALL,
        markersize=6,
        transform=axes.get_xaxis_transform(),
        clip_on=False,
        label=f"fall ({len(falls)})",
        rasterized=len(falls) > MANY,
    )


def _logarithmic(axes: Axes, values: Array, resolution: float) -> None:
    """Logarithmic, but for values down to zero linear below what the measure can tell apart."""
    if len(values) and values.min() > 0.0:
        axes.set_yscale("log")
    else:
        axes.set_yscale("symlog", linthresh=resolution)
        axes.set_ylim(bottom=0.0)
        # Smaller powers of ten are where the axis is linear: their labels would be in the place of the zero's.
        powers = 10.0 ** np.arange(
            np.ceil(np.log10(resolution)), np.log10(max(values.max(initial=0.0), resolution)) + 1
        )
        axes.yaxis.set_major_locator(FixedLocator([0.0, *powers.tolist()]))


def _size(count: int) -> float:
    """Of a mark, in points, where there are so many: few are to be seen, too."""
    return 6.0 if count <= FEW else 2.0


def _finish(axes: Axes, label: str) -> Axes:
    axes.set_xlabel("trial")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))
    axes.set_ylabel(label)
    axes.grid(True)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best")
    return axes
