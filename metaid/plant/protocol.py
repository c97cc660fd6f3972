"""What an episode needs of a plant. Anything that answers to `Plant` can be pushed, a rig too (docs/your-rig.md)."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from metaid.models import Array
from metaid.plant.start import Start


@runtime_checkable
class Plant(Protocol):
    """What an episode needs of a plant: states, torques, steps. Angles are joint angles from the upright."""

    @property
    def name(self) -> str: ...
    @property
    def njoint(self) -> int: ...
    @property
    def timestep(self) -> float:
        """Time between two control steps, in s."""

    @property
    def gravity(self) -> float:
        """Gravitational acceleration, in m/s²."""

    def push(self, start: Start) -> None:
        """Brings the plant to rest at the pose of `start`, then strikes the link tips with its impulses."""

    def states(self) -> tuple[Array, Array]:
        """Joint angles (njoint), in rad, and joint speeds (njoint), in rad/s."""

    def apply_torque(self, torque: Array) -> None:
        """Sets the joint torque (njoint), in N m, that holds during the next step."""

    def step(self) -> None:
        """Lets one timestep pass."""

    def stop(self) -> None:
        """Takes the torque off at once: a push is over, a link has fallen, or something went wrong. Must not raise."""

    def close(self) -> None:
        """Lets go of the plant. No other call follows."""
