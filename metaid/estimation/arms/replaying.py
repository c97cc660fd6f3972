"""A trial of an arm beside what the twin at an estimate shows in its place."""

from __future__ import annotations

import numpy as np

from metaid.compiled.arms import Frames, follow_laws, follow_torques, frames_of
from metaid.estimation.arms.trials import ArmReadTrial, WatchedArmTrial
from metaid.estimation.trials import Replay
from metaid.models import Array
from metaid.models.tree import Tree


def replay_arm(tree: Tree, parameters: Array, trial: WatchedArmTrial | ArmReadTrial) -> Replay:
    """What was seen of a trial, and the twin under the same law, or driven by what was commanded.

    Args:
        tree: the arm; its parameters have no influence.
        parameters: of the twin (njoint x 13).
        trial: which of them.

    Returns:
        Joint coordinates in rad, of slides in m.
    """
    frames, candidates = frames_of(tree), np.ascontiguousarray(parameters[None])
    if isinstance(trial, WatchedArmTrial):
        return Replay(*_watched(frames, candidates, trial), np.zeros(tree.njoint), tree.names)
    return Replay(*_read(frames, candidates, trial), trial.noise, tree.names)


def _watched(frames: Frames, candidates: Array, trial: WatchedArmTrial) -> tuple[Array, Array, Array]:
    """Times, what was seen, and the twin. Steps are Euler's, so the speeds after each are all that there is to know of
    where the twin is.
    """
    ends, seen = trial.windows.ends, np.arange(len(trial.windows.ends)) < trial.windows.seen[:, None]
    last = np.append(0, ends)[trial.windows.seen]
    steps = np.arange(1, ends[-1] + 1)
    twin = follow_laws(frames, trial.law, candidates, (trial.starts, trial.stiffness), (steps, last), trial.timestep)
    angles = trial.starts[:, 0, None] + trial.timestep * np.cumsum(twin.values[0], axis=1)
    shown = (steps <= last[:, None]) & twin.arrived[0][:, None]
    watched = np.full(angles.shape, np.nan)
    watched[:, ends - 1] = np.where(seen[..., None], trial.windows.angles, np.nan)
    simulated = np.where(shown[..., None], angles, np.nan)
    return trial.timestep * steps, watched, simulated


def _read(frames: Frames, candidates: Array, trial: ArmReadTrial) -> tuple[Array, Array, Array]:
    """The same of a twin that is driven by what was commanded."""
    count = trial.readings.shape[1]
    each = np.eye(count)[None], np.zeros(len(trial.readings), dtype=np.int64), trial.steps
    twin = follow_torques(frames, candidates, trial.starts[None], trial.torques, each, trial.timestep)
    shown = np.arange(count) <= trial.steps[:, None]
    seen, simulated = (
        np.where(kept[..., None], angles, np.nan)
        for kept, angles in ((shown, trial.readings), (shown & twin.arrived[0][:, None], twin.values[0]))
    )
    return trial.timestep * np.arange(count, dtype=np.float64), seen, simulated
