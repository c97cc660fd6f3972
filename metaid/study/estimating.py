"""What `[estimate]` of a study file says of any robot."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator

from metaid.files import Settings
from metaid.plant import FAULT_UNITS, Limit

TAKEN_UP = ("delay", "tilt")  # of the faults that a study may take up by itself those that a plant file may have

FaultKind = Literal[
    "delay", "lag", "tilt", "offset", "viscous", "dry", "presliding", "spring", "bias", "cogging", "rotor", "gain"
]


MANY = 2000  # trials by default of a sampler that minimises one number of each; it may end sooner


def with_trials(tables: Any) -> Any:
    """The tables of a study file: one whose sampler minimises needs more trials than one that matches what each shows,
    unless it says how many.
    """
    if isinstance(tables, dict) and tables.get("sampler", "output-error") != "output-error":
        return {"trials": MANY, **tables}
    return tables


class AnyEstimateSettings(Settings):
    """What `[estimate]` has for chains and arms alike. `enabled`: whether an estimate is made of the trials at all.
    `faults`: what else of the plant is unknown (`metaid.plant.unknown_faults`), or "proposed", where such faults are
    taken up once nothing explains the trials without them; the plant file is not asked for these. `teeth`: how many
    times a turn cogging repeats; 0 where that is not known, and is found where faults are taken up.
    `torque_limit`: what the motors give at most, in N m, one number or one a joint, as far as you know; the plant file
    is not asked.
    """

    enabled: bool = True
    faults: Annotated[tuple[FaultKind, ...], Field(strict=False)] | Literal["proposed"] = ()
    teeth: Annotated[int, Field(ge=0, le=1000)] = 0
    torque_limit: Limit | Annotated[tuple[Limit, ...], Field(min_length=1, strict=False)] | None = None

    @property
    def of_rig(self) -> Self:
        """The same of a rig: a real machine has faults, so they are taken up unless the file says which to search."""
        if "faults" in self.model_fields_set or not self.enabled:
            return self
        return self.model_copy(update={"faults": "proposed"})

    @property
    def searched_faults(self) -> tuple[str, ...]:
        """The kinds that are searched from the first trial on."""
        return () if self.takes_up_faults else tuple(self.faults)

    @property
    def takes_up_faults(self) -> bool:
        """Whether faults are taken up where nothing explains the trials without them."""
        return self.faults == "proposed"

    @property
    def undeclared_faults(self) -> tuple[str, ...]:
        """The kinds of which the plant file is not asked."""
        return TAKEN_UP if self.takes_up_faults else self.searched_faults

    def misfits(self, njoint: int, has_readings: bool) -> str | None:
        """What does not suit a robot of `njoint` joints, whose trials keep readings or not; None where all does."""
        if self.faults and not self.enabled:
            return "estimate: faults: only an estimate finds them (allowed: enabled = true)"
        if ("cogging" in self.searched_faults) and not self.teeth:
            return "estimate: faults: 'cogging' needs to know how often it repeats (allowed: with teeth, times a turn)"
        if "gain" in self.searched_faults and njoint == 1:
            return (
                "estimate: faults: 'gain' of one motor cannot be told from the lumps, which it multiplies "
                "(allowed: with two joints or more, where gains are those relative to the first motor)"
            )
        limit = self.torque_limit
        if limit is not None and not (self.enabled and has_readings):
            return (
                "estimate: torque_limit: only an estimate from readings knows of it (allowed: on a rig or a plant with "
                "[faults], with enabled = true)"
            )
        if isinstance(limit, tuple) and len(limit) != njoint:
            return f"estimate: torque_limit has {len(limit)} numbers (allowed: one, or {njoint})"
        return None

    @field_validator("faults")
    @classmethod
    def _each_once(cls, faults: tuple[str, ...] | str) -> tuple[str, ...] | str:
        if isinstance(faults, str):
            return faults
        if len(set(faults)) < len(faults):
            raise ValueError("names a fault twice (allowed: each once)")
        if "presliding" in faults and "dry" not in faults:
            raise ValueError("presliding is of dry friction (allowed: with 'dry')")
        return tuple(kind for kind in FAULT_UNITS if kind in faults)
