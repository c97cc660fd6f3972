"""What a study file says, checked entry by entry: the same tables for chains and arms. What each key means, and its
unit, is said in docs/keys.toml, for each of these classes.

A class of keys that only one kind of robot has is an `OfChain` or an `OfArm`; `refuse_unsuited` is the one rule that
keeps them from the other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from metaid.episode import FALL_MARGIN
from metaid.errors import StudyError
from metaid.files import Settings
from metaid.models import FRICTION, IDEAL
from metaid.models.tree import PriorDeviations
from metaid.plant import FAULT_UNITS, Limit, LinkSettings
from metaid.search import SAMPLERS, SamplerOptions

MANY = 2000  # trials by default of a sampler that minimises one number of each; it may end sooner
FEW = 12  # of another; ten links take fewer
# What an arm has where its file says nothing. Its first step is small: a law that is far off in many base parameters
# lets a push fall.
OF_ARM: dict[str, Any] = {"trials": 4, "workers": 1}
ARM_STEP = 0.05
BY_FACTORS = ("dinoip", "random")  # samplers that need nominal values that are not 0, and bounds that are near
LARGEST_STEPS = 10_000_000  # after a push
TAKEN_UP = ("delay", "tilt")  # of the faults that a study may take up by itself those that a plant file may have

Factor = Annotated[float, Field(gt=0, le=100)]
Impulse = Annotated[float, Field(ge=-1e6, le=1e6)]
Factors = Factor | dict[str, Factor]
Share = Annotated[float, Field(gt=0, le=10)]
if TYPE_CHECKING:
    FaultKind = str
else:
    FaultKind = Literal[tuple(FAULT_UNITS)]


class OfChain(Settings):
    """Keys that only the study of a planar chain has."""


class OfArm(Settings):
    """Keys that only the study of an arm has."""


class NominalSettings(OfChain):
    """A nominal model beside the study: `[[nominal.links]]`, as in a plant file."""

    links: Annotated[tuple[LinkSettings, ...], Field(min_length=1, max_length=64, strict=False)]


class DrawnNominalSettings(OfArm):
    """`[nominal]`: a nominal arm that is drawn at random about another."""

    plant: str
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


class LumpSearchSettings(OfChain):
    """`[search]` of a chain; `contradictions.upper_bounds` has the default of `high`."""

    lumps: Annotated[tuple[Literal["gravity", "coriolis", "damping", "coulomb"], ...], Field(strict=False)] = (
        "gravity",
        "coriolis",
    )
    coordinates: Literal["nominal-metric", "plain"] = "nominal-metric"
    start: Factors = 1.0
    low: Factors = 0.5
    high: Factors | None = None
    widen: bool | None = None

    @field_validator("lumps")
    @classmethod
    def _in_order(cls, lumps: tuple[str, ...]) -> tuple[str, ...]:
        if not set(IDEAL) <= set(lumps) or len(set(lumps)) < len(lumps):
            raise ValueError(f"needs {' and '.join(IDEAL)}, each kind once (allowed besides: {', '.join(FRICTION)})")
        return tuple(kind for kind in (*IDEAL, *FRICTION) if kind in lumps)


class SearchSettings(LumpSearchSettings, SamplerOptions):
    """`[search]`, with the options of all samplers."""

    target: Annotated[float, Field(ge=0)] | None = None


class StruckSettings(OfChain):
    """`[episode]` of a chain; an impulse of a list of `pushes` is that at the tip of a link."""

    measure: str = "spectral"
    rule: str | None = None
    pushes: Literal["rich", "designed", "tip"] | Annotated[list[list[Impulse]], Field(max_length=1000)] | None = None
    count: Annotated[int, Field(ge=1, le=1000)] | None = None
    peak_speed: Annotated[float, Field(gt=0, le=1000)] | None = None
    steps: Annotated[int, Field(ge=2, le=LARGEST_STEPS)] | None = None
    fall_limit: Annotated[float, Field(gt=0, le=1000)] | None = None
    fall_margin: Annotated[float, Field(ge=0, le=1000)] = FALL_MARGIN
    fall_runaway: Annotated[float, Field(gt=1, le=1e6)] | None = None
    repeats: Annotated[int, Field(ge=1, le=1000)] = 1


class LedSettings(OfArm):
    """`[episode]` of an arm."""

    coasts: Annotated[int, Field(ge=1, le=1000)] | None = None
    springs: Annotated[int, Field(ge=0, le=1000)] | None = None
    stiffness: Annotated[float, Field(gt=0, le=1e6)] | None = None
    horizon: Annotated[float, Field(gt=0, le=60)] = 0.3
    speed: Annotated[float, Field(gt=0, le=100)] = 3.0
    runaway: Annotated[float, Field(gt=1, le=1e6)] = 5.0


class EpisodeSettings(LedSettings, StruckSettings):
    """`[episode]`; a law with a `lead` gets the angles that the speeds lead to by then."""

    lead: Annotated[float, Field(ge=0, le=1)] = 0.0


class LumpEstimateSettings(OfChain):
    """`[estimate]` of a chain. What is compared is the "speed" that each push changes, the "frequency" of each joint,
    "both", or the "count" of its half periods, of which the result is the set of models that count the same.
    """

    lumps: (
        Annotated[tuple[Literal["gravity", "coriolis", "damping", "coulomb", "inertia"], ...], Field(strict=False)]
        | None
    ) = None
    lengths: Literal["free", "exact"] = "free"
    compare: Literal["speed", "frequency", "both", "count"] | None = None
    spread: Annotated[float, Field(ge=1e-6, le=10)] = 0.3

    @field_validator("lumps")
    @classmethod
    def _needed(cls, lumps: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if lumps is not None and (not {"gravity", "inertia"} <= set(lumps) or len(set(lumps)) < len(lumps)):
            raise ValueError("needs gravity and inertia, each kind once (allowed besides: coriolis, damping, coulomb)")
        return lumps


class PriorSettings(OfArm):
    """`[estimate]` of an arm: how wrong the nominal one may be, as standard deviations (docs/method.md, Eq. 54)."""

    mass: Share = 0.3
    com: Share = 0.15
    inertia: Share = 0.3
    rotor: Share = 0.5
    damping: Share = 0.5
    coulomb: Share = 0.3

    @property
    def prior(self) -> PriorDeviations:
        """The same as the model has it."""
        return PriorDeviations(**{name: getattr(self, name) for name in PriorSettings.model_fields})


class EstimateSettings(PriorSettings, LumpEstimateSettings):
    """`[estimate]`. `faults` are what else of the plant is unknown (`metaid.plant.unknown_faults`), or "proposed",
    where such faults are taken up once nothing explains the trials without them. The plant file is not asked for these,
    nor for the torque limit.
    """

    enabled: bool = True
    faults: Annotated[tuple[FaultKind, ...], Field(strict=False)] | Literal["proposed"] = ()
    teeth: Annotated[int, Field(ge=0, le=1000)] = 0
    torque_limit: Limit | Annotated[tuple[Limit, ...], Field(min_length=1, strict=False)] | None = None

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

    @field_validator("faults")
    @classmethod
    def _each_once(cls, faults: tuple[str, ...] | str) -> tuple[str, ...] | str:
        if isinstance(faults, str):
            return faults
        if len(set(faults)) < len(faults):
            raise ValueError("names a fault twice (allowed: each once)")
        return tuple(kind for kind in FAULT_UNITS if kind in faults)


class StudySettings(Settings):
    """A study file."""

    description: str = ""
    plant: str
    nominal: str | NominalSettings | DrawnNominalSettings
    sampler: str = "output-error"
    trials: Annotated[int, Field(ge=1, le=100_000_000)] = FEW
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    workers: Annotated[int, Field(ge=1, le=1024)] = 2
    search: SearchSettings = SearchSettings()
    episode: EpisodeSettings = EpisodeSettings()
    estimate: EstimateSettings = EstimateSettings()

    @model_validator(mode="before")
    @classmethod
    def _with_trials(cls, tables: Any) -> Any:
        """One whose sampler minimises needs more trials than one that matches what each shows."""
        if isinstance(tables, dict) and tables.get("sampler", "output-error") != "output-error":
            return {"trials": MANY, **tables}
        return tables


def with_defaults(study: StudySettings, is_arm: bool, is_rig: bool) -> StudySettings:
    """What a study file says, with the defaults of such a robot for what it does not say."""
    unsaid = {**(OF_ARM if is_arm else {}), **({"workers": 1} if is_rig else {})}
    changes: dict[str, Any] = {key: value for key, value in unsaid.items() if key not in study.model_fields_set}
    if is_arm and "sigma" not in study.search.model_fields_set:
        changes["search"] = study.search.model_copy(update={"sigma": ARM_STEP})
    if is_rig and study.estimate.enabled and "faults" not in study.estimate.model_fields_set:
        # A real machine has faults, so they are taken up unless the file says which to search.
        changes["estimate"] = study.estimate.model_copy(update={"faults": "proposed"})
    return study.model_copy(update=changes)


def refuse_unsuited(study: StudySettings, is_arm: bool, source: str) -> None:
    """Raises StudyError where the study of an arm says what only that of a chain can, or the other way round."""
    robot, others = ("an arm", OfChain) if is_arm else ("a planar chain", OfArm)
    if isinstance(study.nominal, others):
        allowed = "the plant file of an arm, or a table with plant and seed" if is_arm else "a plant file, or links"
        what = "has the links of a planar chain" if is_arm else "is an arm that is drawn"
        raise StudyError(f"{source}: plant {study.plant} is {robot}, and the nominal model {what} (allowed: {allowed})")
    tables: tuple[Settings, ...] = study.search, study.episode, study.estimate
    for table in tables:
        keys = type(table).model_fields
        foreign = {key for base in type(table).__bases__ if issubclass(base, others) for key in base.model_fields}
        for key in sorted(table.model_fields_set & foreign):
            allowed = ", ".join(each for each in keys if each not in foreign)
            raise StudyError(f"{source}: '{key}' is not for {robot}, as the plant is (allowed there: {allowed})")
    if is_arm and study.sampler in BY_FACTORS:
        able = [name for name in SAMPLERS if name not in BY_FACTORS]
        raise StudyError(f"{source}: sampler '{study.sampler}' is not for an arm (allowed: {', '.join(able)})")
