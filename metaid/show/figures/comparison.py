"""What several studies found of each lump, side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from metaid.show.figures.style import COLOURS, INK, WIDTHS, new_axes, say_at, style

if TYPE_CHECKING:  # figures of logs do without studies
    from metaid.results import Comparison

SHARE = 0.7  # of the height of a lump, for the intervals of all studies


def plot_comparison(found: Comparison, axes: Axes | None = None) -> Axes:
    """A row a lump: what each study found, with its interval, in % of the truth or, where that is not known, of what
    the first study found that knows the lump.
    """
    axes = new_axes(axes)
    names, reference = found.lump_names, found.reference
    places = {name: place for place, name in enumerate(names)}
    step = SHARE / len(found.names)
    for i, study in enumerate(found.names):
        lumps = found.of(study)
        lumps = lumps[lumps["identified"].notna() & reference.reindex(lumps.index).ne(0.0)]
        against = reference.reindex(lumps.index)
        middle, low, high = (100.0 * (lumps[key] - against) / against.abs() for key in ("identified", "low", "high"))
        at = [places[name] + step * (i - 0.5 * (len(found.names) - 1)) for name in lumps.index]
        reach = [(middle - low).fillna(0.0).abs(), (high - middle).fillna(0.0).abs()]
        colour = COLOURS[i % len(COLOURS)]
        axes.errorbar(middle, at, xerr=reach, fmt="o", markersize=3, capsize=2, color=colour, label=study)
        texts = [
            f"{study}: {name} {lump['identified']:.5g}, from {lump['low']:.5g} to {lump['high']:.5g} {lump['unit']}"
            for name, lump in lumps.iterrows()
        ]
        say_at(axes, middle, at, texts)
    axes.axvline(0.0, color=INK, linewidth=0.7, linestyle=":")
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.margins(x=0.08)
    axes.locator_params(axis="x", nbins=5)
    axes.set_xlabel(f"deviation from {'the truth' if found.knows_truth else 'the first study'}, %", loc="left")
    axes.grid(True, axis="x")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=min(len(found.names), 3))
    return axes


def comparison_figure(found: Comparison, width: str = "page") -> Figure:
    """The same as a figure of a journal's `width`, "page" or "column"."""
    with style():
        rows = len(found.lump_names) * max(0.2, 0.08 * len(found.names))
        figure = Figure(figsize=(WIDTHS[width], max(1.2 + rows, 2.4)), layout="constrained")
        plot_comparison(found, figure.subplots())
    return figure
