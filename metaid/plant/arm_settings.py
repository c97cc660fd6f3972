"""What a plant file says of an arm: where its MJCF or URDF is, which joints move, and what such a file cannot say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, model_validator

from metaid.errors import PlantError, unknown
from metaid.files import Settings
from metaid.models import Array
from metaid.plant.faults import FaultSettings, Limit, Size

Value = Annotated[float, Field(ge=-1e6, le=1e6)]


def by_joint(what: str, given: Mapping[str, float], names: Sequence[str], usual: Array) -> Array:
    """One number a joint (njoint): that which is `given` by its name, or else the `usual` one.

    Args:
        what: is given, for a message.
        given: by name.
        names: of the joints (njoint).
        usual: of each joint (njoint).

    Raises:
        PlantError: there is no joint of that name.
    """
    for name in given:
        if name not in names:
            raise PlantError(f"{what}: {unknown('joint', name, names)}")
    return np.array([given.get(name, value) for name, value in zip(names, usual, strict=True)])


class ArmSettings(Settings):
    """A plant file of an arm: `mjcf` or `urdf`, the file that describes it, relative to the plant file.

    `joints`: those that move; the others are held, and what they carry is one body. Without it all move. `home`: joint
    coordinates in rad or m, of held joints where they are held (default: those of the file's keyframe `home`, or else
    of its reference pose, or the nearest in the joint's range). `gravity`: three numbers in m/s², in the frame of the
    base, instead of the file's; `timestep` in s. By the name of the joint, instead of what the file says: inertia of
    the rotor as the joint feels it, `rotor`, in kg m² (of a slide in kg), viscous friction `damping` in N m s (N s/m),
    dry friction `frictionloss` and `torque_limit` in N m (N), and of a spring the `stiffness` in N m/rad (N/m) and the
    joint coordinate at which it is `slack`. `truth_known = false` keeps the truth from reports. The faults of a real
    arm are in `[faults]`.
    """

    description: str = ""
    mjcf: Annotated[str, Field(min_length=1)] | None = None
    urdf: Annotated[str, Field(min_length=1)] | None = None
    joints: Annotated[tuple[str, ...], Field(min_length=1, max_length=64, strict=False)] | None = None
    home: dict[str, Value] = Field(default_factory=dict)
    gravity: Annotated[tuple[Value, Value, Value], Field(strict=False)] | None = None
    timestep: Annotated[float, Field(ge=1e-6, le=0.1)] = 0.002
    truth_known: bool = True
    rotor: dict[str, Size] = Field(default_factory=dict)
    damping: dict[str, Size] = Field(default_factory=dict)
    frictionloss: dict[str, Size] = Field(default_factory=dict)
    torque_limit: dict[str, Limit] = Field(default_factory=dict)
    stiffness: dict[str, Value] = Field(default_factory=dict)
    slack: dict[str, Value] = Field(default_factory=dict)
    faults: FaultSettings = FaultSettings()

    @model_validator(mode="after")
    def _one_file(self) -> ArmSettings:
        if (self.mjcf is None) == (self.urdf is None):
            raise ValueError("an arm is described by one file (allowed: mjcf or urdf)")
        return self

    @model_validator(mode="after")
    def _each_joint_once(self) -> ArmSettings:
        for name in self.joints or ():
            if self.joints and self.joints.count(name) > 1:
                raise ValueError(f"joints: '{name}' is named twice (allowed: each joint once)")
        return self

    why_no_chain: ClassVar[str] = "an arm, and not a planar chain (allowed here: a plant file with [[links]])"

    @property
    def kind(self) -> str:
        """Of the file: the key that names it."""
        return "mjcf" if self.urdf is None else "urdf"

    @property
    def file(self) -> str:
        """The path of the MJCF or URDF."""
        return str(getattr(self, self.kind))

    @property
    def files(self) -> tuple[str, ...]:
        """Other files that it names."""
        return (self.file,)
