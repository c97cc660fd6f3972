"""What follows from the settings of a study of an arm before any trial."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from metaid.episode import (
    MEASURES,
    QUANTITIES,
    Episode,
    FallRule,
    KnownStarts,
    Outcome,
    arm_episode,
    failure,
    window_ends,
)
from metaid.models import Array
from metaid.models.tree import ArmPrior, ModelError, Tree, model_error
from metaid.plant import ArmPlant, ArmSettings, SocketPlant, SocketSettings
from metaid.search import (
    Coordinates,
    Searcher,
    arm_sensitivity,
    make_searcher,
    plain_coordinates,
    prior_metric,
)
from metaid.study.any_problem import StudyProblem
from metaid.study.calibration import calibrate_arm, start_spread
from metaid.study.contradictions import check_settings
from metaid.study.loops import loop_of_plant, loop_of_rig
from metaid.study.parameters import Parameters, base_parameters_of, settled
from metaid.study.spec import StudySpec

if TYPE_CHECKING:
    from metaid.compiled import Objective
    from metaid.estimation import Experiment, Loop

FARTHEST = 10.0  # standard deviations of the prior: no base parameter beyond is tried
WINDOW_BUDGET = 8_000_000  # bytes a study
MOST_MATCHED = 8  # trials that an estimate is made of where the sampler does without


class ArmProblem(StudyProblem):
    """All that the settings of a study of an arm determine before any trial."""

    widens, measure = False, MEASURES["kinetic"]

    spec: StudySpec

    def __init__(self, spec: StudySpec) -> None:
        self.spec = spec
        check_settings(spec)
        self.nominal: Tree = spec.tree
        self.prior = ArmPrior(self.nominal, spec.study.estimate.prior, spec.counted_by, spec.tilts)
        self.names = list(self.prior.base.names)
        reach = FARTHEST * np.sqrt(np.diag(self.prior.covariance))
        self.start = self.prior.values
        self.low, self.high = self.start - reach, self.start + reach

    @cached_property
    def episode(self) -> Episode:
        """What is done to the arm with each candidate."""
        wanted, starts = self.spec.study.episode, tuple(each.start for each in self.spec.starts)
        steps = max(round(wanted.horizon / self.timestep), 2)
        pushed = self.spec.pushed
        return arm_episode(
            self.nominal,
            starts,
            np.array([each.stiffness for each in self.spec.starts]),
            steps,
            fall_rule=FallRule(runaway=wanted.runaway),
            window_ends=window_ends(steps),
            seed=self.spec.study.seed,
            calibration=None if pushed is None else KnownStarts(np.stack([pushed.angles, pushed.speeds], axis=1)),
            lead=wanted.lead,
            readings_steps=steps if self.keeps_readings else 0,
        )

    def calibrated(self) -> StudySpec:
        """The study of a rig with what is measured at it."""
        with closing(self.open_rig()) as rig:
            pushed = calibrate_arm(rig, self.nominal, [each.start for each in self.spec.starts])
        return self.spec.model_copy(update={"pushed": pushed})

    @cached_property
    def coordinates(self) -> Coordinates:
        """What a searcher moves in: one that minimises, in the metric of the measure."""
        return plain_coordinates(self.start, self.low, self.high) if self.is_matching else self.metric

    @cached_property
    def metric(self) -> Coordinates:
        """That metric, whatever the searcher moves in."""
        return prior_metric(self.sensitivity(), self.prior, self.low, self.high)

    def sensitivity(self, values: Array | None = None) -> Array:
        """H (nbase x nbase) of the measure, by the nominal arm, or by the mass matrix of one with these `values`
        (nbase).  Eq. 61.
        """
        return arm_sensitivity(self.prior, self.episode, self.timestep, values)

    @property
    def counted_joints(self) -> int:
        """How many joints have their periods in each trial: 0 of each, for an arm's are not counted."""
        return self.nominal.njoint

    @property
    def trials_with_windows(self) -> int:
        """How many trials, from the first on, keep their windows in the DB."""
        size = self.episode.npush * len(self.episode.window_ends) * QUANTITIES * len(self.nominal.names) * 8
        return self._most_matched(WINDOW_BUDGET // size)

    @property
    def trials_with_readings(self) -> int:
        """How many trials, from the first on, keep their readings in the DB."""
        return self._most_matched(self.spec.study.trials) if self.keeps_readings else 0

    def _most_matched(self, most: int) -> int:
        return most if self.is_matching else min(most, MOST_MATCHED)

    @property
    def keeps_readings(self) -> bool:
        """Whether trials keep what sensors read."""
        return self.spec.keeps_readings

    @property
    def resolution(self) -> float:
        """A value of the measure below this passes for coasting, in Hz."""
        return self.measure.resolution(self.episode, self.timestep)

    def open_plant(self) -> ArmPlant | SocketPlant:
        """A plant of its own for each worker, simulated or not."""
        plant = self.spec.simulated
        if plant is None:
            return self.open_rig()
        settings = ArmSettings(
            mjcf=self.spec.plant_name,
            timestep=plant.timestep,
            truth_known=plant.truth_known,
            faults=plant.faults,
            stiffness=plant.stiffness,
        )
        return ArmPlant(self.spec.plant_name, settings, plant.arm.tree)

    @property
    def truth(self) -> Tree | None:
        """The true arm, where it is known."""
        plant = self.spec.simulated
        return None if plant is None or not plant.truth_known else plant.arm.tree

    def nominal_plant(self) -> ArmPlant:
        """The nominal arm as a plant, without faults."""
        return ArmPlant("nominal", ArmSettings(mjcf="nominal", timestep=self.spec.plant.timestep), self.nominal)

    def candidate(self, factors: Mapping[str, float]) -> Array:
        """The candidate (nbase) with these `factors` of its nominal base parameters, 1 of those not named.  Raises
        EpisodeError where there is no such base parameter.
        """
        return self.prior.scaled(factors)

    def make_objective(self) -> Objective:
        """An objective of its own for each worker, in base parameters."""
        from metaid.compiled import Objective  # loads MuJoCo and numba

        return Objective(self.open_plant(), self.prior, self.episode, self.measure.name)

    def failed(self, reason: str) -> Outcome:
        """What the searcher is told of a candidate that could not be evaluated for that `reason`."""
        return failure(self.measure, self.episode, self.timestep, reason)

    def make_searcher(self) -> Searcher:
        """The searcher at the study's seed, knowing of no trial."""
        study = self.spec.study
        return make_searcher(study.sampler, self.coordinates, study.seed, study.search, self.experiment)

    def check(self) -> None:
        """Nothing is left that its settings could contradict."""

    def widen(self, values: Array) -> None:
        """No bound is moved: they are beyond what the prior allows."""

    def experiment(self) -> Experiment | None:
        """What an estimate needs to know of this study; None where none is to be made."""
        wanted, faults = self.spec.study.estimate, self.spec.faults
        if not wanted.enabled:
            return None
        from metaid.estimation import ArmLaws, BaseUnknowns, Experiment, searched_faults  # loads numba

        unknowns, begins = BaseUnknowns(self.prior), self.episode.begins
        return Experiment(
            laws=ArmLaws(unknowns, self.episode),
            unknowns=unknowns,
            timestep=self.timestep,
            starts=begins,
            stiffness=self.episode.springs,
            resolution=self.resolution,
            loop=self._loop if self.keeps_readings else None,
            faults=searched_faults(wanted.searched_faults, unknowns, begins[:, 1], wanted.teeth),
            takes_up=wanted.takes_up_faults and not faults.torque_noise,
            torque_noise=np.full(self.nominal.njoint, faults.torque_noise) if faults.torque_noise else None,
        )

    @property
    def _loop(self) -> Loop:
        """How the arm is controlled and read, as far as its user states it, or as it was measured at a rig."""
        plant, wanted, pushed, lead = self.spec.plant, self.spec.study.estimate, self.spec.pushed, self.episode.lead
        if isinstance(plant, SocketSettings):
            noise, spread = (None, None) if pushed is None else (pushed.angle_noise, start_spread(pushed))
            return loop_of_rig(plant, noise, spread, wanted, lead)
        faults, speeds, n = plant.faults, self.episode.begins[:, 1], self.nominal.njoint
        differ = faults.push_noise * speeds[:, :, None] * np.eye(n) if faults.push_noise else None
        return loop_of_plant(plant.timestep, faults, np.full(n, faults.angle_noise), differ, wanted, lead)

    @property
    def given(self) -> dict[str, Any]:
        """What of an estimate follows from the study, by the names of its fields."""
        from metaid.estimation import BaseUnknowns

        return {"searched": BaseUnknowns(self.prior)}

    # What results are told by. A chain's problem answers to the same.

    faint, all_fell = "push more, or faster", "a push fell in every trial: begin nearer, or slower"
    far_off = "; with dry friction, or noise, no law comes so near"
    draws_episodes = False  # for a picture: bounds are too far away for what is between them
    noise_floor = None  # of the measure: none is subtracted
    tilts = 2  # axes about which a base may be tilted

    @cached_property
    def sought(self) -> Parameters:
        """The base parameters, which candidates are."""
        return base_parameters_of(self.prior)

    @property
    def estimated(self) -> Parameters:
        """The base parameters, which an estimate is of."""
        return self.sought

    @property
    def can_be_estimated(self) -> bool:
        """Whether the motion of its trials can be matched."""
        return self.spec.study.estimate.enabled

    def as_good_as(self, best: float) -> float:
        """The largest value that cannot be told from the `best` one."""
        return best + self.resolution

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which of the base parameters (nbase) the measure can find: all of them."""
        return np.ones(len(self.names), dtype=np.bool_)

    @property
    def slides(self) -> NDArray[np.bool_]:
        """Which joints are slides, and no hinges (njoint)."""
        return self.nominal.slides

    @property
    def push_titles(self) -> list[str]:
        """What the pushes of an episode are called (npush)."""
        stiffness = self.episode.springs.tolist()
        return [f"push {i + 1}: {'springs' if each else 'coast'}" for i, each in enumerate(stiffness)]

    @property
    def nominal_law(self) -> Array:
        """The nominal parameters (njoint x 13)."""
        return self.nominal.parameters

    def law_at(self, values: Mapping[str, float]) -> Array:
        """The parameters (njoint x 13) of the most probable arm with these `values` of the base parameters, by name."""
        return self.prior.parameters_at(np.array([values[name] for name in self.names]))

    def true_values(self, wanted: Parameters) -> Array:
        """The true base parameters (nbase); NaN where they are not known. Only results ask for them."""
        true, base = self.true_law(), self.prior.base
        return np.full(len(wanted.names), np.nan) if true is None else settled(base, base.of(true))

    def true_law(self) -> Array | None:
        """The true parameters (njoint x 13); None where they are not known. Only results ask for them."""
        return None if self.truth is None else self.truth.parameters

    def model_error(self, law: Any) -> ModelError | None:
        """How wrong a law is on states that no trial has seen; None where the truth is not known."""
        return None if self.truth is None else model_error(self.truth, law)

    def is_about(self, plant: Any) -> bool:
        """Whether this is the `plant` that is studied, to rounding."""
        one, other = self.spec.simulated, getattr(plant, "tree", None)
        if one is None or other is None:
            return False
        own = one.arm.tree
        pairs = (own.position, other.position), (own.parameters, other.parameters)
        return own.names == other.names and all(np.allclose(*pair, rtol=1e-6, atol=1e-12) for pair in pairs)
