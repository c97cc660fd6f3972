"""A planar chain of hinges, simulated by MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from metaid.models import (
    FRICTION,
    IDEAL,
    Array,
    Lumps,
    compensation_basis,
    question_of_units,
    refuse_impossible,
    refuse_too_long_a_step,
    speeds_after,
)
from metaid.plant.settings import PlantSettings, chain_of
from metaid.plant.start import Start

if TYPE_CHECKING:
    from mujoco import MjData, MjModel

    from metaid.plant.mujoco_model import Simulation


@dataclass(eq=False)
class MujocoPlant:
    """A planar chain in MuJoCo; its `simulation` is its own, so a worker needs a plant of its own.

    MuJoCo is loaded and the chain built when it first moves.
    """

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
    def simulation(self) -> Simulation:
        """The plant's own model and state.  Raises PlantError where MuJoCo cannot build it."""
        from metaid.plant.mujoco_model import simulate

        return simulate(self.name, self.chain, self.felt_gravity, self.timestep, self.tilt)

    @property
    def model(self) -> MjModel:
        """MuJoCo's model of the plant."""
        return self.simulation.model

    @property
    def data(self) -> MjData:
        """MuJoCo's state of the plant."""
        return self.simulation.data

    @property
    def njoint(self) -> int:
        return self.chain.nlink

    @property
    def timestep(self) -> float:
        return self.settings.timestep

    @property
    def gravity(self) -> float:
        return self.settings.gravity

    @property
    def tilt(self) -> float:
        """Of the base, in rad."""
        return float(self.settings.faults.tilts(1)[0])

    @property
    def felt_gravity(self) -> float:
        """In m/s². Too large a torque by a share of the gravity terms is the same as gravity weaker by that share."""
        return self.gravity * (1.0 - self.settings.over_compensation)

    def compensation(self, angles: Array, speeds: Array) -> Array:
        """The joint torques (... x njoint), in N m, that compensate gravity, Coriolis forces and friction at joint
        `angles`, in rad, and `speeds`, in rad/s (... x njoint each).
        """
        kinds = self.chain.kinds
        leaning, turning = np.cumsum(angles, axis=-1), np.cumsum(speeds, axis=-1)
        forces = compensation_basis(leaning, turning, self.gravity, kinds) @ self.chain.lumps_of(kinds).vector
        return np.asarray(np.cumsum(forces[..., ::-1], axis=-1)[..., ::-1], dtype=np.float64)  # Eq. 6

    def true_angles(self, start: Start) -> Array:
        """Joint angles (njoint), in rad, where encoders read those of `start`."""
        return start.angles - self.settings.faults.encoder_offsets(self.njoint)

    def start_speeds(self, start: Start) -> Array:
        """Joint speeds (njoint), in rad/s, just after the impulses of `start`."""
        return np.diff(speeds_after(self.chain, start.impulses, np.cumsum(self.true_angles(start))), prepend=0.0)

    def push(self, start: Start) -> None:
        self.simulation.reset()
        self.data.qpos[:], self.data.qvel[:] = self.true_angles(start), self.start_speeds(start)

    def states(self) -> tuple[Array, Array]:
        return self.data.qpos.copy(), self.data.qvel.copy()

    def apply_torque(self, torque: Array) -> None:
        self.data.qfrc_applied[:] = torque

    def step(self) -> None:
        self.simulation.step()

    def stop(self) -> None:
        self.data.qfrc_applied[:] = 0.0

    def close(self) -> None:
        """A simulated plant holds nothing that must be released."""

    def true_lumps(self) -> Lumps | None:
        if not self.settings.truth_known:
            return None
        return replace(self.chain.lumps_of((*IDEAL, *FRICTION)), searched=self.chain.kinds)

    tilts = 1  # axes about which its base may be tilted

    @property
    def hidden_forces(self) -> dict[str, Array]:
        """Of the kinds of faults that are forces of its joints what they are (njoint). Only reports use them."""
        return {"viscous": self.chain.damping, "dry": self.chain.coulomb, "spring": self.chain.stiffness}
