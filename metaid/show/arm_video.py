"""Moving pictures of an arm that is let go at home, moving slowly, under the laws of several models side by side."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from metaid.compiled.arms import ArmLoop
from metaid.episode.arms import ArmEpisode
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant.arms import ArmPlant, ArmStart
from metaid.show.scene import arm_scene, scene_poses, side_camera
from metaid.show.video import RATES, Motion, together, write_film

SECONDS = 4.0
SLOW, SLIDING = 0.2, 0.05  # rad/s and m/s at which joints set out
RUNAWAY = 20.0  # times that fast: a film shows a fall for longer than an episode does


def film_arm(plant: ArmPlant, nominal: Tree, candidates: Mapping[str, Array], path: Path) -> None:
    """Writes what a simulated arm does, in real time, in a panel a candidate: where the law is right it goes on as it
    set out, as if nothing weighed anything.

    Args:
        plant: that is filmed, with the shapes of its file.
        nominal: what is believed of it.
        candidates: parameters of the laws (njoint x 13), by the captions of their panels.
        path: of the file; its ending says the format.

    Raises:
        RenderError: nothing here can render.
    """
    motions = [filmed_arm(plant, nominal, law, caption, RATES[path.suffix]) for caption, law in candidates.items()]
    model = arm_scene(plant)
    poses = scene_poses(plant, model, together(motions))
    write_film(model, poses, side_camera(model, poses), motions, path)


def filmed_arm(plant: ArmPlant, nominal: Tree, law: Array, caption: str, rate: int) -> Motion:
    """The motion of a panel.

    Args:
        plant: that moves.
        nominal: what is believed of it.
        law: parameters of the candidate (njoint x 13).
        caption: of the panel.
        rate: frames a second.
    """
    start = slow_start(plant)
    steps = max(round(SECONDS / plant.timestep), 1)
    ends = np.unique(np.arange(1.0 / rate, SECONDS, 1.0 / rate) / plant.timestep).round().astype(int)
    episode = ArmEpisode((start,), np.zeros(1), steps, tuple(ends.tolist()), RUNAWAY)
    record = ArmLoop(plant, nominal, episode).run(law)
    seen = record.windows.angles[0, : record.windows.seen[0]]
    angles = np.concatenate([start.pose[None], seen])
    return Motion(f"{caption}: falls" if record.fell[0] else caption, angles)


def slow_start(plant: ArmPlant) -> ArmStart:
    """At home, every joint moving slowly towards the middle of its range."""
    tree, home = plant.tree, plant.home
    middle = np.where(np.isfinite(tree.low + tree.high), (tree.low + tree.high) / 2, 0.0)
    speeds = np.where(tree.slides, SLIDING, SLOW) * np.where(home > middle, -1.0, 1.0)
    return ArmStart(home, speeds)
