"""How the panels of a figure are laid out: on a page side by side, in a column below one another."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from metaid.show.figures.style import PAGE

MANY = 20  # rows of a square, which then needs more height for their names


def pair_of_panels(width: float, ratios: tuple[int, int]) -> tuple[Figure, list[Axes]]:
    """Two panels: side by side on a page, one above the other in a column."""
    if width < PAGE:
        figure = Figure(figsize=(width, 4.6), layout="constrained")
        return figure, list(figure.subplots(2, 1))
    figure = Figure(figsize=(width, 2.6), layout="constrained")
    return figure, list(figure.subplots(1, 2, width_ratios=ratios))


def panels(width: float, count: int) -> tuple[Figure, list[Axes]]:
    """So many panels, row by row."""
    columns = min(count, 3 if width >= PAGE else 2)
    rows = -(-count // columns)
    figure = Figure(figsize=(width, max(1.9 * rows, 2.4)), layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    for panel in axes[count:]:
        panel.remove()
    return figure, axes[:count]


def pairs_of_panels(width: float, count: int) -> tuple[Figure, list[tuple[Axes, Axes]]]:
    """So many pairs of panels, the second of each below the first; those of a row have the same scale."""
    columns = min(count, 3 if width >= PAGE else 2)
    rows = -(-count // columns)
    figure = Figure(figsize=(width, 2.7 * rows + 0.3), layout="constrained")
    axes = figure.subplots(2 * rows, columns, squeeze=False, sharex=True, sharey="row", height_ratios=[3, 2] * rows)
    pairs = list(zip(axes[::2].flat, axes[1::2].flat, strict=True))
    for pair in pairs[count:]:
        for panel in pair:
            panel.remove()
    return figure, pairs[:count]


def square(width: float, count: int) -> Figure:
    """For a square of `count` rows, as wide as all others."""
    return Figure(figsize=(width, min(0.9 * width, 3.6 if count < MANY else 5.4)), layout="constrained")


def share_legend(figure: Figure, axes: list[Axes]) -> None:
    """One legend above all panels, with each label once, instead of one in each."""
    labelled = {label: mark for panel in axes for mark, label in zip(*panel.get_legend_handles_labels(), strict=True)}
    for panel in axes:
        if legend := panel.get_legend():
            legend.remove()
    if not labelled:
        return
    figure.legend(
        labelled.values(), labelled.keys(), loc="outside upper center", ncols=5 if figure.get_figwidth() >= PAGE else 2
    )
