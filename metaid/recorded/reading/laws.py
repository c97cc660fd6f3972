"""The torques of a log, where the law is known that was sent and not the torques."""

from __future__ import annotations

from metaid.errors import RecordError
from metaid.models import Array
from metaid.plant import ArmPlant, MujocoPlant
from metaid.recorded.reading.log import Record


def law_torques(record: Record, plant: MujocoPlant | ArmPlant) -> Array:
    """The torques (nrow x njoint), in N m or N, of a law that compensates gravity, Coriolis forces and friction of a
    `plant` at the angles and speeds that were read.  Raises RecordError where the log has no speeds.
    """
    if record.speeds is None:
        raise RecordError(f"{record.name}: no column 'speed_1', which the law is made of (allowed: a log with speeds)")
    return plant.compensation(record.angles, record.speeds)
