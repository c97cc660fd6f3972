"""A planar chain of hinges, simulated by MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from metaid.errors import PlantError
from metaid.models import (
    FRICTION,
    IDEAL,
    Array,
    ChainModel,
    Lumps,
    question_of_units,
    refuse_impossible,
    refuse_too_long_a_step,
    speeds_after,
)
from metaid.models.tree import Tree, planar_tree
from metaid.plant.faults import of_each
from metaid.plant.settings import PlantSettings, chain_of
from metaid.plant.simulated import SimulatedPlant
from metaid.plant.start import Start

if TYPE_CHECKING:
    from mujoco import MjModel


@dataclass(eq=False)
class MujocoPlant(SimulatedPlant):
    """A planar chain of hinges."""

    name: str
    settings: PlantSettings

    def __post_init__(self) -> None:
        self.chain = chain_of(self.settings.links)
        refuse_impossible(f"plant {self.name}", self.chain)
        refuse_too_long_a_step(f"plant {self.name}", self.chain, self.gravity, self.timestep)

    def __repr__(self) -> str:
        return f"<MujocoPlant {self.name}: njoint={self.njoint}>"

    @property
    def question(self) -> str | None:
        """What to ask about its units, in one line; None if nothing."""
        return question_of_units(f"plant {self.name}", self.chain, self.gravity)

    @cached_property
    def model(self) -> MjModel:
        from metaid.plant.lean import build_spec, mujoco

        try:
            return build_spec(self.chain, self.felt_gravity, self.timestep, self.tilt).compile()
        except (ValueError, mujoco.FatalError) as problem:
            raise PlantError(f"plant {self.name}: MuJoCo cannot build it: {' '.join(str(problem).split())}") from None

    @property
    def tree(self) -> Tree:
        return planar_tree(self.chain, self.gravity)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Numbers, from 1 on."""
        return tuple(f"{joint + 1}" for joint in range(self.njoint))

    @property
    def njoint(self) -> int:
        return self.chain.nlink

    @property
    def gravity(self) -> float:
        return self.settings.gravity

    @property
    def tilt(self) -> float:
        """Of the base, in rad."""
        return float(of_each(self.settings.faults.tilt, 1)[0])

    @property
    def felt_gravity(self) -> float:
        """In m/s². Too large a torque by a share of the gravity terms is the same as gravity weaker by that share."""
        return self.gravity * (1.0 - self.settings.over_compensation)

    def compensation(self, angles: Array, speeds: Array) -> Array:
        """The joint torques (... x njoint), in N m, that compensate gravity, Coriolis forces and friction at joint
        `angles`, in rad, and `speeds`, in rad/s (... x njoint each).
        """
        return ChainModel(self.chain.lumps_of(self.chain.kinds), self.gravity).torque(angles, speeds)

    def start_speeds(self, start: Start) -> Array:
        """Those just after the impulses."""
        return np.diff(speeds_after(self.chain, start.impulses, np.cumsum(self.true_angles(start))), prepend=0.0)

    def true_lumps(self) -> Lumps | None:
        """Its own lumps, where it knows them. Only reports use them."""
        if not self.settings.truth_known:
            return None
        return replace(self.chain.lumps_of((*IDEAL, *FRICTION)), searched=self.chain.kinds)

    tilts = 1  # axes about which its base may be tilted

    @property
    def hidden_forces(self) -> dict[str, Array]:
        """Of the kinds of faults that are forces of its joints what they are (njoint). Only reports use them."""
        return {"viscous": self.chain.damping, "dry": self.chain.coulomb, "spring": self.chain.stiffness}
