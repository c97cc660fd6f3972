"""The arm of a study: base parameters, which candidates are, and pushes that coast or swing as on springs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from metaid.episode import MEASURES, Episode, FallRule, KnownStarts, arm_episode, window_ends
from metaid.models import Array
from metaid.models.tree import ArmPrior, ModelError, Tree, model_error, seen_by_bias
from metaid.plant import ArmPlant, ArmSettings, FaultSettings, SocketPlant
from metaid.search import Coordinates, arm_sensitivity, prior_metric
from metaid.study.calibration import QUIETEST_RIG, calibrate_arm
from metaid.study.parameters import Parameters, base_parameters_of, settled
from metaid.study.spec import PushedSettings, StudySpec

if TYPE_CHECKING:
    from metaid.estimation import Experiment

FARTHEST = 10.0  # standard deviations of the prior: no base parameter beyond is tried


class StudiedArm:
    """A nominal arm, how candidates differ from it, and how it is pushed. What is not said here `StudiedChain` says."""

    draws_candidates = False  # for a picture: bounds are too far away for what is between them
    faint, gentler = "push more, or faster", "begin nearer, or slower, or let motors give more"
    all_fell = "a push fell in every trial: begin nearer, or slower"
    far_off = "; with dry friction, or noise, no law comes so near"
    measure = MEASURES["kinetic"]

    def __init__(self, spec: StudySpec) -> None:
        self.spec = spec
        self.nominal: Tree = spec.tree
        self.prior = ArmPrior(self.nominal, spec.study.estimate.prior, spec.counted_by, spec.tilts)
        self.differ_from = self.prior  # what candidates do
        self.names = list(self.prior.base.names)
        reach = FARTHEST * np.sqrt(np.diag(self.prior.covariance))
        self.start = self.prior.values
        self.low, self.high = self.start - reach, self.start + reach

    # How it is pushed.

    @cached_property
    def episode(self) -> Episode:
        """What is done to the arm with each candidate."""
        wanted, pushed = self.spec.study.episode, self.spec.pushed
        steps = max(round(wanted.horizon / self.spec.timestep), 2)
        return arm_episode(
            self.nominal,
            tuple(each.start for each in self.spec.starts),
            np.array([each.stiffness for each in self.spec.starts]),
            steps,
            fall_rule=FallRule(runaway=wanted.runaway),
            window_ends=window_ends(steps),
            seed=self.spec.study.seed,
            calibration=None if pushed is None else KnownStarts(np.stack([pushed.angles, pushed.speeds], axis=1)),
            lead=wanted.lead,
            readings_steps=steps if self.spec.keeps_readings else 0,
        )

    @property
    def starts(self) -> Array:
        """Joint coordinates and speeds (npush x 2 x njoint) with which the pushes begin."""
        return self.episode.begins

    @property
    def push_titles(self) -> list[str]:
        stiffness = self.episode.springs.tolist()
        return [f"push {i + 1}: {'springs' if each else 'coast'}" for i, each in enumerate(stiffness)]

    def calibrated(self, rig: SocketPlant) -> PushedSettings:
        return calibrate_arm(rig, self.nominal, [each.start for each in self.spec.starts])

    def plant(self) -> ArmPlant:
        name, plant = self.spec.plant_name, self.spec.simulated
        settings = ArmSettings(mjcf=name, **{key: value for key, value in plant if key != "arm"})
        return ArmPlant(name, settings, plant.arm.tree)

    def nominal_plant(self) -> ArmPlant:
        faults = self.spec.faults.without(self.spec.study.estimate.undeclared_faults)
        settings = ArmSettings(mjcf="nominal", timestep=self.spec.plant.timestep, faults=faults)
        return ArmPlant("nominal", settings, self.nominal)

    question = None  # about the units of the nominal arm

    # What candidates are.

    def candidate(self, factors: Mapping[str, float]) -> Array:
        """The candidate (nbase) with these `factors` of its nominal base parameters, 1 of those not named.  Raises
        EpisodeError where there is no such base parameter.
        """
        return self.prior.scaled(factors)

    def sensitivity(self, values: Array | None = None) -> Array:
        """H (nbase x nbase) of the measure, by the nominal arm, or by the mass matrix of one with these `values`
        (nbase).  Eq. 62.
        """
        return arm_sensitivity(self.prior, self.episode, self.spec.timestep, values)

    def metric(self, plain: Coordinates) -> Coordinates:
        """The metric of the measure in place of `plain` coordinates."""
        return prior_metric(self.sensitivity(), self.prior, plain)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which of the base parameters (nbase) the measure can find: all of them."""
        return np.ones(len(self.names), dtype=np.bool_)

    # What an estimate is of.

    @property
    def unknowns(self) -> Any:
        from metaid.estimation import BaseUnknowns

        return BaseUnknowns(self.prior)

    @property
    def laws(self) -> Any:
        from metaid.estimation import ArmLaws

        return ArmLaws(self.unknowns, self.episode)

    @property
    def stiffness(self) -> Array:
        """Of springs as on which pushes swing (npush), in 1/s²."""
        return self.episode.springs

    def resting_noise(self) -> Array:
        """The standard deviation of the readings of each joint (njoint) of the simulated plant at rest."""
        return np.full(self.nominal.njoint, self.spec.faults.angle_noise)

    def start_spread(self) -> Array | None:
        """A root of the covariance (npush x njoint x njoint) of the joint speeds with which pushes of the simulated
        plant begin about their means; None where pushes do not differ.
        """
        share = self.spec.faults.push_noise
        return share * self.starts[:, 1][:, :, None] * np.eye(self.nominal.njoint) if share else None

    def rehearsal(self, experiment: Experiment) -> tuple[Experiment, ArmPlant, Episode]:
        plant, episode = self.nominal_plant(), replace(self.episode, calibration=None)
        if not self.spec.is_simulated:
            noisy = plant.settings.model_copy(update={"faults": FaultSettings(angle_noise=QUIETEST_RIG)})
            plant = replace(plant, settings=noisy)
        return replace(experiment, starts=episode.begins), plant, episode

    def rehearsed(self, probes: int) -> list[Array]:
        """The candidates of a rehearsal: one trial under the law of the nominal arm."""
        return [self.prior.values]

    @property
    def shown_by(self) -> tuple[str, ...]:
        """By which pushes each base parameter is shown: coasts, or springs alone."""
        seen = seen_by_bias(self.nominal, self.prior.base)
        return tuple("coasts" if each else "springs" for each in seen)

    # What results are told by.

    @cached_property
    def sought(self) -> Parameters:
        """The base parameters, which candidates are."""
        return base_parameters_of(self.prior)

    @property
    def estimated(self) -> Parameters:
        """The base parameters, which an estimate is of."""
        return self.sought

    @property
    def slides(self) -> NDArray[np.bool_]:
        return self.nominal.slides

    def law_at(self, values: Mapping[str, float]) -> Array:
        """The parameters (njoint x 13) of the most probable arm with these `values` of the base parameters, by name."""
        return self.prior.parameters_at(np.array([values[name] for name in self.names]))

    @property
    def truth(self) -> Tree | None:
        """The true arm, where it is known. Only results ask for it."""
        plant = self.spec.simulated
        return None if plant is None or not plant.truth_known else plant.arm.tree

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
