"""Pictures, with matplotlib; each function draws on an Axes and returns it, or writes a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from metaid.chain import Array
from metaid.episode import Trajectory, run_plain
from metaid.objective import Objective
from metaid.validation import Validation

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # Okabe and Ito, for all eyes


def plot_angles(axes: Axes, trajectory: Trajectory, timestep: float) -> Axes:
    """Joint angles, in degrees, over time, in s."""
    times = timestep * np.arange(len(trajectory.angles))
    for joint, angles in enumerate(trajectory.angles.T):
        axes.plot(
            times, np.degrees(angles), color=COLOURS[joint % len(COLOURS)], linewidth=1.2, label=f"joint {joint + 1}"
        )
    axes.set_xlabel("time, s")
    axes.set_ylabel("joint angle, degrees")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left", frameon=False, ncols=min(len(trajectory.angles.T), 5))
    return axes


def draw_episode(objective: Objective, factors: Array, path: Path) -> None:
    """Joint angles of a candidate's episode, as a file whose ending says the format."""
    record, trajectory = run_plain(objective.plant, objective.nominal.scaled(factors), objective.episode)
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    axes = plot_angles(figure.subplots(), trajectory, record.timestep)
    axes.set_title(f"{objective.plant.name}: {'fell' if record.fall_step is not None else 'no fall'}", loc="left")
    figure.savefig(path, dpi=160)


def draw_tracking(validation: Validation, path: Path) -> None:
    """The largest joint error over time, in degrees, with each model of a validation."""
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    axes = figure.subplots()
    for shown, colour in zip(validation.models, COLOURS, strict=False):
        error = np.degrees(np.abs(shown.errors).max(axis=1))
        label = shown.model if shown.tracked else f"{shown.model} (lost control)"
        line = "--" if shown.model == "true" else "-"  # a good identified model lies exactly under it
        axes.plot(validation.timestep * np.arange(len(error)), error, line, color=colour, linewidth=1.2, label=label)
    axes.set_xlabel("time, s")
    axes.set_ylabel("largest joint error, degrees")
    axes.set_title(f"{validation.plant}: computed torque along smooth sinusoids", loc="left")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=160)
