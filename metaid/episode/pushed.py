"""What of an episode its kind, its record and its measures ask for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from metaid.episode.falls import FallRule
from metaid.models import Array


@dataclass(frozen=True)
class NoiseFloor:
    """What an episode's readings would show of a plant at rest: the `energy` ∫ q̈² dt of all pushes and joints, in
    rad²/s³; the `frequency` that it looks like, in Hz; and the root of the standard deviation of its square, `spread`,
    in Hz.
    """

    energy: float
    frequency: float
    spread: float


SILENT = NoiseFloor(0.0, 0.0, 0.0)


class Pushed(Protocol):
    """An `Episode`, as they see it."""

    @property
    def kind(self) -> Any: ...
    @property
    def pushes(self) -> Array: ...
    @property
    def fall_rule(self) -> FallRule: ...
    @property
    def keep_angles(self) -> bool: ...
    @property
    def deadband(self) -> float: ...
    @property
    def noise_floor(self) -> NoiseFloor: ...
    @property
    def lead(self) -> float: ...
    @property
    def window_ends(self) -> tuple[int, ...]: ...
    @property
    def states(self) -> Array: ...
    @property
    def starts(self) -> list[Any]: ...
    @property
    def springs(self) -> Array: ...
    @property
    def steps(self) -> int: ...
    @property
    def npush(self) -> int: ...
    @property
    def njoint(self) -> int: ...
