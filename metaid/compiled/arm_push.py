"""One push of an arm, looked at: where each joint goes, and what becomes of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.compiled.fastest import fastest_loop
from metaid.episode import MEASURES, Spatial, arm_episode
from metaid.errors import EpisodeError
from metaid.models import Array
from metaid.plant import ArmPlant
from metaid.plant.description import draw_starts

STILL = 1e-3  # of the fastest joint at the start: a speed that changes by less stays what it was
STOPPED = 0.02  # of its speed at the start
LOOKS = 400  # at most, at which the motion is kept
LONGEST = 100_000  # steps: of a longer coast joints would hardly move, for they stay in their ranges


@dataclass(frozen=True, eq=False)
class ArmPush:
    """What an arm did after a push.

    Attributes:
        plant: its name.
        joints: their names (njoint).
        slides: which of them are slides, and no hinges (njoint).
        times: at which it was looked at (nlook), in s, from 0 on; the last is that of the fall where it fell.
        coordinates: of the joints (nlook x njoint), in rad or m.
        speeds: of the joints (nlook x njoint), in rad/s or m/s.
        steps: that were to be made.
        fall_step: at which it fell; None where it did not.
        runs_away: which joints were too fast at the fall (njoint).
        leaves: which joints left their range at the fall (njoint).
        frequency: Rice's in the kinetic metric, in Hz; None where it fell.
    """

    plant: str
    joints: tuple[str, ...]
    slides: NDArray[np.bool_]
    times: Array
    coordinates: Array
    speeds: Array
    steps: int
    fall_step: int | None
    runs_away: NDArray[np.bool_]
    leaves: NDArray[np.bool_]
    frequency: float | None

    def does(self, joint: int) -> str:
        """What a joint does, in a word or two. Under an exact law it coasts: its speed stays what it was."""
        if self.runs_away[joint]:
            return "runs away"
        if self.leaves[joint]:
            return "leaves its range"
        first, last = self.speeds[[0, -1], joint]
        alike = self.slides == self.slides[joint]
        if abs(last - first) <= STILL * np.abs(self.speeds[0, alike]).max():
            return "coasts"
        if abs(last) <= STOPPED * abs(first):
            return "stops"
        if first * last < 0.0:
            return "turns back"
        return "speeds up" if abs(last) > abs(first) else "slows down"

    def summary(self) -> dict[str, Any]:
        """What `metaid episode --json` prints of an arm."""
        return {
            "plant": self.plant,
            "steps": self.steps,
            "fell": self.fall_step is not None,
            "fall_step": self.fall_step,
            "fall_time_s": None if self.fall_step is None else float(self.times[-1]),
            "kinetic_hz": self.frequency,
            "joints": [
                {
                    "name": name,
                    "unit": "m" if self.slides[i] else "rad",
                    "from": float(self.coordinates[0, i]),
                    "to": float(self.coordinates[-1, i]),
                    "start_speed": float(self.speeds[0, i]),
                    "end_speed": float(self.speeds[-1, i]),
                    "does": self.does(i),
                }
                for i, name in enumerate(self.joints)
            ],
        }


def push_arm(plant: ArmPlant, law: Array, steps: int, seed: int = 0) -> ArmPush:
    """Pushes an arm once.

    Args:
        plant: that moves.
        law: parameters (njoint x 13) of the arm whose bias force and friction it is sent.
        steps: that it is watched for; an ideal coast stays in the joint ranges for so long.
        seed: of where it begins, and of the noise of its sensors.

    Raises:
        EpisodeError: there are too many steps.
        PlantError: it has no start that is clear of itself.
    """
    if not 1 <= steps <= LONGEST:
        raise EpisodeError(f"steps is {steps} (allowed of an arm: 1 to {LONGEST})")
    (start,) = draw_starts(plant, 1, steps * plant.timestep, seed)
    looks = tuple(np.unique(np.linspace(1, steps, min(steps, LOOKS)).round().astype(int)).tolist())
    episode = arm_episode(plant.tree, (start,), np.zeros(1), steps, window_ends=looks, seed=seed)
    record = fastest_loop(plant, episode, plant.tree.parameters).run(law)
    assert record.windows is not None, "it has window ends"
    seen = int(record.windows.seen[0])
    ends, motion = [0, *looks[:seen]], record.windows.motion[0, :seen]
    coordinates, speeds = ([first, *motion[:, i]] for i, first in enumerate((start.pose, start.speeds)))
    fell = bool(record.fell[0])
    low, high, allowed = Spatial(plant.tree).bounds(episode)
    runs_away = leaves = np.zeros(plant.njoint, dtype=np.bool_)
    if fell:
        position, speed = plant.states()
        ends.append(int(record.steps[0]))
        coordinates.append(position)
        speeds.append(speed)
        runs_away, leaves = np.abs(speed) > allowed, (position < low) | (position > high)
    return ArmPush(
        plant=plant.name,
        joints=plant.tree.names,
        slides=plant.tree.slides,
        times=plant.timestep * np.array(ends),
        coordinates=np.array(coordinates),
        speeds=np.array(speeds),
        steps=steps,
        fall_step=int(record.steps[0]) if fell else None,
        runs_away=runs_away,
        leaves=leaves,
        frequency=None if fell else MEASURES["kinetic"].value(record, episode),
    )
