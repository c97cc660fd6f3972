"""What follows from a study's settings before any trial.

`Problem` is that: the nominal lumps, the pushes, the episode, the coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from metaid.episode import QUANTITIES, Episode, Outcome, failure, pushed_speeds
from metaid.errors import EpisodeError, StudyError
from metaid.models import (
    FRICTION,
    IDEAL,
    Array,
    Chain,
    Lumps,
    factors_from_names,
    kind_of,
    question_of_units,
    refuse_impossible,
)
from metaid.plant import MujocoPlant, Plant, PlantSettings, SocketPlant, SocketSettings, chain_of
from metaid.search import (
    SAMPLERS,
    Coordinates,
    Searcher,
    at_bounds,
    make_searcher,
    nominal_metric,
    plain_coordinates,
    sensitivity,
    widened,
)
from metaid.study.any_problem import StudyProblem
from metaid.study.calibration import calibrate_chain, calibration_of
from metaid.study.contradictions import (
    check_bounds,
    check_chain,
    check_settings,
    lump_factors,
    measure_of,
    upper_bounds,
)
from metaid.study.experiments import noisy_experiment, rig_experiment
from metaid.study.parameters import Parameters, lumps_of
from metaid.study.pushing import make_episode, refuse_unseen_pushes, rest_noise
from metaid.study.spec import StudySpec

if TYPE_CHECKING:
    from metaid.compiled import Objective
    from metaid.estimation import Experiment
    from metaid.models.tree import ModelError

WINDOW_BUDGET = 4_000_000  # bytes a study, before they are made a text
READING_BUDGET = 16_000_000  # likewise
MOST_TRIALS = 32  # that an estimate is made of
MOST_READ = 12  # that keep readings where the sampler does without the estimate: it is to be there in seconds


class Problem(StudyProblem):
    """All that a study's settings determine before any trial. Nothing is pushed before the episode is asked for.

    Raises StudyError where the settings contradict each other, those of the pushes when they are asked for, as by
    `check`.
    """

    spec: StudySpec

    def __init__(self, spec: StudySpec) -> None:
        self.spec = spec
        self.nominal: Chain = chain_of(spec.links)
        self.measure = measure_of(spec.study.episode)
        check_settings(spec)
        check_chain(spec, self.nominal)
        plant = self.open_plant()
        if plant.njoint != self.nominal.nlink:
            raise StudyError(
                f"plant {plant.name} has {plant.njoint} links, the nominal model {self.nominal.nlink}: they must agree"
            )
        refuse_impossible("nominal model", self.nominal)
        self.lumps: Lumps = self.nominal.lumps_of(spec.study.search.lumps)  # what candidates' factors are of
        self.names = self.lumps.names
        search = spec.study.search
        given = {"start": search.start, "low": search.low, "high": upper_bounds(spec)}
        nlink = self.nominal.nlink
        self.start, self.low, self.high = (lump_factors(key, each, nlink, search) for key, each in given.items())
        self._first_low, self._first_high = self.low, self.high
        check_bounds(self.names, self.start, self.low, self.high)

    @property
    def episode(self) -> Episode:
        """What is done to the plant with each candidate."""
        return self._pushed[0]

    @property
    def start_speeds(self) -> Array:
        """Absolute link speeds (npush x nlink) right after the pushes, in rad/s."""
        return self._pushed[1]

    def check(self) -> None:
        """Raises StudyError where the pushes that the settings ask for contradict them."""
        _ = self._pushed

    @property
    def counted_joints(self) -> int:
        """How many joints have their periods counted in each trial."""
        return self.nominal.nlink

    @property
    def question(self) -> str | None:
        return super().question or question_of_units("the nominal model", self.nominal, self.spec.gravity)

    def calibrated(self) -> StudySpec:
        """The study with the pushes that its rig needs, and what was measured of them and of its sensors."""
        with closing(self.open_rig()) as rig:
            pushed = calibrate_chain(rig, self.nominal, self.at_plant(rig).pushes, self.spec.study.episode.repeats)
        return self.spec.model_copy(update={"pushed": pushed})

    def candidate(self, factors: Mapping[str, float]) -> Array:
        """The candidate (nlump) with these `factors` of its nominal lumps, 1 of those not named.  Raises EpisodeError
        where there is no such lump.
        """
        return factors_from_names(dict(factors), self.nominal.nlink, kinds=self.lumps.searched)

    @property
    def trials_with_windows(self) -> int:
        """How many trials, from the first on, keep their windows in the DB: as many as an estimate is made of, and
        WINDOW_BUDGET holds.
        """
        size = self.episode.pushes.size * len(self.episode.window_ends) * QUANTITIES * 8
        return min(MOST_TRIALS, WINDOW_BUDGET // size) if size else 0

    @property
    def trials_with_readings(self) -> int:
        """How many trials, from the first on, keep their readings in the DB: as many as an estimate is made of, and
        READING_BUDGET holds.
        """
        quantities = 2 if self.spec.faults.speed_sensor else 1
        size = self.episode.pushes.size * (self.episode.readings_steps + 1) * quantities * 8
        most = MOST_TRIALS if self.is_matching else MOST_READ
        return min(most, READING_BUDGET // size) if self.keeps_readings else 0

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
        if self.spec.study.search.coordinates == "plain" or self.is_matching:
            return plain_coordinates(self.start, self.low, self.high)
        return self.metric

    @cached_property
    def metric(self) -> Coordinates:
        """The nominal metric, whatever the searcher moves in.  Raises StudyError where it does not exist."""
        try:
            metric = nominal_metric(self.sensitivity(), self.start, self.low, self.high)
        except EpisodeError as problem:
            raise StudyError(f"search: coordinates: {problem}") from None
        return metric if self.measure.name == "spectral" else replace(metric, curvature=None)

    def sensitivity(self) -> Array:
        """H (nlump x nlump) of the lumps and pushes, by the nominal model.  Eq. 11."""
        horizon, gravity = self.episode.steps * self.timestep, self.spec.gravity
        return sensitivity(self.nominal, gravity, self.start_speeds, horizon, self.lumps.searched)

    @property
    def widens(self) -> bool:
        """Whether a bound that holds the search back is moved away. A rig is sent nothing but what its user allows."""
        wanted = self.spec.study.search.widen
        return self.is_simulated if wanted is None else wanted

    @property
    def widens_by_itself(self) -> bool:
        """Whether that is so with the study's sampler."""
        return self.widens and SAMPLERS[self.spec.study.sampler].widens

    def widen(self, factors: Array) -> Coordinates | None:
        """Moves away, once each, the bounds that these `factors` (nlump) are at, of lumps that the measure can see.

        Returns:
            What a searcher moves in from now on; None where no bound is moved.
        """
        seen = self.is_matching | self.measure.determined(self.lumps)
        at_low, at_high = (at & seen for at in at_bounds(factors, self.low, self.high))
        low, high = widened(
            self.low, self.high, at_low & (self.low == self._first_low), at_high & (self.high == self._first_high)
        )
        if (low == self.low).all() and (high == self.high).all():
            return None
        self.low, self.high = low, high
        return replace(self.coordinates, low=low, high=high)

    def open_plant(self) -> MujocoPlant | SocketPlant:
        """A plant of its own for each worker, simulated or not."""
        if not self.is_simulated:
            return self.open_rig()
        return MujocoPlant(self.spec.plant_name, self.spec.simulated)

    def nominal_plant(self) -> MujocoPlant:
        """The nominal model as a plant, with the faults of the plant file but for those that are searched."""
        spec = self.spec
        if spec.simulated is not None:
            faults = spec.faults.without(spec.study.estimate.undeclared_faults)
            return MujocoPlant("nominal", spec.simulated.model_copy(update={"links": spec.links, "faults": faults}))
        return MujocoPlant("nominal", PlantSettings(gravity=spec.gravity, timestep=spec.timestep, links=spec.links))

    def make_objective(self) -> Objective:
        """An objective of its own for each worker, in factors of the nominal lumps."""
        from metaid.compiled import Objective  # loads MuJoCo and numba, which most readers of a study do without

        rule = self.spec.study.episode.rule
        return Objective(self.open_plant(), self.lumps, self.episode, self.measure.name, rule)

    def failed(self, reason: str) -> Outcome:
        """What the searcher is told of a candidate that could not be evaluated for that `reason`."""
        return failure(self.measure, self.episode, self.timestep, reason)

    def make_searcher(self, experiment: Callable[[], Experiment | None] | None = None) -> Searcher:
        """The searcher at the study's seed, knowing of no trial; it may go by another `experiment` than the study's."""
        study = self.spec.study
        return make_searcher(study.sampler, self.coordinates, study.seed, study.search, experiment or self.experiment)

    @property
    def can_be_estimated(self) -> bool:
        """Whether the motion of its trials can be matched."""
        keeps = bool(self.episode.window_ends) or self.keeps_readings
        return self.spec.study.estimate.enabled and keeps

    @property
    def is_told_by_estimate(self) -> bool:
        """Whether the estimate says what can be determined, and not the measure: where the sampler goes by it, and
        where frequencies are measured, which are matched.
        """
        return self.is_matching or (self.measure.name == "crossing" and self.can_be_estimated)

    @property
    def keeps_readings(self) -> bool:
        """Whether trials keep what the sensors read, as on a rig or a plant with faults, and no windows."""
        return self.episode.readings_steps > 0

    @property
    def given(self) -> dict[str, Any]:
        """What of an estimate follows from the study, by the names of its fields."""
        return {}

    @property
    def estimated_kinds(self) -> tuple[str, ...]:
        """The kinds of lumps that an estimate is of."""
        study = self.spec.study
        if study.estimate.lumps is not None:
            return study.estimate.lumps
        return (*IDEAL, "inertia", *(kind for kind in study.search.lumps if kind in FRICTION))

    def experiment(self) -> Experiment | None:
        """What an estimate needs to know of this study; None where none can be made."""
        # These load numba.
        from metaid.estimation import ChainLaws, Experiment, LogUnknowns, upright
        from metaid.paper.counting import CountedExperiment

        if not self.can_be_estimated:
            return None
        wanted, kinds = self.spec.study.estimate, self.estimated_kinds
        lengths = self.nominal.length if wanted.lengths == "exact" else None
        unknowns = LogUnknowns(self.nominal.lumps_of(kinds), self.spec.gravity, kinds, lengths, wanted.spread)
        start_speeds = np.diff(self.start_speeds, axis=1, prepend=0.0)
        if isinstance(self.spec.plant, SocketSettings):
            plant, pushed = self.spec.plant, self.spec.pushed
            return rig_experiment(plant, pushed, wanted, self.episode, self.lumps, unknowns, start_speeds)
        if self.keeps_readings:
            return noisy_experiment(self.make_plant(), self.spec, self.episode, self.lumps, unknowns, start_speeds)
        watched: dict[str, Any] = {
            "laws": ChainLaws(self.lumps, unknowns.gravity),
            "unknowns": unknowns,
            "timestep": self.timestep,
            "starts": upright(start_speeds),
            "resolution": self.resolution,
        }
        if wanted.compare == "count":
            return CountedExperiment(**watched)
        return Experiment(
            **watched, compared=wanted.compare or ("speed" if self.measure.sees_coriolis else "frequency")
        )

    @cached_property
    def _pushed(self) -> tuple[Episode, Array]:
        """Of a rig what was found at it when the study was created; before that, the nominal model's."""
        plant, pushed = self.open_plant(), self.spec.pushed
        moved = plant if isinstance(plant, MujocoPlant) else self.nominal_plant()
        try:
            episode = self.at_plant(moved)
            if pushed is None:
                speeds = pushed_speeds(moved, episode.pushes)
            else:
                speeds = np.cumsum(pushed.speeds, axis=1)
                known = calibration_of(pushed, self.nominal, plant.gravity, self.spec.study.episode.repeats)
                episode = replace(episode, pushes=np.array(pushed.impulses), calibration=known)
        except EpisodeError as problem:
            raise StudyError(f"episode: {problem}") from None
        refuse_unseen_pushes(speeds, plant.timestep)
        if self.measure.is_noisy and isinstance(plant, MujocoPlant):
            episode = replace(episode, noise_floor=rest_noise(plant, self.spec, episode, speeds))
        return episode, speeds

    def at_plant(self, plant: Plant) -> Episode:
        """The episode that this `plant` is pushed in; pushes it to find out."""
        return make_episode(plant, self.spec, self.nominal, self.measure)

    # What results are told by. An arm's problem answers to the same.

    faint, all_fell, far_off = "push more, or harder", "no trial survived: raise search.high, or start higher", ""
    tilts = 1  # axes about which a base may be tilted

    @cached_property
    def sought(self) -> Parameters:
        """The lumps that candidates are factors of."""
        return lumps_of(self.nominal, self.lumps.searched)

    @cached_property
    def estimated(self) -> Parameters:
        """The lumps that an estimate is of."""
        return lumps_of(self.nominal, self.estimated_kinds)

    @property
    def noise_floor(self) -> float | None:
        """What noise alone shows of a plant at rest, in Hz; None where it is not subtracted."""
        return self.episode.noise_floor.frequency if self.measure.is_noisy else None

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which of the lumps that are sought (nlump) the measure can find."""
        return self.measure.determined(self.lumps)

    @property
    def draws_episodes(self) -> bool:
        """Whether figures may ask for more episodes: a rig is not moved for a picture."""
        return self.is_simulated

    @property
    def slides(self) -> NDArray[np.bool_]:
        """Which joints are slides, and no hinges (njoint)."""
        return np.zeros(self.nominal.nlink, dtype=np.bool_)

    @property
    def push_titles(self) -> list[str]:
        """What the pushes of an episode are called (npush)."""
        return [f"push {push + 1}" for push in range(len(self.episode.pushes))]

    @property
    def nominal_law(self) -> Lumps:
        """The nominal lumps that candidates are factors of."""
        return self.lumps

    def law_at(self, values: Mapping[str, float]) -> Lumps:
        """The law with these `values` of lumps, by name: of all that are sought, and of inertia where it has these."""
        law = self.lumps.with_parameters(np.array([values[name] for name in self.names]))
        inertia = [value for name, value in values.items() if kind_of(name) == "inertia"]
        return replace(law, inertia=np.array(inertia) if inertia else None)

    def true_values(self, wanted: Parameters) -> Array:
        """The true values (n) of what is `wanted`; NaN where they are not known. Only results ask for them."""
        truth = self.open_plant().true_lumps()
        kinds = tuple(dict.fromkeys(map(kind_of, wanted.names)))
        return np.full(len(wanted.names), np.nan) if truth is None else truth.vector_of(kinds, np.nan)

    def true_law(self) -> Lumps | None:
        """The law with the true lumps; None where they are not known. Only results ask for it."""
        return self.open_plant().true_lumps()

    def model_error(self, law: Any) -> ModelError | None:
        """How wrong a law is on states that no trial has seen: of a chain the errors of its lumps say so."""
        return None

    def is_about(self, plant: Any) -> bool:
        """Whether this is the `plant` that is studied."""
        return isinstance(plant, MujocoPlant) and plant.settings == self.spec.plant
