"""What moves an arm, compiled, for whoever asks for one state after the other in Python."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from metaid.compiled.spatial.dynamics import Frames, Space, accelerating_torques, fill_mass_matrix, frames_of, new_space
from metaid.models import Array
from metaid.models.tree import Tree


@dataclass(frozen=True, eq=False)
class QuickArm:
    """An arm whose joints are where those of a `tree` are, by its `parameters` (njoint x 13, of one layout)."""

    tree: Tree
    parameters: Array

    @cached_property
    def _room(self) -> tuple[Frames, Space]:
        return frames_of(self.tree), new_space(self.tree.njoint)

    def inverse_dynamics(self, angles: Array, speeds: Array, accelerations: Array) -> Array:
        """The torque (njoint), in N m or N, that gives the joints these accelerations (njoint), in rad/s² or m/s², at
        these coordinates and speeds (njoint each).  Eq. 52.
        """
        (frames, space), torque = self._room, np.empty(len(angles))
        accelerating_torques(frames, self.parameters, angles, speeds, accelerations, space, torque)
        return torque

    def mass_matrix(self, angles: Array) -> Array:
        """The mass matrix (njoint x njoint), in kg m² (kg m and kg where joints are slides), rotors included."""
        (frames, space), still = self._room, np.zeros(len(angles))
        self.inverse_dynamics(angles, still, still)  # places the links
        fill_mass_matrix(frames, self.parameters, space)
        lower = np.tril(space.mass_matrix)
        return np.asarray(lower + np.tril(lower, -1).T, dtype=np.float64)
