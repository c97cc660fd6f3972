"""What a study is about: a study file made whole, and what follows from it.

`StudySpec` is all that a run depends on (the study's settings with plant and nominal model written out); it goes into
the study DB, so a study can be resumed and shown without its files. `Problem` is what follows for one stage of it: the
nominal lumps, the pushes, the episode, the coordinates. Most studies have one stage; with `[inertia]` a second searches
the inertia lumps, by a law made of what the first has found.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, field_validator

from metaid.bodies import BodySpace, bodies_of, body_space
from metaid.chain import FRICTION, IDEAL, Array, Chain, Lumps, factors_from_names, lump_names
from metaid.coordinates import Coordinates, designed_speeds, nominal_metric, plain, sensitivity
from metaid.episode import (
    FALL_LIMIT,
    FALL_MARGIN,
    REACH,
    RICH_FALL_LIMIT,
    Episode,
    NoiseFloor,
    natural_time,
    pushed_speeds,
    pushes_for,
    rich_pushes,
    tip_push,
)
from metaid.errors import EpisodeError, PlantError, StudyError, unknown
from metaid.faulty import FaultyPlant
from metaid.files import Settings, check, find_file, find_file_beside, read_toml
from metaid.measures import Measure, get_measure
from metaid.objective import Candidates, Objective, Outcome, failure
from metaid.plant import LinkSettings, MujocoPlant, Plant, PlantSettings, chain_of, read_plant
from metaid.possible import refuse_impossible
from metaid.searchers import SAMPLERS, Searcher, SearchOptions, make_searcher
from metaid.smoothing import noise_floor
from metaid.socket_plant import SocketPlant, SocketSettings, read_any_plant
from metaid.walk import Walking

HORIZON = 1.5  # of a rich push, in units of √(l/g)
LARGEST_STEPS = 10_000_000  # after a push
SLOWEST_PUSH = 1e-9  # rad/s of the fastest link after a push; what is slower is lost in rounding
RESTS = 200  # horizons of a push for which the readings of a plant at rest are watched
COUNTING_STEPS = 5000  # after a tip push, as in the paper
TIP_SPEED = 0.1  # rad/s of the fastest link after a tip push: small, so that the oscillation is

Factor = Annotated[float, Field(gt=0, le=100)]
Impulse = Annotated[float, Field(ge=-1e6, le=1e6)]
Factors = Factor | dict[str, Factor]


class NominalSettings(Settings):
    """A nominal model beside the study: `[[nominal.links]]`, as in a plant file."""

    links: Annotated[tuple[LinkSettings, ...], Field(min_length=1, max_length=64, strict=False)]


class SearchSettings(Settings):
    """`[search]`: the kinds of `lumps` that are searched, "gravity" and "coriolis" and, if wanted, "damping" and
    "coulomb"; bounds `low`, `high` and `start` as factors of the nominal lumps, one for all or a table by lump
    name; the coordinates; the first step `sigma` in them; the `generation` size (default: the sampler's own); a
    `target` of the measure at which the search may stop; the `increment` of the factors in dinoip's steps, and whether
    it goes `coarse_to_fine`.

    With the `space` "parameters", factors are of each link's mass and centre of mass instead, in coordinates of their
    own, and the last `walk` trials go through the bodies that are as good as the best.
    """

    lumps: Annotated[tuple[Literal["gravity", "coriolis", "damping", "coulomb"], ...], Field(strict=False)] = (
        "gravity",
        "coriolis",
    )
    space: Literal["lumps", "parameters"] = "lumps"
    walk: Annotated[int, Field(ge=0, le=100_000_000)] = 64
    coordinates: Literal["nominal-metric", "plain"] = "nominal-metric"
    start: Factors = 1.0
    low: Factors = 0.5
    high: Factors = 2.0
    sigma: Annotated[float, Field(gt=0, le=10)] = 0.2
    generation: Annotated[int, Field(ge=2, le=100_000)] | None = None
    target: Annotated[float, Field(ge=0)] | None = None
    increment: Annotated[float, Field(ge=1e-6, le=1)] = 0.01
    coarse_to_fine: bool = False

    @field_validator("lumps")
    @classmethod
    def _in_order(cls, lumps: tuple[str, ...]) -> tuple[str, ...]:
        if not set(IDEAL) <= set(lumps) or len(set(lumps)) < len(lumps):
            raise ValueError(f"needs {' and '.join(IDEAL)}, each kind once (allowed besides: {', '.join(FRICTION)})")
        return tuple(kind for kind in (*IDEAL, *FRICTION) if kind in lumps)


class InertiaSettings(Settings):
    """`[inertia]`: a second stage, which searches the inertia lumps: its number of `trials`, and the `stiffness` k in
    1/s² of the q̈ = −k q that its law asks for (default: one period within the horizon)."""

    trials: Annotated[int, Field(ge=1, le=100_000_000)]
    stiffness: Annotated[float, Field(gt=0, le=1e8)] | None = None


class EpisodeSettings(Settings):
    """`[episode]`: the `measure`, and for "count" its counting `rule`; `pushes`: "rich", "designed" (the best of many
    rich sets, by the nominal model), "tip", or a list of impulses in N s, one per link tip; for the first two their
    `count` (default 2 per link); for all three the `peak_speed` in rad/s; `steps` after each push; the `fall_limit` in
    rad and `fall_margin` (0: past the limit is fallen, however slow); `repeats` of every push, which average noise; the
    `lead` in s, for a plant whose torques come late: the law is told the angles that the speeds lead to by then; the
    `physics`: "mujoco", or "analytic" to screen by the chain's own equations of motion, some five times as fast, and
    have MuJoCo verify the best.
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
    repeats: Annotated[int, Field(ge=1, le=1000)] = 1
    lead: Annotated[float, Field(ge=0, le=1)] = 0.0


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
    inertia: InertiaSettings | None = None

    @property
    def total_trials(self) -> int:
        """The trials of all stages."""
        return self.trials + (self.inertia.trials if self.inertia else 0)


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

    @property
    def names(self) -> tuple[list[str], ...]:
        """The names under which the factors of each stage's candidates are in the DB."""
        if self.study.search.space == "parameters":
            return (bodies_of(chain_of(self.nominal)).names,)
        kinds = [self.study.search.lumps] + [("inertia",)] * (self.study.inertia is not None)
        return tuple(lump_names(len(self.nominal), searched) for searched in kinds)


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
    """All that a study's settings determine before any trial of a stage: of the first, or, given the factors `found`
    (nlump) there, of the second.  Raises StudyError where they contradict each other.
    """

    def __init__(self, spec: StudySpec, found: Array | None = None) -> None:
        self.spec = spec
        self.found = found
        self.stage = 1 if found is None else 2
        self.nominal: Chain = chain_of(spec.nominal)
        self.measure = _measure(spec.study.episode)
        _check_settings(spec, self.nominal)
        plant = self.open_plant()
        if plant.njoint != self.nominal.nlink:
            raise StudyError(
                f"plant {plant.name} has {plant.njoint} links, the nominal model {self.nominal.nlink}: they must agree"
            )
        refuse_impossible("nominal model", self.nominal)
        if not self.is_simulated:
            self._check_rig()
        self.lumps = self._nominal_lumps()
        self.names = self.lumps.names
        search = spec.study.search
        factors = [self._factors(key, getattr(search, key)) for key in ("start", "low", "high")]
        self.body_space: BodySpace | None = None
        if search.space == "parameters":
            self.body_space = body_space(self.nominal, *factors)
            _check_bounds(self.body_space.names, self.body_space.start, self.body_space.low, self.body_space.high)
            factors = [self.lump_factors(bound) for bound in factors]
        self.start, self.low, self.high = factors
        if found is not None:
            # A link that holds more mass than was believed has larger gravity and inertia lumps alike.
            self.start = np.clip(found[: self.nominal.nlink], self.low, self.high)
        _check_bounds(self.names, self.start, self.low, self.high)
        try:
            self.episode, self.start_speeds = self._pushed(plant)
        except EpisodeError as problem:
            raise StudyError(f"episode: {problem}") from None
        _refuse_unseen_pushes(self.start_speeds, plant.timestep)
        if self.measure.is_noisy and isinstance(plant, MujocoPlant):
            self.episode = replace(self.episode, noise_floor=self._noise_floor(plant))

    @property
    def is_simulated(self) -> bool:
        """Whether the plant is simulated here, and not a rig, which is not to be moved without need."""
        return isinstance(self.spec.plant, PlantSettings)

    @property
    def searched(self) -> Searched:
        """What candidates are factors of, and the bounds of these."""
        if self.body_space is None:
            return Searched(self.lumps, self.names, self.low, self.high)
        return Searched(self.body_space.bodies, self.body_space.names, self.body_space.low, self.body_space.high)

    def lump_factors(self, factors: Array) -> Array:
        """The factors of the lumps (... x nlump) that candidates with these `factors` (... x nsearched) have."""
        return factors if self.body_space is None else self.body_space.lump_factors(factors)

    @property
    def is_last(self) -> bool:
        """Whether no other stage follows."""
        return self.stage == len(self.spec.names)

    @property
    def is_only(self) -> bool:
        """Whether the study has no other stage."""
        return len(self.spec.names) == 1

    def second(self, found: Array) -> Problem | None:
        """The second stage, after the first has found these factors (nlump); None if there is none."""
        return None if self.is_last else Problem(self.spec, found)

    def stages(self, found: Array | None = None) -> list[Problem]:
        """This first stage and those that follow from the factors `found` (nlump) in it; if it has found none yet, from
        its nominal lumps.
        """
        following = self.second(np.ones(len(self.names)) if found is None else found)
        return [self] if following is None else [self, following]

    @property
    def timestep(self) -> float:
        """Time between two control steps, in s."""
        plant = self.spec.plant
        return plant.control_period if isinstance(plant, PlantSettings) else plant.timestep

    @property
    def resolution(self) -> float:
        """How far two values of the measure must be apart to be told apart, in its unit."""
        return self.measure.resolution(self.episode, self.timestep)

    def as_good_as(self, best: float) -> float:
        """The largest value that cannot be told from the `best` one. What noise alone takes below zero is luck."""
        return (max(best, 0.0) if self.measure.is_noisy else best) + self.resolution

    @cached_property
    def coordinates(self) -> Coordinates:
        """What a searcher of lumps moves in.  Raises StudyError where the nominal metric does not exist."""
        if self.spec.study.search.coordinates == "plain":
            return plain(self.start, self.low, self.high)
        try:
            metric = nominal_metric(self.sensitivity(), self.start, self.low, self.high)
        except EpisodeError as problem:
            raise StudyError(f"search: coordinates: {problem}") from None
        return metric if self.measure.name == "spectral" else replace(metric, curvature=None)

    def sensitivity(self) -> Array:
        """H (nlump x nlump) of this stage's lumps and pushes, by the nominal model.  Eq. 11."""
        horizon, gravity = self.episode.steps * self.timestep, self.spec.plant.gravity
        searched, stiffness = self.lumps.searched, self.episode.stiffness
        return sensitivity(self.nominal, gravity, self.start_speeds, horizon, searched, stiffness)

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
        """An objective of its own for each worker, in factors of what is searched."""
        return self._objective(self.spec.study.episode.physics, self.searched.nominal)

    def make_lump_objective(self) -> Objective:
        """An objective in factors of the nominal lumps, whatever is searched."""
        return self._objective(self.spec.study.episode.physics, self.lumps)

    def verify(self, factors: Array) -> Outcome:
        """What MuJoCo says of `factors` (nlump), whichever physics the study searches with."""
        return self._objective("mujoco", self.lumps).evaluate(factors)

    def failed(self, reason: str) -> Outcome:
        """What the searcher is told of a candidate that could not be evaluated for that `reason`."""
        return failure(self.measure, self.episode, self.timestep, reason)

    def _objective(self, physics: str, candidates: Candidates) -> Objective:
        rule = self.spec.study.episode.rule
        return Objective(self.open_plant(), self.lumps, self.episode, self.measure.name, physics, rule, candidates)

    def make_searcher(self) -> Searcher:
        """The searcher at the study's seed, knowing of no trial."""
        study, search = self.spec.study, self.spec.study.search
        options = SearchOptions(search.sigma, search.generation, search.increment, search.coarse_to_fine)
        if self.body_space is None:
            return make_searcher(study.sampler, self.coordinates, study.seed, options)
        coordinates = self.body_space.coordinates
        searcher = make_searcher(study.sampler, coordinates, study.seed, options)
        return Walking(searcher, coordinates, study.seed, study.trials - search.walk)

    def _nominal_lumps(self) -> Lumps:
        """What the candidates' factors are of. The law of the second stage is what the first has found."""
        lumps = self.nominal.lumps_of(self.spec.study.search.lumps)
        return lumps if self.found is None else replace(lumps.scaled(self.found), searched=("inertia",))

    def _factors(self, key: str, given: Factors) -> Array:
        names = self.names if self.spec.study.search.space == "lumps" else self.spec.names[0]
        if not isinstance(given, dict):
            return np.full(len(names), given)
        if names is not self.names:
            for name in given:
                if name not in names:
                    raise StudyError(f"search: {key}: {unknown('parameter', name, names)}")
            return np.array([given.get(name, SearchSettings.model_fields[key].default) for name in names])
        default, n = SearchSettings.model_fields[key].default, self.nominal.nlink
        try:
            named = factors_from_names(given, n, default, (*self.spec.study.search.lumps, "inertia"))
        except EpisodeError as problem:
            raise StudyError(f"search: {key}: {problem}") from None
        return named[-n:] if self.stage == 2 else named[: len(self.names)]

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
        kind = wanted.pushes or ("rich" if self.measure.sees_coriolis else "tip")
        if kind == "tip" and self.measure.name == "smoothed":
            raise EpisodeError(
                "pushes: 'smoothed' fits one curve to a push, so it must be short (allowed: rich pushes)"
            )
        if kind == "rich" or kind == "designed":
            horizon = HORIZON * natural_time(self.nominal, plant.gravity)
            steps = wanted.steps or max(round(horizon / self.timestep), 2)
            if steps > LARGEST_STEPS:
                raise EpisodeError(
                    f"steps of {self.timestep} s are too short for a horizon of {horizon:.3g} s: {steps} of them "
                    f"(allowed: at most {LARGEST_STEPS}; name the steps, or make the timestep longer)"
                )
            pushes, fall_limit = self._strong_pushes(plant, kind, steps * self.timestep), RICH_FALL_LIMIT
        else:
            steps, fall_limit = wanted.steps or COUNTING_STEPS, FALL_LIMIT
            pushes = tip_push(plant, wanted.peak_speed or TIP_SPEED) if kind == "tip" else _explicit(kind, plant.njoint)
        pushes = np.tile(pushes, (wanted.repeats, 1))
        limits = wanted.fall_limit or fall_limit, wanted.fall_margin
        stiffness = self._stiffness(steps * self.timestep)
        return Episode(pushes, steps, *limits, stiffness=stiffness, seed=self.spec.study.seed, lead=wanted.lead)

    def _stiffness(self, horizon: float) -> float:
        inertia = self.spec.study.inertia
        if self.stage == 1 or inertia is None:
            return 0.0
        return inertia.stiffness or (2.0 * np.pi / horizon) ** 2

    def _noise_floor(self, plant: MujocoPlant) -> NoiseFloor:
        """From a rest episode of this `plant`: held upright, its sensors are read for RESTS times a push's horizon."""
        count = self.episode.steps + 1
        rest = FaultyPlant(plant).rest(RESTS * count, self.spec.study.seed)
        joint_speeds = np.diff(self.start_speeds, axis=1, prepend=0.0)
        return noise_floor(rest.reshape(RESTS, count, -1), self.timestep, joint_speeds)

    def _strong_pushes(self, plant: Plant, kind: Literal["rich", "designed"], horizon: float) -> Array:
        wanted, seed = self.spec.study.episode, self.spec.study.seed
        peak_speed, count = wanted.peak_speed or REACH / horizon, wanted.count or 2 * plant.njoint
        if kind == "rich":
            return rich_pushes(plant, count, peak_speed, seed)
        kinds = self.spec.study.search.lumps
        return pushes_for(plant, designed_speeds(self.nominal, plant.gravity, count, peak_speed, horizon, seed, kinds))


class Searched(NamedTuple):
    """The `nominal` of which candidates are factors; the `names` (nsearched) of these, and their bounds `low` and
    `high`.
    """

    nominal: Candidates
    names: list[str]
    low: Array
    high: Array


def _check_bounds(names: list[str], starts: Array, lows: Array, highs: Array) -> None:
    """Raises StudyError where a start is not within its bounds."""
    for name, start, low, high in zip(names, starts, lows, highs, strict=True):
        if not low < high or not low <= start <= high:
            raise StudyError(
                f"search: the start {start:g} of {name} is not within its bounds {low:g} to {high:g} "
                "(allowed: low <= start <= high, low < high)"
            )


def _check_parameters(study: StudySettings) -> None:
    """Raises StudyError where a search of individual parameters is asked for what it does not have."""
    search = study.search
    given = {
        "search.lumps": search.lumps != IDEAL,
        "search.coordinates": search.coordinates != "nominal-metric",
        "search.target": search.target is not None,
        "inertia": study.inertia is not None,
    }
    for key, has in given.items():
        if has:
            raise StudyError(f"{key}: space = 'parameters' has none of these: leave it out")
    if study.episode.measure != "spectral":
        raise StudyError("search: space: 'parameters' follow from the Coriolis lumps too, so measure = 'spectral'")
    if search.walk >= study.trials:
        raise StudyError(f"search: walk is {search.walk} of {study.trials} trials (allowed: less than all)")


def _check_settings(spec: StudySpec, nominal: Chain) -> None:
    """Raises StudyError where settings contradict each other."""
    study, plant = spec.study, spec.plant
    if study.search.space == "parameters":
        _check_parameters(study)
    if study.sampler not in SAMPLERS:
        raise StudyError(f"sampler: {unknown('sampler', study.sampler, SAMPLERS)}")
    if study.inertia is not None and study.episode.measure != "spectral":
        raise StudyError("inertia: a second stage needs the Coriolis lumps, so measure = 'spectral'")
    if study.episode.measure == "smoothed" and study.search.lumps != IDEAL:
        raise StudyError("search: lumps: 'smoothed' does not see friction (allowed: gravity and coriolis)")
    dry = isinstance(plant, PlantSettings) and any(link.frictionloss for link in plant.links)
    if study.episode.physics == "analytic" and dry:
        raise StudyError("episode: physics: 'analytic' has no dry friction, and the plant has (allowed: 'mujoco')")
    for kind, key in zip(FRICTION, ("damping", "frictionloss"), strict=True):
        missing = np.flatnonzero(nominal.lumps_of((kind,)).of(kind) == 0.0) + 1
        if kind in study.search.lumps and len(missing):
            raise StudyError(
                f"search: lumps: {key} of link {missing[0]} is 0 in the nominal model, so there are no factors of it "
                f"(allowed: above 0 where {kind} is searched)"
            )


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
