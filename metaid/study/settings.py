"""What a study file says, checked entry by entry, and made whole.

`StudySpec` is all that a run depends on (the study's settings with plant and nominal model written out); it goes into
the study DB, so a study can be resumed and shown without its files.
"""

from __future__ import annotations

from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from pydantic import Field, field_validator, model_validator

from metaid.episode import FALL_MARGIN
from metaid.errors import PlantError, StudyError
from metaid.files import Settings, check, find_file, find_file_beside, read_toml
from metaid.models import FRICTION, IDEAL, lump_names
from metaid.plant import (
    ARM_FILES,
    PLANT_KEYS,
    ArmSettings,
    LinkSettings,
    PlantSettings,
    SocketSettings,
    read_any_plant,
    read_plant,
    refuse_parts_outside,
)
from metaid.search import SamplerOptions
from metaid.study.estimating import AnyEstimateSettings, with_trials
from metaid.study.spatial import ArmSpec, arm_spec

FEW = 12  # trials by default; ten links take fewer
NAMES_PLANT = "allowed: a file with plant = NAME or PATH, nominal = … and what else a study has"
LARGEST_STEPS = 10_000_000  # after a push

Factor = Annotated[float, Field(gt=0, le=100)]
Impulse = Annotated[float, Field(ge=-1e6, le=1e6)]
Factors = Factor | dict[str, Factor]


class NominalSettings(Settings):
    """A nominal model beside the study: `[[nominal.links]]`, as in a plant file."""

    links: Annotated[tuple[LinkSettings, ...], Field(min_length=1, max_length=64, strict=False)]


class SearchSettings(SamplerOptions):
    """`[search]`: the kinds of `lumps` that are searched, "gravity" and "coriolis" and, if wanted, "damping" and
    "coulomb"; bounds `low`, `high` and `start` as factors of the nominal lumps, one for all or a table by lump
    name (`upper_bounds` has the default of `high`); whether a bound that holds the search back may be moved away, once
    (`widen`; default: yes, but for a rig); the coordinates; a `target` of the measure at which the search may stop; and
    the options of the sampler.
    """

    lumps: Annotated[tuple[Literal["gravity", "coriolis", "damping", "coulomb"], ...], Field(strict=False)] = (
        "gravity",
        "coriolis",
    )
    coordinates: Literal["nominal-metric", "plain"] = "nominal-metric"
    start: Factors = 1.0
    low: Factors = 0.5
    high: Factors | None = None
    widen: bool | None = None
    target: Annotated[float, Field(ge=0)] | None = None

    @field_validator("lumps")
    @classmethod
    def _in_order(cls, lumps: tuple[str, ...]) -> tuple[str, ...]:
        if not set(IDEAL) <= set(lumps) or len(set(lumps)) < len(lumps):
            raise ValueError(f"needs {' and '.join(IDEAL)}, each kind once (allowed besides: {', '.join(FRICTION)})")
        return tuple(kind for kind in (*IDEAL, *FRICTION) if kind in lumps)


class EstimateSettings(AnyEstimateSettings):
    """`[estimate]` of a chain, with what it has of any robot. `lumps`: the kinds that are unknown (default: gravity,
    coriolis and inertia, and those of friction that the study searches). `lengths`: "free", or "exact" where the
    Coriolis lumps follow from the nominal lengths and the gravity lumps. `compare`: the "speed" that each push changes,
    the "frequency" of each joint, "both" (default: speed after short pushes, frequency after long ones), or the "count"
    of its half periods, of which the result is the set of models that count the same. `spread`: by how much the nominal
    lumps may be wrong, as a standard deviation.
    """

    lumps: (
        Annotated[tuple[Literal["gravity", "coriolis", "damping", "coulomb", "inertia"], ...], Field(strict=False)]
        | None
    ) = None
    lengths: Literal["free", "exact"] = "free"
    compare: Literal["speed", "frequency", "both", "count"] | None = None
    spread: Annotated[float, Field(ge=1e-6, le=10)] = 0.3

    @field_validator("faults")
    @classmethod
    def _told_apart(cls, faults: tuple[str, ...] | str) -> tuple[str, ...] | str:
        if {"tilt", "offset"} <= set(faults):
            raise ValueError(
                "a tilt of the base and an offset of the first encoder move alike (allowed: tilt, or offset, which "
                "then has the tilt in that of joint 1)"
            )
        return faults

    @field_validator("lumps")
    @classmethod
    def _needed(cls, lumps: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if lumps is not None and (not {"gravity", "inertia"} <= set(lumps) or len(set(lumps)) < len(lumps)):
            raise ValueError("needs gravity and inertia, each kind once (allowed besides: coriolis, damping, coulomb)")
        return lumps


class EpisodeSettings(Settings):
    """`[episode]`: the `measure`, and for "count" its counting `rule`; `pushes`: "rich", "designed" (the best of many
    rich sets, by the nominal model), "tip", or a list of impulses in N s, one per link tip; for the first two their
    `count` (default 2 per link); for all three the `peak_speed` in rad/s; `steps` after each push; the `fall_limit` in
    rad, the `fall_margin` (0: past the limit is fallen, however slow) and the `fall_runaway` beyond which a link has
    fallen wherever it is; `repeats` of every push, which average noise; the
    `lead` in s, for a plant whose torques come late: the law gets the angles that the speeds lead to by then.
    """

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
    lead: Annotated[float, Field(ge=0, le=1)] = 0.0


class StudySettings(Settings):
    """A study file."""

    description: str = ""
    plant: str
    nominal: str | NominalSettings
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
        return with_trials(tables)


class PushedSettings(Settings):
    """What was found at a rig when the study was created: the `impulses` of its pushes, in N s, and the absolute link
    `speeds` that they gave, in rad/s, on average; both (npush x njoint). `push_noise`: by how much an impulse differs
    from one time to the next, as a share of it. `angle_spread`: by how much the joint angles (njoint) right after a
    push do, in rad, beyond the noise of their readings. `angle_noise` in rad and `speed_noise` in rad/s: the standard
    deviations of the readings of each joint (njoint) at rest.
    """

    impulses: list[list[float]]
    speeds: list[list[float]]
    push_noise: float
    angle_spread: list[float]
    angle_noise: list[float]
    speed_noise: list[float]


class StudySpec(Settings):
    """A study with nothing left to look up."""

    name: str
    plant_name: str
    plant: PlantSettings | SocketSettings
    nominal: Annotated[tuple[LinkSettings, ...], Field(strict=False)]
    study: StudySettings
    pushed: PushedSettings | None = None

    def __repr__(self) -> str:
        return f"<StudySpec {self.name}: plant {self.plant_name}, {self.study.sampler}, trials={self.study.trials}>"

    @property
    def timestep(self) -> float:
        """Time between two control steps, in s."""
        return self.plant.control_period if isinstance(self.plant, PlantSettings) else self.plant.timestep

    @property
    def experiment(self) -> str:
        """A digest of what a trial's outcome follows from, beside its factors and its number: the plant, the nominal
        model, the pushes, what is searched. Studies that differ in nothing but sampler and trials have the same.
        """
        study = self.study
        parts = (self.plant, *self.nominal, study.episode, self.pushed)
        texts = ["" if part is None else part.model_dump_json() for part in parts]
        searched = [*study.search.lumps, str(study.seed)]
        return blake2b("\n".join([*texts, *searched]).encode(), digest_size=6).hexdigest()

    @property
    def names(self) -> list[str]:
        """The names under which the factors of candidates are in the DB."""
        return lump_names(len(self.nominal), self.study.search.lumps)

    @property
    def joints(self) -> tuple[str, ...]:
        """What its joints are called."""
        return tuple(f"joint {i + 1}" for i in range(len(self.nominal)))

    @property
    def gravity(self) -> float:
        """In m/s²."""
        return self.plant.gravity

    @property
    def measure(self) -> str:
        """The name of what is measured."""
        return self.study.episode.measure

    def with_nominal(self, nominal: Any) -> StudySpec:
        """A study of the same chain with another `nominal` model, its links.  Raises StudyError where that is no chain
        with as many.
        """
        is_chain = isinstance(nominal, tuple)
        if not is_chain or len(nominal) != len(self.nominal):
            raise StudyError(
                f"study {self.name}: its plant {self.plant_name} is a planar chain of {len(self.nominal)} links, "
                f"and the model to start from is {f'a planar chain of {len(nominal)}' if is_chain else 'an arm'}"
            )
        study = self.study.model_copy(update={"nominal": NominalSettings(links=nominal)})
        return self.model_copy(update={"nominal": nominal, "study": study})

    @property
    def joints_with_periods(self) -> int:
        """How many joints have their periods counted in each trial."""
        return len(self.nominal)


def read_study(name: str | Path, changes: dict[str, Any] | None = None) -> StudySpec | ArmSpec:
    """The shipped study of that name, or the study file at that path, with `changes` by dotted key; it may
    still contradict itself.  Raises StudyError, PlantError.

    What the file names lies in its own folder; a path in `changes` is the user's own and may be anywhere.
    """
    path = find_file("studies", str(name), StudyError)
    if path.suffix in ARM_FILES:
        raise StudyError(f"{path}: describes a robot, and is no study file ({NAMES_PLANT})")
    tables = read_toml(path, StudyError)
    if "plant" not in tables and tables.keys() & PLANT_KEYS:
        raise StudyError(f"{path}: a plant file, and no study file ({NAMES_PLANT})")
    changes = changes or {}
    for key, value in changes.items():
        _change(tables, key, value)

    def named(key: str, value: str) -> Path:
        if key in changes:
            return find_file("plants", value, PlantError)
        found = find_file_beside("plants", value, path, PlantError)
        if found.resolve().is_relative_to(path.parent.resolve()):
            refuse_parts_outside(found, path.parent)
        return found

    if isinstance(wanted := tables.get("plant"), str):
        plant_path = named("plant", wanted)
        any_plant = read_any_plant(plant_path)
        if not isinstance(any_plant, PlantSettings) and _is_of_arm(any_plant, tables.get("nominal"), named):
            return arm_spec(path, tables, plant_path, any_plant, named)
    study = check(StudySettings, tables, str(path), StudyError)
    plant_path = named("plant", study.plant)
    plant = cast("PlantSettings | SocketSettings", read_any_plant(plant_path))  # one that names an arm is read above
    if isinstance(plant, SocketSettings):
        of_rig = {} if "workers" in study.model_fields_set else {"workers": 1}
        study = study.model_copy(update=of_rig | {"estimate": study.estimate.of_rig})
    if isinstance(study.nominal, NominalSettings):
        nominal = study.nominal.links
    else:
        nominal = _same_gravity(read_plant(named("nominal", study.nominal)), plant, path).links
    return StudySpec(name=path.stem, plant_name=plant_path.stem, plant=plant, nominal=nominal, study=study)


def _is_of_arm(plant: ArmSettings | SocketSettings, nominal: Any, named: Callable[[str, str], Path]) -> bool:
    """Whether a study is of an arm: by its `plant`, or, of a rig, by the `nominal` model that its file names."""
    if not isinstance(plant, SocketSettings):
        return True
    file = nominal.get("plant") if isinstance(nominal, dict) else nominal
    return isinstance(file, str) and isinstance(read_any_plant(named("nominal", file)), ArmSettings)


def _change(tables: dict[str, Any], key: str, value: Any) -> None:
    *parents, last = key.split(".")
    for parent in parents:
        tables = tables.setdefault(parent, {})
        if not isinstance(tables, dict):
            raise StudyError(f"--set {key}: '{parent}' is not a table")
    tables[last] = value


def _same_gravity(model: PlantSettings, plant: PlantSettings | SocketSettings, path: Path) -> PlantSettings:
    if model.gravity != plant.gravity:
        raise StudyError(
            f"{path}: the nominal model's gravity is {model.gravity} m/s², the plant's {plant.gravity}: "
            "they must agree, it is not searched"
        )
    return model
