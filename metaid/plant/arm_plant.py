"""A serial arm, simulated by MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from metaid.errors import PlantError
from metaid.models import Array, question_of_distances
from metaid.models.tree import Tree, joint_torque, tilted_gravity
from metaid.plant.arm_settings import ArmSettings
from metaid.plant.faults import of_each
from metaid.plant.simulated import SimulatedPlant
from metaid.plant.start import ArmStart

if TYPE_CHECKING:
    from mujoco import MjData, MjModel

    from metaid.plant.description.reading import Arm


@dataclass(eq=False)
class ArmPlant(SimulatedPlant):
    """A serial arm. The user's file is compiled when anything of it is asked for.  Raises PlantError then, where that
    file is no serial arm. A `known` arm needs no file.
    """

    name: str
    settings: ArmSettings
    known: Tree | None = None

    def __repr__(self) -> str:
        return f"<ArmPlant {self.name}: {Path(self.settings.file).name}>"

    @cached_property
    def arm(self) -> Arm:
        """The arm as its file says it is."""
        from metaid.plant.description.reading import read_arm

        return read_arm(self.settings, f"plant {self.name}")

    @property
    def tree(self) -> Tree:
        return self.arm.tree if self.known is None else self.known

    @property
    def repairs(self) -> tuple[str, ...]:
        return (*self.arm.repairs, *self.said_of_couples) if self.known is None else ()

    @property
    def question(self) -> str | None:
        """What to ask about its units, in one line; None if nothing."""
        return question_of_distances(f"plant {self.name}", self.tree.names, np.linalg.norm(self.tree.position, axis=1))

    @property
    def home(self) -> Array:
        """Joint coordinates at home (njoint), in rad or m."""
        return self.arm.home

    @cached_property
    def model(self) -> MjModel:
        from metaid.plant.lean import arm_model

        tree, faults = self.tree, self.settings.faults
        if (wrong := faults.misfits(tree.njoint, 2)) is not None:
            raise PlantError(f"plant {self.name}: {wrong}")
        tilted = replace(tree, gravity=tilted_gravity(tree.gravity, of_each(faults.tilt, 2)))
        return arm_model(tilted, self.timestep, self.stiffness, self.slack)

    @cached_property
    def data(self) -> MjData:
        """Raises PlantError where a motor turns with two joints, which the model has not."""
        self.refuse_couples()
        return super().data

    @property
    def couples(self) -> tuple[tuple[int, int], ...]:
        return self.arm.couples if self.known is None else ()

    def refuse_couples(self) -> None:
        """Raises PlantError where a motor turns with two joints."""
        for said in self.said_of_couples:
            raise PlantError(f"plant {self.name}: {said} (allowed in logs alone: metaid estimate)")

    @property
    def said_of_couples(self) -> list[str]:
        """A sentence for each of the `couples`."""
        names = self.tree.names
        return [
            f"a motor turns with joints '{names[one]}' and '{names[other]}' together" for one, other in self.couples
        ]

    @property
    def stiffness(self) -> Array:
        """Of springs in the joints (njoint), in N m/rad or N/m."""
        return self.arm.stiffness if self.known is None else self._of_joints(self.settings.stiffness)

    @property
    def slack(self) -> Array:
        """The joint coordinates at which these are (njoint), in rad or m."""
        return self.arm.slack if self.known is None else self._of_joints(self.settings.slack)

    def _of_joints(self, given: Mapping[str, float]) -> Array:
        return np.array([given.get(name, 0.0) for name in self.tree.names])

    @property
    def njoint(self) -> int:
        return self.tree.njoint

    def compensation(self, angles: Array, speeds: Array) -> Array:
        """The joint torques (... x njoint), in N m or N, that compensate gravity, Coriolis forces and friction at joint
        coordinates `angles`, in rad or m, and `speeds`, in rad/s or m/s (... x njoint each).
        """
        return joint_torque(self.tree, angles, speeds, np.zeros_like(angles))

    def start_speeds(self, start: ArmStart) -> Array:
        return start.speeds

    def true_parameters(self) -> Array | None:
        """The parameters of its joints and links (njoint x 13), in the order of PARAMETERS, where it knows them. Only
        reports use them.
        """
        return self.tree.parameters if self.settings.truth_known else None

    tilts = 2  # axes about which its base may be tilted

    @property
    def hidden_forces(self) -> dict[str, Array]:
        """Of the kinds of faults that are forces of its joints what they are (njoint). Only reports use them."""
        return {"spring": self.stiffness, "bias": self.stiffness * self.slack}
