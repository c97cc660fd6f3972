"""How well the models of a validation track a trajectory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from metaid.show.figures.style import COLOURS, PAGE, new_axes, save, style, verbatim

if TYPE_CHECKING:  # figures of logs do without studies
    from metaid.results import Validation


def plot_tracking(validation: Validation, axes: Axes | None = None) -> Axes:
    """The largest joint error, in degrees, over time, in s, with each model of a validation; in mm of an arm of slides
    alone. Beside hinges slides are left out.
    """
    axes = new_axes(axes)
    unit, (joints, scale) = next(iter(validation.kinds.items()))
    for shown, colour in zip(validation.models, COLOURS, strict=False):
        error = scale * np.abs(shown.errors[:, joints]).max(axis=1)
        label = shown.model if shown.tracked else f"{shown.model} (lost control)"
        line = "--" if shown.model == "true" else "-"  # a good identified model lies exactly under it
        axes.plot(validation.timestep * np.arange(len(error)), error, line, color=colour, label=label)
    axes.set(xlabel="time, s", ylabel=f"largest joint error, {'degrees' if unit == 'deg' else unit}")
    axes.grid(True)
    axes.legend()
    return axes


def draw_tracking(validation: Validation, path: Path) -> None:
    """`plot_tracking` as a file whose ending says the format."""
    with style():
        figure = Figure(figsize=(PAGE, 2.8), layout="constrained")
        axes = plot_tracking(validation, figure.subplots())
        axes.set_title(f"{verbatim(validation.plant)}: computed torque along smooth sinusoids")
    save(figure, path)
