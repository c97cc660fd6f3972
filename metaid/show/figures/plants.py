"""A labelled sketch of a plant: lengths, masses, centres of mass."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from metaid.episode import Episode
from metaid.models import Chain
from metaid.plant import ArmPlant, MujocoPlant
from metaid.show.figures.space import arm_figure, rods_figure
from metaid.show.figures.style import FALL, INK, PAGE, RANGE, SURVIVOR, new_axes, style, verbatim

BEND = np.radians(14.0)  # of the links, to and fro, so that one can see where each ends


def plot_plant(plant: MujocoPlant, axes: Axes | None = None) -> Axes:
    """The chain, bent a little at every joint: links with their length, mass, centre of mass and inertia, in SI units.

    The lengths are to scale, in m.
    """
    axes = new_axes(axes)
    chain = plant.chain
    bends = BEND * np.where(np.arange(chain.nlink) % 2 == 0, 1.0, -1.0)
    along = np.stack([np.sin(bends), np.cos(bends)], axis=-1)
    tips = np.cumsum(chain.length[:, None] * along, axis=0)
    joints = np.vstack([np.zeros(2), tips])
    coms = joints[:-1] + chain.com[:, None] * along
    reach = float(tips[-1, 1])
    axes.plot([-0.12 * reach, 0.12 * reach], [0.0, 0.0], color=INK, linewidth=2.0)
    axes.plot(joints[:, 0], joints[:, 1], color=RANGE, linewidth=5.0, solid_capstyle="round")
    axes.plot(joints[:-1, 0], joints[:-1, 1], "o", color=SURVIVOR, markersize=6, label="joint")
    axes.plot(coms[:, 0], coms[:, 1], "P", color=FALL, markersize=6, label="centre of mass")
    for i in range(chain.nlink):
        middle = (joints[i] + joints[i + 1]) / 2
        axes.annotate(
            _label(chain, i),
            xy=(middle[0], middle[1]),
            xytext=(float(joints[:, 0].max()) + 0.12 * reach, middle[1]),
            va="center",
            fontsize=7,
            arrowprops={"arrowstyle": "-", "color": INK, "linewidth": 0.4, "shrinkB": 3.0},
        )
    axes.annotate(
        "",
        xy=(-0.2 * reach, 0.72 * reach),
        xytext=(-0.2 * reach, 0.9 * reach),
        arrowprops={"arrowstyle": "->", "color": INK},
    )
    axes.text(
        -0.22 * reach, 0.8 * reach, f"g = {plant.gravity:g} m/s²", rotation=90, ha="right", va="center", fontsize=7
    )
    axes.set(aspect="equal", xlim=(-0.35 * reach, 1.1 * reach), ylim=(-0.05 * reach, 1.03 * reach))
    axes.set(ylabel="height, m", xticks=[])
    axes.spines["bottom"].set_visible(False)
    axes.set_title(f"{verbatim(plant.name)}: {chain.nlink} link{'s' if chain.nlink > 1 else ''}")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=2)
    return axes


def _label(chain: Chain, i: int) -> str:
    damping = f", damping {chain.damping[i]:.3g} N m s" if chain.damping[i] else ""
    return (
        f"link {i + 1}: length {chain.length[i]:.3g} m, mass {chain.mass[i]:.3g} kg\n"
        f"centre of mass at {chain.com[i]:.3g} m\ninertia {chain.inertia[i]:.2g} kg m²{damping}"
    )


def plant_figure(plant: MujocoPlant | ArmPlant, width: float | None = None) -> Figure:
    """A sketch of a plant, `width` inches wide, or as wide as suits it, and as high as its labels need. Lengths are
    to scale, in m.
    """
    if not isinstance(plant, MujocoPlant):
        return arm_figure(plant, PAGE if width is None else width)
    width = 0.64 * PAGE if width is None else width
    with style():
        figure = Figure(figsize=(width, max(3.2, 0.5 * plant.njoint)), layout="constrained")
        plot_plant(plant, figure.subplots())
    return figure


def sketch(plant: MujocoPlant | ArmPlant, episode: Episode, width: float) -> Figure:
    """A plant without shapes, `width` inches wide, as an `episode` of it may begin."""
    return plant_figure(plant, width) if isinstance(plant, MujocoPlant) else rods_figure(plant, episode, width)
