"""What follows from a study's settings before any trial.

`Problem` is that, of any robot: the candidates, the pushes, the coordinates of the search, what an estimate is told.
What differs between a chain and an arm is its `robot`.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from metaid.episode import QUANTITIES, Episode, Measure, Outcome, failure
from metaid.models import Array
from metaid.plant import SocketPlant, SocketSettings
from metaid.search import SAMPLERS, Coordinates, Searcher, at_bounds, make_searcher, plain_coordinates, widened
from metaid.study.arm import StudiedArm
from metaid.study.chain import StudiedChain
from metaid.study.contradictions import check_settings
from metaid.study.loops import loop_of
from metaid.study.spec import StudySpec

if TYPE_CHECKING:
    from metaid.compiled import Objective
    from metaid.estimation import Experiment

WINDOW_BUDGET, READING_BUDGET = 8_000_000, 16_000_000  # bytes a study, before they are made a text
MOST_TRIALS, MOST_BESIDE = 32, 12  # that an estimate is made of, and where the sampler does without it


class Problem:
    """All that a study's settings determine before any trial. Nothing is pushed before the episode is asked for.

    Raises StudyError where the settings contradict each other, those of the pushes when they are asked for, as by
    `check`.
    """

    def __init__(self, spec: StudySpec) -> None:
        self.spec = spec
        check_settings(spec)
        self.robot: StudiedArm | StudiedChain = StudiedArm(spec) if spec.is_arm else StudiedChain(spec)
        self.nominal: Any = self.robot.nominal  # a `Chain` or a `Tree`
        self.names, self.low, self.high = self.robot.names, self.robot.low, self.robot.high  # of a candidate's numbers
        self.measure: Measure = self.robot.measure
        self.timestep = spec.timestep  # s, between two control steps
        self._remembered: dict[bytes, Any] = {}  # of its experiments

    @property
    def chain(self) -> StudiedChain:
        """The robot of a study of a chain."""
        assert not self.spec.is_arm, "it is of an arm"
        return cast("StudiedChain", self.robot)

    @property
    def arm(self) -> StudiedArm:
        """The robot of a study of an arm."""
        assert self.spec.is_arm, "it is of a chain"
        return cast("StudiedArm", self.robot)

    @property
    def episode(self) -> Episode:
        """What is done to the plant with each candidate."""
        return self.robot.episode

    def check(self) -> None:
        """Raises StudyError where the pushes that the settings ask for contradict them."""
        _ = self.episode

    @property
    def is_matching(self) -> bool:
        """Whether the sampler works by the estimate. Where that explains nothing, no best trial is the result."""
        return SAMPLERS[self.spec.study.sampler].by_estimate

    @property
    def question(self) -> str | None:
        """What to ask about the units of the plant or the nominal model; None if nothing."""
        question: str | None = self.open_plant().question if self.spec.is_simulated else None
        return question or self.robot.question

    def open_plant(self) -> Any:
        """A plant of its own for each worker, simulated or not."""
        return self.robot.plant() if self.spec.is_simulated else self.open_rig()

    def open_rig(self) -> SocketPlant:
        """The plant behind the socket that the study names."""
        assert isinstance(self.spec.plant, SocketSettings), "it is a rig"
        return SocketPlant(self.spec.plant_name, self.spec.plant)

    def calibrated(self) -> StudySpec:
        """The study of a rig with what is measured at it, of its pushes and of its sensors."""
        with closing(self.open_rig()) as rig:
            return self.spec.model_copy(update={"pushed": self.robot.calibrated(rig)})

    @property
    def draws_episodes(self) -> bool:
        """Whether figures may ask for more episodes: a rig is not moved for a picture."""
        return self.spec.is_simulated and self.robot.draws_candidates

    # What a run asks.

    def make_objective(self) -> Objective:
        """An objective of its own for each worker."""
        return self.objective_on(self.open_plant(), self.episode)

    def objective_on(self, plant: Any, episode: Episode) -> Objective:
        """What evaluates candidates on a `plant` in an `episode`."""
        from metaid.compiled import Objective  # loads MuJoCo and numba, which most readers of a study do without

        return Objective(plant, self.robot.differ_from, episode, self.measure.name, self.spec.study.episode.rule)

    def make_searcher(self, experiment: Callable[[], Experiment | None] | None = None) -> Searcher:
        """The searcher at the study's seed, knowing of no trial; it may go by another `experiment` than the study's."""
        study = self.spec.study
        return make_searcher(study.sampler, self.coordinates, study.seed, study.search, experiment or self.experiment)

    def failed(self, reason: str) -> Outcome:
        """What the searcher is told of a candidate that could not be evaluated for that `reason`."""
        return failure(self.measure, self.episode, self.timestep, reason)

    @property
    def resolution(self) -> float:
        """How far two values of the measure must be apart to be told apart, in its unit."""
        return self.measure.resolution(self.episode, self.timestep)

    @property
    def noise_floor(self) -> float | None:
        """What noise alone shows of a plant at rest, in Hz; None where it is not subtracted."""
        return self.episode.noise_floor.frequency if self.measure.is_noisy else None

    def as_good_as(self, best: float) -> float:
        """The largest value that cannot be told from the `best` one. What noise alone takes below zero is luck."""
        return (max(best, 0.0) if self.measure.is_noisy else best) + self.resolution

    @cached_property
    def coordinates(self) -> Coordinates:
        """What a searcher moves in.  Raises StudyError where the nominal metric does not exist."""
        is_plain = self.spec.study.search.coordinates == "plain" or self.is_matching
        return self._plain if is_plain else self.metric

    @cached_property
    def metric(self) -> Coordinates:
        """The nominal metric, whatever the searcher moves in.  Raises StudyError where it does not exist."""
        return self.robot.metric(self._plain)

    @property
    def _plain(self) -> Coordinates:
        return plain_coordinates(self.robot.start, self.low, self.high)

    @property
    def widens(self) -> bool:
        """Whether a bound that holds the search back is moved away, where the sampler can go on then. A rig is sent
        nothing but what its user allows, and the bounds of an arm are beyond what its prior allows.
        """
        if self.spec.is_arm or not SAMPLERS[self.spec.study.sampler].widens:
            return False
        wanted = self.spec.study.search.widen
        return self.spec.is_simulated if wanted is None else wanted

    def widen(self, candidate: Array) -> Coordinates | None:
        """Moves away, once each, the bounds that a `candidate` (n) is at, of numbers that the measure can see.

        Returns:
            What a searcher moves in from now on; None where no bound is moved.
        """
        robot = self.robot
        at_low, at_high = (at & (self.is_matching | robot.seen) for at in at_bounds(candidate, self.low, self.high))
        low, high = widened(self.low, self.high, at_low & (self.low == robot.low), at_high & (self.high == robot.high))
        if (low == self.low).all() and (high == self.high).all():
            return None
        self.low, self.high = low, high
        return replace(self.coordinates, low=low, high=high)

    # What an estimate is made of.

    @property
    def trials_with_windows(self) -> int:
        """How many trials, from the first on, keep their windows in the DB: as many as an estimate is made of, and
        WINDOW_BUDGET holds.
        """
        episode = self.episode
        size = episode.npush * episode.njoint * len(episode.window_ends) * QUANTITIES * 8
        return min(self._most_shown, WINDOW_BUDGET // size) if size else 0

    @property
    def trials_with_readings(self) -> int:
        """How many trials, from the first on, keep their readings in the DB: as many as an estimate is made of, and
        READING_BUDGET holds.
        """
        episode, quantities = self.episode, 2 if self.spec.faults.speed_sensor else 1
        size = episode.npush * episode.njoint * (episode.readings_steps + 1) * quantities * 8
        return min(self._most_shown, READING_BUDGET // size) if self.spec.keeps_readings else 0

    @property
    def _most_shown(self) -> int:
        return MOST_TRIALS if self.is_matching else MOST_BESIDE

    @property
    def can_be_estimated(self) -> bool:
        """Whether the motion of its trials can be matched."""
        return self.spec.study.estimate.enabled and (bool(self.episode.window_ends) or self.spec.keeps_readings)

    @property
    def is_told_by_estimate(self) -> bool:
        """Whether the estimate says what can be determined, and not the measure: where the sampler goes by it, where
        frequencies are measured, which are matched, and of an arm.
        """
        of_measure = self.measure.name == "crossing" and self.can_be_estimated
        return self.is_matching or of_measure or self.spec.is_arm

    def experiment(self) -> Experiment | None:
        """What an estimate needs to know of this study; None where none can be made."""
        return self.made_experiment() if self.can_be_estimated else None

    def made_experiment(self) -> Experiment:
        """The same, also where the study makes no estimate. What is said of faults that are searched is not used; all
        that nobody says shows in the misfit.
        """
        from metaid.estimation import Experiment, searched_faults  # loads numba, which most readers do without

        experiment: type[Experiment] = Experiment
        if self.spec.study.estimate.compare == "count":
            from metaid.paper.counting import CountedExperiment

            experiment = CountedExperiment
        robot, wanted, faults = self.robot, self.spec.study.estimate, self.spec.faults
        unknowns, starts = robot.unknowns, robot.starts
        return experiment(
            laws=robot.laws,
            unknowns=unknowns,
            timestep=self.timestep,
            starts=starts,
            stiffness=robot.stiffness,
            resolution=self.resolution,
            compared=self._compared,
            loop=loop_of(self.spec, robot) if self.spec.keeps_readings else None,
            faults=searched_faults(wanted.searched_faults, unknowns, starts[:, 1], wanted.teeth),
            takes_up=wanted.takes_up_faults and not faults.torque_noise,
            torque_noise=np.full(len(self.spec.joints), faults.torque_noise) if faults.torque_noise else None,
            remembered=self._remembered,
        )

    def rehearsal(self, further: int = 0) -> tuple[Experiment, Objective]:
        """The experiment and the objective of the study if its nominal model were the truth; `further` is added to the
        seed of the noise.
        """
        experiment, plant, episode = self.robot.rehearsal(self.made_experiment())
        return experiment, self.objective_on(plant, replace(episode, seed=episode.seed + further))

    @property
    def _compared(self) -> Any:
        """What of the motion is compared where there is no noise."""
        if (wanted := self.spec.study.estimate.compare) is not None and wanted != "count":
            return wanted
        return "speed" if self.measure.sees_coriolis else "frequency"
