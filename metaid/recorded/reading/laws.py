"""The torques of a log, where the law is known that was sent and not the torques."""

from __future__ import annotations

import numpy as np

from metaid.errors import RecordError
from metaid.models import Array, compensation_basis
from metaid.models.tree import joint_torque
from metaid.plant import ArmPlant, MujocoPlant
from metaid.recorded.reading.log import Record


def law_torques(record: Record, plant: MujocoPlant | ArmPlant) -> Array:
    """The torques (nrow x njoint), in N m or N, of a law that compensates gravity, Coriolis forces and friction of a
    `plant` at the angles and speeds that were read.  Raises RecordError where the log has no speeds.
    """
    if record.speeds is None:
        raise RecordError(f"{record.name}: no column 'speed_1', which the law is made of (allowed: a log with speeds)")
    if isinstance(plant, ArmPlant):
        return joint_torque(plant.tree, record.angles, record.speeds, np.zeros_like(record.angles))
    kinds = plant.chain.kinds
    angles, speeds = np.cumsum(record.angles, axis=1), np.cumsum(record.speeds, axis=1)
    forces = compensation_basis(angles, speeds, plant.gravity, kinds) @ plant.chain.lumps_of(kinds).vector
    return np.asarray(np.cumsum(forces[:, ::-1], axis=1)[:, ::-1], dtype=np.float64)  # Eq. 6
