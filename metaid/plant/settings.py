"""What a plant file says of a simulated chain of links."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, model_validator

from metaid.files import Settings
from metaid.models import Array, Chain, least_inertia
from metaid.plant.faults import FaultSettings, Size

Positive = Annotated[float, Field(ge=1e-6, le=1e6)]


class LinkSettings(Settings):
    """One `[[links]]` table: `length` and `com` (from the joint; default half the length) in m, `mass` in kg,
    `inertia` about the centre of mass (default: a slender rod's) in kg m²; of its joint the `damping` in N m s, the dry
    friction `frictionloss` in N m, and the `stiffness` of a spring, at rest when the joint is straight, in N m/rad."""

    length: Positive
    mass: Positive
    com: Annotated[float, Field(ge=1e-9, le=1e6)] | None = None
    inertia: Annotated[float, Field(gt=0, le=1e9)] | None = None
    damping: Size = 0.0
    frictionloss: Size = 0.0
    stiffness: Size = 0.0

    @model_validator(mode="after")
    def _can_be_a_body(self) -> LinkSettings:
        if self.com is not None and self.com > self.length:
            raise ValueError(
                f"com {self.com} lies beyond the link's length {self.length} (allowed: 1e-9 to the length)"
            )
        least = least_inertia(self.mass, self.length)
        if self.inertia is not None and self.inertia < least:
            raise ValueError(
                f"inertia {self.inertia} is below what the mass allows: a body of {self.mass} kg on a link of "
                f"{self.length} m has at least {least:.3g} kg m²"
            )
        return self


class PlantSettings(Settings):
    """A plant file: links from the base up, `gravity` in m/s², `timestep` in s; `truth_known = false` keeps the truth
    from reports.

    `over_compensation` is a declared fault: the torque that the plant receives has gravity factors larger by this. The
    faults of a real plant are in `[faults]`.
    """

    description: str = ""
    gravity: Annotated[float, Field(ge=1e-3, le=1e3)] = 9.81
    timestep: Annotated[float, Field(ge=1e-6, le=0.1)] = 0.002
    truth_known: bool = True
    over_compensation: Annotated[float, Field(gt=-1, lt=1)] = 0.0
    faults: FaultSettings = FaultSettings()
    links: Annotated[tuple[LinkSettings, ...], Field(min_length=1, max_length=64, strict=False)]

    @model_validator(mode="after")
    def _one_number_a_joint(self) -> PlantSettings:
        if (wrong := self.faults.misfits(len(self.links), 1)) is not None:
            raise ValueError(wrong)
        return self

    files: ClassVar[tuple[str, ...]] = ()


def chain_of(links: tuple[LinkSettings, ...]) -> Chain:
    """The physical parameters of `links`, defaults filled in."""

    def column(values: list[float]) -> Array:
        array = np.array(values)
        array.setflags(write=False)
        return array

    coms = [link.length / 2 if link.com is None else link.com for link in links]
    inertias = [link.mass * link.length**2 / 12 if link.inertia is None else link.inertia for link in links]
    return Chain(
        length=column([link.length for link in links]),
        mass=column([link.mass for link in links]),
        com=column(coms),
        inertia=column(inertias),
        damping=column([link.damping for link in links]),
        coulomb=column([link.frictionloss for link in links]),
        stiffness=column([link.stiffness for link in links]),
    )
