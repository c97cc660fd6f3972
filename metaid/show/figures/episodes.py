"""What an episode showed: joint angles over time, and the phase portrait."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from metaid.episode import States
from metaid.models import Array
from metaid.show.figures.panels import pair_of_panels
from metaid.show.figures.style import COLOURS, FALL, PAGE, new_axes, save, style, verbatim

if TYPE_CHECKING:  # figures of logs do without numba
    from metaid.compiled import ArmPush, Objective


def plot_angles(trajectory: States, timestep: float, axes: Axes | None = None) -> Axes:
    """Joint angles, in degrees, over time, in s."""
    axes = new_axes(axes)
    times = timestep * np.arange(len(trajectory.angles))
    for joint, angles in enumerate(trajectory.angles.T):
        axes.plot(times, np.degrees(angles), color=COLOURS[joint % len(COLOURS)], label=f"joint {joint + 1}")
    axes.set(xlabel="time, s", ylabel="joint angle, degrees")
    axes.grid(True)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=min(len(trajectory.angles.T), 5))
    return axes


def plot_phase(trajectory: States, axes: Axes | None = None) -> Axes:
    """Joint speeds, in degrees per second, over joint angles, in degrees; a dot where each starts."""
    axes = new_axes(axes)
    for joint, (angles, speeds) in enumerate(
        zip(np.degrees(trajectory.angles.T), np.degrees(trajectory.speeds.T), strict=True)
    ):
        colour = COLOURS[joint % len(COLOURS)]
        axes.plot(angles, speeds, color=colour, label=f"joint {joint + 1}")
        axes.plot(angles[0], speeds[0], "o", color=colour, markersize=3)
    axes.set(xlabel="joint angle, degrees", ylabel="joint speed, degrees/s")
    axes.grid(True)
    return axes


def draw_episode(objective: Objective, factors: Array, path: Path) -> None:
    """Angles and phase portrait of a candidate's episode, as a file whose ending says the format."""
    record, trajectory = objective.watch(factors)
    with style():
        figure, (left, right) = pair_of_panels(PAGE, (3, 2))
        plot_angles(trajectory, record.timestep, left)
        plot_phase(trajectory, right)
        left.set_title(f"{verbatim(objective.plant.name)}: {'fell' if record.fall_step is not None else 'no fall'}")
    save(figure, path)


def plot_speeds(push: ArmPush, axes: Axes | None = None) -> Axes:
    """Speeds of an arm's joints over time, in s, in rad/s or m/s; a joint that coasts is a level line."""
    axes = new_axes(axes)
    for joint, (name, speeds) in enumerate(zip(push.joints, push.speeds.T, strict=True)):
        style_of_line = "-" if joint < len(COLOURS) else "--"
        axes.plot(push.times, speeds, style_of_line, color=COLOURS[joint % len(COLOURS)], label=verbatim(name))
        axes.axhline(speeds[0], color=COLOURS[joint % len(COLOURS)], linewidth=0.5, alpha=0.5)
    if push.fall_step is not None:
        axes.axvline(push.times[-1], color=FALL, linestyle=":", label="fall")
    axes.set_xlabel("time, s")
    axes.set_ylabel("joint speed, rad/s or m/s" if push.slides.any() else "joint speed, rad/s")
    axes.grid(True)
    return axes


def draw_push(push: ArmPush, path: Path) -> None:
    """The speeds of an arm's joints after a push, as a file whose ending says the format."""
    with style():
        figure = Figure(figsize=(PAGE, 2.8), layout="constrained")
        axes = plot_speeds(push, figure.subplots())
        axes.set_title(f"{verbatim(push.plant)}: {'no fall' if push.fall_step is None else 'fell'}")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside right center")
    save(figure, path)
