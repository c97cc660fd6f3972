"""Within what a motion has to stay: position, speed, acceleration and torque of each joint, and the floor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from metaid.errors import PlantError
from metaid.files import Settings, check, read_toml
from metaid.models import Array
from metaid.plant import ArmPlant, MujocoPlant, by_joint, of_each

MARGIN = 0.05  # of a joint's range that stays free at each end
SWING, SLIDE = 1.5, 0.5  # rad, m: to either side of where a joint without limits is at home
SPEED, SLIDING = 2.0, 0.5  # rad/s, m/s
ACCELERATION, PUSHING = 10.0, 2.0  # rad/s², m/s²
OF_JOINTS = ("low", "high", "speed", "acceleration", "torque")
Positive = Annotated[float, Field(gt=0, le=1e9)]
NotNegative = Annotated[float, Field(ge=0, le=1e9)]
Finite = Annotated[float, Field(ge=-1e6, le=1e6)]


class LimitsSettings(Settings):
    """A file of limits. Each is one number of all joints, or a table by joint: `low` and `high` in rad or m, `speed` in
    rad/s or m/s, `acceleration` in rad/s² or m/s², `torque` in N m or N; `floor` is the height, in the frame of the
    base, in m, below which no shape may come.
    """

    low: Finite | dict[str, Finite] | None = None
    high: Finite | dict[str, Finite] | None = None
    speed: Positive | dict[str, Positive] | None = None
    acceleration: Positive | dict[str, Positive] | None = None
    torque: NotNegative | dict[str, NotNegative] | None = None
    floor: Finite | None = None


@dataclass(frozen=True)
class Limits:
    """Of each joint (njoint): coordinates from `low` to `high`, in rad or m; `speed`, `acceleration` and `torque` in
    their units, torques infinite where nobody says any. No shape comes below the `floor`, in m, where there is one.
    """

    low: Array
    high: Array
    speed: Array
    acceleration: Array
    torque: Array
    floor: float | None = None


def usual_limits(plant: ArmPlant | MujocoPlant) -> Limits:
    """What a robot's own file says, and where it says nothing what is usual. A chain hangs at rest."""
    tree, n = plant.tree, plant.njoint
    if isinstance(plant, MujocoPlant):
        home, torque = np.where(np.arange(n) == 0, np.pi, 0.0), of_each(plant.settings.faults.torque_limit, n)
    else:
        home, torque = plant.home, tree.torque_limit
    low, high = tree.ranges(SWING, SLIDE, home)
    margin = np.where(np.isfinite(tree.high - tree.low), MARGIN * (high - low), 0.0)
    return Limits(
        low + margin,
        high - margin,
        np.where(tree.slides, SLIDING, SPEED),
        np.where(tree.slides, PUSHING, ACCELERATION),
        torque,
    )


def read_limits(path: Path, plant: ArmPlant | MujocoPlant) -> Limits:
    """Those of a file; what it leaves out is as usual.  Raises PlantError."""
    usual = usual_limits(plant)
    settings = check(LimitsSettings, read_toml(path, PlantError), str(path), PlantError)
    names = plant.joint_names

    def each(key: str, own: Array) -> Array:
        given = getattr(settings, key)
        if given is None:
            return own
        if not isinstance(given, dict):
            return np.full(len(names), float(given))
        return by_joint(f"{path}: {key}", given, names, own)

    of_joints = {key: each(key, getattr(usual, key)) for key in OF_JOINTS}
    limits = Limits(**of_joints, floor=settings.floor)
    for name, torque in zip(names, limits.torque, strict=True):
        if torque == 0.0:
            raise PlantError(
                f"{path}: joint {name} has no motor, torque 0: no motion can be asked of it (allowed: robots whose "
                "joints all have one; of others any log in which they swing)"
            )
    for name, low, high in zip(names, limits.low, limits.high, strict=True):
        if not low < high:
            raise PlantError(f"{path}: joint {name} may move from {low:g} to {high:g} (allowed: low below high)")
    return limits
