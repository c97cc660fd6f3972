"""What chains and arms have in common that MuJoCo simulates."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING, Any

from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant.faults import of_each

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


class SimulatedPlant(ABC):
    """A robot in MuJoCo, its joints and links alone. The simulation is its own, so a worker needs a plant of its own.

    MuJoCo is loaded and the robot built when anything of it moves.
    """

    name: str
    settings: Any

    @cached_property
    @abstractmethod
    def model(self) -> MjModel:
        """The lean model that moves.  Raises PlantError where MuJoCo cannot build it."""

    @cached_property
    def data(self) -> MjData:
        """The state of `model`."""
        from mujoco import MjData

        return MjData(self.model)

    @property
    @abstractmethod
    def tree(self) -> Tree:
        """Its joints and links, without springs. Neither search nor estimate may see its parameters."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Of the joints (njoint), as messages and files have them."""
        return self.tree.names

    @property
    def timestep(self) -> float:
        return float(self.settings.timestep)

    @property
    def couples(self) -> tuple[tuple[int, int], ...]:
        """Pairs of joints, from 0 on, with whose sum a motor turns: logs can tell of it, and no push."""
        return ()

    @property
    def repairs(self) -> tuple[str, ...]:
        """What its file says of its moving links and cannot be, as sentences."""
        return ()

    def true_angles(self, start: Any) -> Array:
        """Joint coordinates (njoint), in rad or m, where encoders read those of `start`."""
        angles: Array = start.pose - of_each(self.settings.faults.encoder_offset, len(start.pose))
        return angles

    @abstractmethod
    def start_speeds(self, start: Any) -> Array:
        """Joint speeds (njoint), in rad/s or m/s, with which the push of `start` begins."""

    def push(self, start: Any) -> None:
        """Brings the robot to where encoders read the coordinates of `start`, with its speeds; nothing is left of the
        motion before.
        """
        from mujoco import mj_resetData

        mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = self.true_angles(start), self.start_speeds(start)

    def states(self) -> tuple[Array, Array]:
        """Joint coordinates (njoint), in rad or m, and joint speeds (njoint), in rad/s or m/s."""
        return self.data.qpos.copy(), self.data.qvel.copy()

    def apply_torque(self, torque: Array) -> None:
        """Sets the joint torque (njoint), in N m or N, that holds during the next step."""
        self.data.qfrc_applied[:] = torque

    def step(self) -> None:
        """Lets one timestep pass."""
        from mujoco import mj_step

        mj_step(self.model, self.data)

    def stop(self) -> None:
        """Takes the torque off at once."""
        self.data.qfrc_applied[:] = 0.0

    def close(self) -> None:  # noqa: B027, nothing is to be done by anybody
        """A simulated plant holds nothing that must be released."""
