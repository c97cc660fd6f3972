"""Logs whose angles are not those between two links but those of a link against the base.

A double pendulum that is filmed has such angles. One whose second motor stands on the base and pulls a belt has them,
too, and its torque turns that link against the base. With φ = S q for angles and their rates, and u = R⁻ᵀ τ for the
torques of motors that turn R q, this is what joints have of a log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from metaid.errors import RecordError, unknown
from metaid.models import Array
from metaid.recorded.reading.readings import LogRun, Repair
from metaid.recorded.weak_form.linear_model import LinearModel

MOTOR = ":motor"  # after the name of a joint: its motor stands on the base, too


@dataclass(frozen=True)
class Absolute:
    """How a log measures a robot.

    Attributes:
        angles: S (njoint x njoint), by which logged angles are made of those of joints.
        motors: R (njoint x njoint), by which angles of motors are.
        notes: what is measured against the base, in words.
        coupled: pairs of joints, from 0 on, with whose sum a motor turns that stands on the base.
    """

    angles: Array
    motors: Array
    notes: tuple[str, ...] = ()
    coupled: tuple[tuple[int, int], ...] = ()

    @property
    def is_plain(self) -> bool:
        """Whether a log has the angles and the torques of joints."""
        return not self.notes

    @property
    def is_driven_by_joints(self) -> bool:
        """Whether each logged torque is that of a joint."""
        return bool((self.motors == np.eye(len(self.motors))).all())

    def record(self, record: LogRun) -> LogRun:
        """What the joints have of a log."""
        if self.is_plain:
            return record
        repairs = tuple(Repair("absolute", len(record.times), note) for note in self.notes)
        of_joints = record.mapped(self.of_joints).with_torques(self.torques_of_joints(record.torques))
        return replace(of_joints, repairs=(*record.repairs, *repairs))

    def of_joints(self, logged: Array) -> Array:
        """Angles or their rates of joints (... x njoint), by those that were logged."""
        return logged @ np.linalg.inv(self.angles).T

    def logged(self, of_joints: Array) -> Array:
        """The other way."""
        return of_joints @ self.angles.T

    def torques_of_joints(self, logged: Array) -> Array:
        """Torques of joints (... x njoint), by those of motors that were logged."""
        return logged @ self.motors

    def logged_torques(self, of_joints: Array) -> Array:
        """The other way."""
        return of_joints @ np.linalg.inv(self.motors)


def absolute_of(model: LinearModel, named: Sequence[str] = ()) -> Absolute:
    """How a log measures a robot whose `named` joints it measures against the base, `elbow`, or `elbow:motor` where
    their motors stand on it, too.  Raises RecordError where there is no such joint.
    """
    angles, motors = np.eye(model.njoint), np.eye(model.njoint)
    notes, coupled = [], []
    there = absolute_joints(model)
    for each in named:
        name = each.removesuffix(MOTOR)
        if name not in model.places:
            raise RecordError(f"absolute: {unknown('joint', each, (*there, *(other + MOTOR for other in there)))}")
        joint = model.places[name]
        turning = model.turning[joint]
        if model.joints[joint] not in there:
            raise RecordError(
                f"absolute: before joint {name} none turns about a parallel axis (allowed: "
                f"{', '.join(there) or 'none of this robot'})"
            )
        angles[joint] = turning
        note = f"absolute: {model.joints[joint]} is read against the base"
        if each != name:
            motors[joint] = turning
            note += ", and so is its torque"
            if turning[joint - 1] > 0.0 and np.count_nonzero(turning) == 2:
                coupled.append((joint - 1, joint))
        notes.append(note)
    return Absolute(angles, motors, tuple(notes), tuple(coupled))


def absolute_joints(model: LinearModel) -> list[str]:
    """The joints that a log may measure against the base: those behind one with a parallel axis."""
    counts = np.count_nonzero(model.turning, axis=1)
    return [name for name, count in zip(model.joints, counts.tolist(), strict=True) if count > 1]
