"""A picture of a plant in space: its shapes, its joints, and which way they turn."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from metaid.episode import Episode
from metaid.models import Array
from metaid.plant import ArmPlant
from metaid.show.figures.style import FALL, INK, RANGE, SURVIVOR, style, verbatim

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

BASE = "#8a8a90"
HIGHEST = 3.4  # inches, of a sketch
LIGHT = np.array([0.35, -0.55, 0.76])  # towards the light
THICK = 0.04  # of a link without shapes, as a share of the arm's size


def arm_figure(arm: ArmPlant, width: float) -> Figure:
    """The arm at home with the shapes of its file, or with rods between its joints where the file has none, and what
    its joints are.
    """
    with style():
        figure = Figure(figsize=(width, max(0.62 * width, 0.33 * arm.njoint + 0.6)))
        axes: Axes3D = figure.add_axes((0.0, 0.02, 0.64, 0.92), projection="3d")
        triangles, colours = _surfaces(arm)
        _draw(axes, triangles, colours)
        _draw_joints(axes, *arm.arm.whole.joints_at(arm.home), _size(triangles.reshape(-1, 3)))
        figure.text(0.02, 0.95, f"{verbatim(arm.name)}: {arm.njoint} joint{'s' if arm.njoint > 1 else ''}, at home")
        lines = [_label(arm, i) for i in range(arm.njoint)]
        figure.text(0.7, 0.5, "\n".join(lines), va="center", fontsize=7, linespacing=1.5)
    return figure


def rods_figure(arm: ArmPlant, episode: Episode, width: float) -> Figure:
    """Lines from joint to joint and to the last centre of mass, where the first push begins."""
    import mujoco

    arm.push(episode.starts[0])
    mujoco.mj_kinematics(arm.model, arm.data)
    places, directions = arm.data.xanchor.copy(), arm.data.xaxis.copy()
    line = np.concatenate([np.zeros((1, 3)), places, arm.data.xipos[-1:]])
    with style():
        figure = Figure(figsize=(width, min(0.8 * width, HIGHEST)))
        axes: Axes3D = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d")
        axes.plot(*line.T, color=SURVIVOR, linewidth=4.0, solid_capstyle="round", alpha=0.7)
        _draw_joints(axes, places, directions, _size(line))
        _look_at(axes, line, zoom=0.85)
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.set_pane_color((0.5, 0.5, 0.5, 0.06))
    return figure


def _look_at(axes: Axes3D, points: Array, zoom: float = 1.0) -> None:
    """Obliquely from above, at a cube about these `points` (npoint x 3), in m."""
    middle, half = (points.min(axis=0) + points.max(axis=0)) / 2, 0.5 * _size(points)
    limits = np.stack([middle - half, middle + half], axis=1)
    axes.set(xlim=limits[0], ylim=limits[1], zlim=limits[2], xlabel="x, m", ylabel="y, m", zlabel="z, m")
    axes.zaxis.labelpad = 8.0  # or it touches the numbers
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=zoom)
    axes.view_init(elev=20.0, azim=-60.0)
    axes.locator_params(nbins=4)


def _size(points: Array) -> float:
    """How far apart points (npoint x 3) are, in m; 1 m where they are all in one place."""
    return float(np.ptp(points, axis=0).max()) or 1.0


def _surfaces(arm: ArmPlant) -> tuple[Array, Array]:
    """All triangles (n x 3 x 3), in m, and their colours (n x 3)."""
    from metaid.plant.description import rod, surfaces

    shown = surfaces(arm.arm.whole, arm.home)
    if not any(surface.link >= 0 for surface in shown):
        joints, _ = arm.arm.whole.joints_at(arm.home)
        places = np.concatenate([np.zeros((1, 3)), joints, arm.arm.whole.tip_at(arm.home)[None]])
        size = _size(places)
        thick = THICK * size * 0.95 ** np.arange(len(places))  # so that no two surfaces are in one place
        shown = [rod(a, b, thick[i], i - 1) for i, (a, b) in enumerate(pairwise(places))]
    colours = [to_rgb(BASE if surface.link < 0 else (RANGE, SURVIVOR)[surface.link % 2]) for surface in shown]
    counts = [len(surface.triangles) for surface in shown]
    return np.concatenate([surface.triangles for surface in shown]), np.repeat(colours, counts, axis=0)


def _draw(axes: Axes3D, triangles: Array, colours: Array) -> None:
    """The triangles, the darker the more they face away from the light, seen obliquely from above."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    seen = lengths > 0
    facing = (normals[seen] / lengths[seen, None]) @ (LIGHT / np.linalg.norm(LIGHT))
    shaded = np.clip(colours[seen] * (0.72 + 0.28 * facing[:, None]), 0.0, 1.0)
    axes.add_collection3d(Poly3DCollection(triangles[seen], facecolors=shaded, edgecolors=shaded, linewidths=0.2))
    _look_at(axes, triangles.reshape(-1, 3))


def _draw_joints(axes: Axes3D, places: Array, directions: Array, size: float) -> None:
    """The axis of each joint with its number, the arrow by the right-hand rule."""
    for i, (place, direction) in enumerate(zip(places, directions, strict=True)):
        start, end = place - 0.1 * size * direction, place + 0.14 * size * direction
        axes.plot(*np.stack([start, end], axis=1), color=FALL, linewidth=0.9, zorder=10)
        axes.plot(*end[:, None], marker="o", markersize=2.0, color=FALL, zorder=10)
        axes.text(*(place + 0.19 * size * direction), str(i + 1), color=INK, ha="center", va="center", zorder=11)


def _label(arm: ArmPlant, i: int) -> str:
    tree = arm.tree
    low, high = tree.low[i], tree.high[i]
    if tree.slides[i]:
        kind, reach = "slide", f"{low:g} to {high:g} m"
    else:
        kind, reach = "hinge", f"{np.degrees(low):.0f}° to {np.degrees(high):.0f}°"
    reach = "without limits" if np.isinf([low, high]).any() else reach.replace("-", "−")
    return f"{i + 1}  {verbatim(tree.names[i])}, link of {tree.mass[i]:.3g} kg\n     {kind}, {reach}"
