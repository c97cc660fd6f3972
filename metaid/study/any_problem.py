"""What follows from the settings of any study before any trial, of a chain or of an arm."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from metaid.errors import StudyError
from metaid.plant import SocketPlant
from metaid.search import SAMPLERS


class StudyProblem(ABC):
    """All that a study's settings, its `spec`, determine before any trial."""

    spec: Any

    @property
    def is_simulated(self) -> bool:
        """Whether the plant is simulated here, and not a rig, which is not to be moved without need."""
        return bool(self.spec.is_simulated)

    @property
    def is_ready(self) -> bool:
        """Whether all is known that a trial needs: what a rig's pushes do is found when its study is created."""
        return self.is_simulated or self.spec.pushed is not None

    @property
    def is_matching(self) -> bool:
        """Whether the sampler works by the estimate. Where that explains nothing, no best trial is the result."""
        return SAMPLERS[self.spec.study.sampler].by_estimate

    @property
    def timestep(self) -> float:
        """Time between two control steps, in s."""
        return float(self.spec.timestep)

    @property
    def question(self) -> str | None:
        """What to ask about the units of the plant or the nominal model; None if nothing."""
        question: str | None = self.open_plant().question if self.is_simulated else None
        return question

    @abstractmethod
    def open_plant(self) -> Any:
        """A plant of its own for each worker, simulated or not."""

    def open_rig(self) -> SocketPlant:
        """The plant behind the socket that the study names."""
        assert not self.is_simulated
        return SocketPlant(self.spec.plant_name, self.spec.plant)

    def make_plant(self) -> Any:
        """A simulated plant.  Raises StudyError where the study's is none."""
        if not self.is_simulated:
            raise StudyError(f"plant {self.spec.plant_name} is a rig, and this needs a simulated plant")
        return self.open_plant()
