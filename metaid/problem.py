"""What a study is about: a study file made whole, and what follows from it.

`StudySpec` is all that a run depends on (the study's settings with plant and nominal model written out); it goes into
the study DB, so a study can be resumed and shown without its files. `Problem` is what follows: the nominal lumps, the
pushes, the episode, the coordinates.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from metaid.chain import Array, Chain, factors_from_names, lump_names
from metaid.coordinates import Coordinates, designed_speeds, nominal_metric, plain
from metaid.episode import (
    FALL_LIMIT,
    FALL_MARGIN,
    REACH,
    RICH_FALL_LIMIT,
    Episode,
    natural_time,
    pushed_speeds,
    pushes_for,
    rich_pushes,
    tip_push,
)
from metaid.errors import EpisodeError, PlantError, StudyError, unknown
from metaid.files import Settings, check, find_file, find_file_beside, read_toml
from metaid.measures import Measure, get_measure
from metaid.objective import Objective, Outcome, failure
from metaid.plant import LinkSettings, MujocoPlant, Plant, PlantSettings, chain_of, read_plant
from metaid.possible import refuse_impossible
from metaid.searchers import SAMPLERS, Searcher, SearchOptions, make_searcher
from metaid.socket_plant import SocketPlant, SocketSettings, read_any_plant

HORIZON = 1.5  # of a rich push, in units of √(l/g)
LARGEST_STEPS = 10_000_000  # after a push
SLOWEST_PUSH = 1e-9  # rad/s of the fastest link after a push; what is slower is lost in rounding
COUNTING_STEPS = 5000  # after a tip push, as in the paper
TIP_SPEED = 0.1  # rad/s of the fastest link after a tip push: small, so that the oscillation is

Factor = Annotated[float, Field(gt=0, le=100)]
Impulse = Annotated[float, Field(ge=-1e6, le=1e6)]
Factors = Factor | dict[str, Factor]


class NominalSettings(Settings):
    """A nominal model beside the study: `[[nominal.links]]`, as in a plant file."""

    links: Annotated[tuple[LinkSettings, ...], Field(min_length=1, max_length=64, strict=False)]


class SearchSettings(Settings):
    """`[search]`: bounds `low`, `high` and `start` as factors of the nominal lumps, one for all or a table by lump
    name; the coordinates; the first step `sigma` in them; the `generation` size (default: the sampler's own); a
    `target` of the measure at which the search may stop; the `increment` of the factors in dinoip's steps, and whether
    it goes `coarse_to_fine`."""

    coordinates: Literal["nominal-metric", "plain"] = "nominal-metric"
    start: Factors = 1.0
    low: Factors = 0.5
    high: Factors = 2.0
    sigma: Annotated[float, Field(gt=0, le=10)] = 0.2
    generation: Annotated[int, Field(ge=2, le=100_000)] | None = None
    target: Annotated[float, Field(ge=0)] | None = None
    increment: Annotated[float, Field(ge=1e-6, le=1)] = 0.01
    coarse_to_fine: bool = False


class EpisodeSettings(Settings):
    """`[episode]`: the `measure`, and for "count" its counting `rule`; `pushes`: "rich", "designed" (the best of many
    rich sets, by the nominal model), "tip", or a list of impulses in N s, one per link tip; for the first two their
    `count` (default 2 per link); for all three the `peak_speed` in rad/s; `steps` after each push; the `fall_limit` in
    rad and `fall_margin` (0: past the limit is fallen, however slow); the `physics`: "mujoco", or "analytic" to screen
    by the chain's own equations of motion, some five times as fast, and have MuJoCo verify the best.
    """

    physics: Literal["mujoco", "analytic"] = "mujoco"
    measure: str = "spectral"
    rule: str | None = None
    pushes: Literal["rich", "designed", "tip"] | Annotated[list[list[Impulse]], Field(max_length=1000)] | None = None
    count: Annotated[int, Field(ge=1, le=1000)] | None = None
    peak_speed: Annotated[float, Field(gt=0, le=1000)] | None = None
    steps: Annotated[int, Field(ge=2, le=LARGEST_STEPS)] | None = None
    fall_limit: Annotated[float, Field(gt=0, le=1000)] | None = None
    fall_margin: Annotated[float, Field(ge=0, le=1000)] = FALL_MARGIN


class StudySettings(Settings):
    """A study file."""

    description: str = ""
    plant: str
    nominal: str | NominalSettings
    sampler: str = "cmaes"
    trials: Annotated[int, Field(ge=1, le=100_000_000)]
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    workers: Annotated[int, Field(ge=1, le=1024)] = 2
    search: SearchSettings = SearchSettings()
    episode: EpisodeSettings = EpisodeSettings()


class PushedSettings(Settings):
    """What was found at a rig when the study was created: the `impulses` of its pushes, in N s, and the absolute link
    `speeds` that they gave, in rad/s; both (npush x njoint).
    """

    impulses: list[list[float]]
    speeds: list[list[float]]


class StudySpec(Settings):
    """A study with nothing left to look up."""

    name: str
    plant_name: str
    plant: PlantSettings | SocketSettings
    nominal: Annotated[tuple[LinkSettings, ...], Field(strict=False)]
    study: StudySettings
    pushed: PushedSettings | None = None


def load_study(name: str | Path, changes: dict[str, Any] | None = None) -> StudySpec:
    """The shipped study of that name, or the study file at that path, with `changes` by dotted key.  Raises
    StudyError, PlantError.

    What the file names lies in its own folder; a path in `changes` is the user's own and may be anywhere.
    """
    path = find_file("studies", str(name), StudyError)
    tables = read_toml(path, StudyError)
    changes = changes or {}
    for key, value in changes.items():
        _change(tables, key, value)
    study = check(StudySettings, tables, str(path), StudyError)

    def named(key: str, value: str) -> Path:
        if key in changes:
            return find_file("plants", value, PlantError)
        return find_file_beside("plants", value, path, PlantError)

    plant_path = named("plant", study.plant)
    plant = read_any_plant(plant_path)
    if isinstance(plant, SocketSettings) and "workers" not in study.model_fields_set:
        study = study.model_copy(update={"workers": 1})
    if isinstance(study.nominal, NominalSettings):
        nominal = study.nominal.links
    else:
        nominal = _same_gravity(read_plant(named("nominal", study.nominal)), plant, path).links
    spec = StudySpec(name=path.stem, plant_name=plant_path.stem, plant=plant, nominal=nominal, study=study)
    Problem(spec)
    return spec


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


class Problem:
    """All that a study's settings determine before any trial.  Raises StudyError where they contradict each other."""

    def __init__(self, spec: StudySpec) -> None:
        self.spec = spec
        self.nominal: Chain = chain_of(spec.nominal)
        self.names = lump_names(self.nominal.nlink)
        self.measure = _measure(spec.study.episode)
        if spec.study.sampler not in SAMPLERS:
            raise StudyError(f"sampler: {unknown('sampler', spec.study.sampler, SAMPLERS)}")
        plant = self.open_plant()
        if plant.njoint != self.nominal.nlink:
            raise StudyError(
                f"plant {plant.name} has {plant.njoint} links, the nominal model {self.nominal.nlink}: they must agree"
            )
        refuse_impossible("nominal model", self.nominal)
        if not self.is_simulated:
            self._check_rig()
        search = spec.study.search
        self.start, self.low, self.high = (self._factors(key, getattr(search, key)) for key in ("start", "low", "high"))
        for name, start, low, high in zip(self.names, self.start, self.low, self.high, strict=True):
            if not low < high or not low <= start <= high:
                raise StudyError(
                    f"search: the start {start:g} of {name} is not within its bounds {low:g} to {high:g} "
                    "(allowed: low <= start <= high, low < high)"
                )
        try:
            self.episode, self.start_speeds = self._pushed(plant)
        except EpisodeError as problem:
            raise StudyError(f"episode: {problem}") from None
        _refuse_unseen_pushes(self.start_speeds, plant.timestep)

    @property
    def is_simulated(self) -> bool:
        """Whether the plant is simulated here, and not a rig, which is not to be moved without need."""
        return isinstance(self.spec.plant, PlantSettings)

    @property
    def timestep(self) -> float:
        return self.spec.plant.timestep

    @property
    def resolution(self) -> float:
        """How far two values of the measure must be apart to be told apart, in its unit."""
        return self.measure.resolution(self.episode, self.timestep)

    @cached_property
    def coordinates(self) -> Coordinates:
        """What the searcher moves in.  Raises StudyError where the nominal metric does not exist."""
        if self.spec.study.search.coordinates == "plain":
            return plain(self.start, self.low, self.high)
        horizon = self.episode.steps * self.timestep
        try:
            metric = nominal_metric(
                self.nominal, self.spec.plant.gravity, self.start_speeds, horizon, self.start, self.low, self.high
            )
        except EpisodeError as problem:
            raise StudyError(f"search: coordinates: {problem}") from None
        return metric if self.measure.name == "spectral" else replace(metric, curvature=None)

    def open_plant(self) -> MujocoPlant | SocketPlant:
        """A plant of its own for each worker, simulated or not."""
        if isinstance(self.spec.plant, SocketSettings):
            return SocketPlant(self.spec.plant_name, self.spec.plant)
        return MujocoPlant(self.spec.plant_name, self.spec.plant)

    def make_plant(self) -> MujocoPlant:
        """A simulated plant.  Raises StudyError where the study's is none."""
        plant = self.open_plant()
        if isinstance(plant, MujocoPlant):
            return plant
        raise StudyError(f"plant {plant.name} is a rig, and this needs a simulated plant")

    def nominal_plant(self) -> MujocoPlant:
        """The nominal model as a plant."""
        if isinstance(self.spec.plant, PlantSettings):
            return MujocoPlant("nominal", self.spec.plant.model_copy(update={"links": self.spec.nominal}))
        settings = self.spec.plant
        return MujocoPlant(
            "nominal", PlantSettings(gravity=settings.gravity, timestep=settings.timestep, links=self.spec.nominal)
        )

    def make_objective(self) -> Objective:
        """An objective of its own for each worker."""
        return self._objective(self.spec.study.episode.physics)

    def verify(self, factors: Array) -> Outcome:
        """What MuJoCo says of `factors` (nlump), whichever physics the study searches with."""
        return self._objective("mujoco").evaluate(factors)

    def failed(self, reason: str) -> Outcome:
        """What the searcher is told of a candidate that could not be evaluated for that `reason`."""
        return failure(self.measure, self.episode, self.timestep, reason)

    def _objective(self, physics: str) -> Objective:
        rule = self.spec.study.episode.rule
        return Objective(self.open_plant(), self.nominal.lumps, self.episode, self.measure.name, physics, rule)

    def make_searcher(self) -> Searcher:
        """The searcher at the study's seed, knowing of no trial."""
        study, search = self.spec.study, self.spec.study.search
        options = SearchOptions(search.sigma, search.generation, search.increment, search.coarse_to_fine)
        return make_searcher(study.sampler, self.coordinates, study.seed, options)

    def _factors(self, key: str, given: Factors) -> Array:
        if not isinstance(given, dict):
            return np.full(len(self.names), given)
        default = SearchSettings.model_fields[key].default
        try:
            return factors_from_names(given, self.nominal.nlink, default)
        except EpisodeError as problem:
            raise StudyError(f"search: {key}: {problem}") from None

    def _check_rig(self) -> None:
        """What needs a simulation, or more than one plant.  Raises StudyError."""
        study = self.spec.study
        if study.workers != 1:
            raise StudyError(f"plant {self.spec.plant_name} is one rig: workers is {study.workers} (allowed: 1)")
        if study.episode.physics != "mujoco":
            raise StudyError(
                f"plant {self.spec.plant_name} is behind a socket, so its equations of motion are not known: "
                f"leave out episode.physics = '{study.episode.physics}'"
            )

    def _pushed(self, plant: Plant) -> tuple[Episode, Array]:
        """The episode, and the absolute link speeds (npush x njoint) after its pushes.

        Of a rig they are what was found at it when the study was created; before that, the nominal model's.
        """
        if self.is_simulated:
            return self.at_plant(plant)
        episode, speeds = self.at_plant(self.nominal_plant())
        if self.spec.pushed is None:
            return episode, speeds
        return replace(episode, pushes=np.array(self.spec.pushed.impulses)), np.array(self.spec.pushed.speeds)

    def at_plant(self, plant: Plant) -> tuple[Episode, Array]:
        """The episode that this `plant` is pushed in, and the speeds that it gets; pushes it to find out."""
        episode = self._make_episode(plant)
        return episode, pushed_speeds(plant, episode.pushes)

    def _make_episode(self, plant: Plant) -> Episode:
        wanted = self.spec.study.episode
        kind = wanted.pushes or ("rich" if wanted.measure == "spectral" else "tip")
        if kind == "rich" or kind == "designed":
            horizon = HORIZON * natural_time(self.nominal, plant.gravity)
            steps = wanted.steps or max(round(horizon / plant.timestep), 2)
            if steps > LARGEST_STEPS:
                raise EpisodeError(
                    f"steps of {plant.timestep} s are too short for a horizon of {horizon:.3g} s: {steps} of them "
                    f"(allowed: at most {LARGEST_STEPS}; name the steps, or make the timestep longer)"
                )
            pushes, fall_limit = self._strong_pushes(plant, kind, steps * plant.timestep), RICH_FALL_LIMIT
        else:
            steps, fall_limit = wanted.steps or COUNTING_STEPS, FALL_LIMIT
            pushes = tip_push(plant, wanted.peak_speed or TIP_SPEED) if kind == "tip" else _explicit(kind, plant.njoint)
        return Episode(pushes, steps, wanted.fall_limit or fall_limit, wanted.fall_margin)

    def _strong_pushes(self, plant: Plant, kind: Literal["rich", "designed"], horizon: float) -> Array:
        wanted, seed = self.spec.study.episode, self.spec.study.seed
        peak_speed, count = wanted.peak_speed or REACH / horizon, wanted.count or 2 * plant.njoint
        if kind == "rich":
            return rich_pushes(plant, count, peak_speed, seed)
        return pushes_for(plant, designed_speeds(self.nominal, plant.gravity, count, peak_speed, horizon, seed))


def _refuse_unseen_pushes(start_speeds: Array, timestep: float) -> None:
    """Raises StudyError where a push is so weak or so strong that no episode after it means anything; `start_speeds`
    (npush x nlink) in rad/s, `timestep` in s.
    """
    fastest = np.abs(start_speeds).max(axis=1)
    for push in np.flatnonzero(~((fastest >= SLOWEST_PUSH) & (fastest * timestep <= 1.0)))[:1]:
        raise StudyError(
            f"episode: push {push + 1} gives the fastest link {fastest[push]:.3g} rad/s "
            f"(allowed: {SLOWEST_PUSH:g} to {1.0 / timestep:g} rad/s, a radian in a timestep)"
        )


def _explicit(pushes: list[list[float]], njoint: int) -> Array:
    if not pushes or any(len(push) != njoint for push in pushes):
        raise EpisodeError(f"pushes: every push needs {njoint} impulses, one per link, in N s")
    return np.array(pushes)


def _measure(episode: EpisodeSettings) -> Measure:
    try:
        return get_measure(episode.measure, episode.rule)
    except EpisodeError as problem:
        raise StudyError(f"episode: measure: {problem}") from None
