"""The planar chain of a study: lumps, which candidates are factors of, and pushes that strike the tips of its links."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from metaid.episode import Episode, pushed_speeds, pushes_for
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
from metaid.plant import MujocoPlant, PlantSettings, SocketPlant, SocketSettings, Start, chain_of
from metaid.search import Coordinates, nominal_metric, sensitivity
from metaid.study.calibration import calibrate_chain, calibration_of
from metaid.study.contradictions import check_chain, measure_of, search_bounds
from metaid.study.parameters import Parameters, lumps_of
from metaid.study.pushing import make_episode, refuse_unseen_pushes, rest_deviations, rest_noise
from metaid.study.spec import PushedSettings, StudySpec

if TYPE_CHECKING:
    from metaid.estimation import Experiment
    from metaid.models.tree import ModelError

# Factors of the gravity lumps in the first trials of an estimate, as many as it needs; those of others are between.
OVER_COMPENSATED = (1.5, 2.0)


class StudiedChain:
    """A nominal chain, how candidates differ from it, and how it is pushed."""

    draws_candidates = True  # a picture of candidates within the bounds shows something
    faint, gentler = "push more, or harder", "push less (episode.peak_speed), or let motors give more"
    all_fell, far_off = "no trial survived: raise search.high, or start higher", ""

    def __init__(self, spec: StudySpec) -> None:
        self.spec = spec
        self.nominal: Chain = chain_of(spec.links)
        self.measure = measure_of(spec.study.episode)
        check_chain(spec, self.nominal)
        njoint = spec.plant.joints if isinstance(spec.plant, SocketSettings) else self.plant().njoint
        if njoint != self.nominal.nlink:
            raise StudyError(
                f"plant {spec.plant_name} has {njoint} links, the nominal model {self.nominal.nlink}: they must agree"
            )
        refuse_impossible("nominal model", self.nominal)
        self.lumps: Lumps = self.nominal.lumps_of(spec.study.search.lumps)  # what candidates' factors are of
        self.differ_from, self.names = self.lumps, self.lumps.names
        self.start, self.low, self.high = search_bounds(spec)

    # How it is pushed.

    @property
    def episode(self) -> Episode:
        """What is done to the plant with each candidate.  Raises StudyError where settings contradict themselves."""
        return self._pushed[0]

    @property
    def start_speeds(self) -> Array:
        """Absolute link speeds (npush x nlink) right after the pushes, in rad/s."""
        return self._pushed[1]

    @property
    def starts(self) -> Array:
        """Joint angles in rad and speeds in rad/s (npush x 2 x njoint) with which the pushes begin."""
        from metaid.estimation import upright

        return upright(np.diff(self.start_speeds, axis=1, prepend=0.0))

    @property
    def push_titles(self) -> list[str]:
        """What the pushes of an episode are called (npush)."""
        return [f"push {push + 1}" for push in range(len(self.episode.pushes))]

    @cached_property
    def _pushed(self) -> tuple[Episode, Array]:
        """Of a rig what was found at it when the study was created; before that, the nominal model's."""
        spec, pushed = self.spec, self.spec.pushed
        moved = self.plant() if spec.is_simulated else self.nominal_plant()
        try:
            episode = make_episode(moved, spec, self.nominal)
            if pushed is None:
                speeds = pushed_speeds(moved, episode.pushes)
            else:
                speeds = np.cumsum(pushed.speeds, axis=1)
                known = calibration_of(spec, pushed, self.nominal)
                episode = replace(episode, pushes=np.array(pushed.impulses), calibration=known)
        except EpisodeError as problem:
            raise StudyError(f"episode: {problem}") from None
        refuse_unseen_pushes(speeds, spec.plant.timestep)
        if self.measure.is_noisy and spec.is_simulated:
            episode = replace(episode, noise_floor=rest_noise(moved, spec, episode, speeds))
        return episode, speeds

    def calibrated(self, rig: SocketPlant) -> PushedSettings:
        """What is measured at the `rig` of the study."""
        pushes = make_episode(rig, self.spec, self.nominal).pushes
        return calibrate_chain(rig, self.nominal, pushes, self.spec.study.episode.repeats)

    def plant(self) -> MujocoPlant:
        """The simulated plant of the study."""
        return MujocoPlant(self.spec.plant_name, self.spec.simulated)

    def nominal_plant(self) -> MujocoPlant:
        """The nominal model as a plant, with the faults of the plant file but for those that are searched."""
        spec = self.spec
        if spec.simulated is not None:
            faults = spec.faults.without(spec.study.estimate.undeclared_faults)
            return MujocoPlant("nominal", spec.simulated.model_copy(update={"links": spec.links, "faults": faults}))
        return MujocoPlant("nominal", PlantSettings(gravity=spec.gravity, timestep=spec.timestep, links=spec.links))

    @property
    def question(self) -> str | None:
        """What to ask about the units of the nominal model; None if nothing."""
        return question_of_units("the nominal model", self.nominal, self.spec.gravity)

    # What candidates are.

    def candidate(self, factors: Mapping[str, float]) -> Array:
        """The candidate (nlump) with these `factors` of its nominal lumps, 1 of those not named.  Raises EpisodeError
        where there is no such lump.
        """
        return factors_from_names(dict(factors), self.nominal.nlink, kinds=self.lumps.searched)

    def sensitivity(self) -> Array:
        """H (nlump x nlump) of the lumps and pushes, by the nominal model.  Eq. 15."""
        horizon = self.episode.steps * self.spec.timestep
        return sensitivity(self.nominal, self.spec.gravity, self.start_speeds, horizon, self.lumps.searched)

    def metric(self, plain: Coordinates) -> Coordinates:
        """The nominal metric in place of `plain` coordinates.  Raises StudyError where it does not exist."""
        try:
            metric = nominal_metric(self.sensitivity(), plain)
        except EpisodeError as problem:
            raise StudyError(f"search: coordinates: {problem}") from None
        return metric if self.measure.name == "spectral" else replace(metric, curvature=None)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which of the lumps that are sought (nlump) the measure can find."""
        return self.measure.determined(self.lumps)

    # What an estimate is of.

    @property
    def estimated_kinds(self) -> tuple[str, ...]:
        """The kinds of lumps that an estimate is of."""
        study = self.spec.study
        if study.estimate.lumps is not None:
            return study.estimate.lumps
        return (*IDEAL, "inertia", *(kind for kind in study.search.lumps if kind in FRICTION))

    @property
    def unknowns(self) -> Any:
        """What an estimate is of."""
        from metaid.estimation import LogUnknowns

        wanted, kinds = self.spec.study.estimate, self.estimated_kinds
        lengths = self.nominal.length if wanted.lengths == "exact" else None
        return LogUnknowns(self.nominal.lumps_of(kinds), self.spec.gravity, kinds, lengths, wanted.spread)

    @property
    def laws(self) -> Any:
        """The laws that trials are sent, as an estimate has them."""
        from metaid.estimation import ChainLaws

        return ChainLaws(self.lumps, self.spec.gravity)

    stiffness = 0.0  # of springs as on which pushes swing, in 1/s²

    def resting_noise(self) -> Array:
        """The standard deviation of the readings of each joint (njoint) of the simulated plant at rest, in rad."""
        return rest_deviations(self.plant(), self.spec, self.episode)

    def start_spread(self) -> Array | None:
        """A root of the covariance (npush x njoint x njoint) of the joint speeds, in rad/s, that the pushes give the
        simulated plant about their means; None where pushes do not differ.
        """
        return _spread_of_pushes(self.plant(), self.episode.pushes)

    def rehearsal(self, experiment: Experiment) -> tuple[Experiment, MujocoPlant, Episode]:
        """The `experiment` of the study, the plant and the episode if its nominal model were the truth, pushed to the
        study's start speeds: impulses that differ give it other speeds than the plant.
        """
        plant = self.nominal_plant()
        pushes = pushes_for(plant, self.start_speeds)
        if experiment.loop is not None and self.spec.is_simulated:
            spread = _spread_of_pushes(plant, pushes)
            experiment = replace(experiment, loop=replace(experiment.loop, start_spread=spread))
        return experiment, plant, replace(self.episode, calibration=None, pushes=pushes)

    def rehearsed(self, probes: int) -> Array:
        """The candidates (ntrial x nlump) of a rehearsal: as many `probes` as an estimate needs, and the truth. No
        count is shown by a plant that coasts.
        """
        nlink, random = self.nominal.nlink, np.random.default_rng(self.spec.study.seed)
        laws = np.ones((probes + 1, len(self.names)))
        for law, factor in enumerate(OVER_COMPENSATED[:probes]):
            laws[law, :nlink] = factor
        laws[len(OVER_COMPENSATED) : -1, :nlink] = random.uniform(*OVER_COMPENSATED, laws[2:-1, :nlink].shape)
        return laws[:-1] if self.spec.study.estimate.compare == "count" else laws

    shown_by = None  # by which pushes each lump is shown: by all

    # What results are told by.

    @cached_property
    def sought(self) -> Parameters:
        """The lumps that candidates are factors of."""
        return lumps_of(self.nominal, self.lumps.searched)

    @cached_property
    def estimated(self) -> Parameters:
        """The lumps that an estimate is of."""
        return lumps_of(self.nominal, self.estimated_kinds)

    @property
    def slides(self) -> NDArray[np.bool_]:
        """Which joints are slides, and no hinges (njoint)."""
        return np.zeros(self.nominal.nlink, dtype=np.bool_)

    def law_at(self, values: Mapping[str, float]) -> Lumps:
        """The law with these `values` of lumps, by name. Gravity and Coriolis lumps that have none are as nominal,
        inertia lumps and friction that have none are left out.
        """
        kinds = tuple(dict.fromkeys((*IDEAL, *map(kind_of, values))))
        usual = self.nominal.lumps_of(kinds)
        vector = [values.get(name, value) for name, value in zip(usual.names, usual.vector.tolist(), strict=True)]
        law = usual.with_parameters(np.array(vector))
        if "inertia" not in kinds:
            law = replace(law, inertia=None)
        return replace(law, searched=tuple(kind for kind in kinds if kind != "inertia"))

    @property
    def truth(self) -> Chain | None:
        """The true chain, where it is known. Only results ask for it."""
        plant = self.spec.simulated
        return None if plant is None or not plant.truth_known else chain_of(plant.links)

    def true_values(self, wanted: Parameters) -> Array:
        """The true values (n) of what is `wanted`; NaN where they are not known. Only results ask for them."""
        truth = self.true_law()
        kinds = tuple(dict.fromkeys(map(kind_of, wanted.names)))
        return np.full(len(wanted.names), np.nan) if truth is None else truth.vector_of(kinds, np.nan)

    def true_law(self) -> Lumps | None:
        """The law with the true lumps; None where they are not known. Only results ask for it."""
        return self.plant().true_lumps() if self.spec.is_simulated else None

    def model_error(self, law: Any) -> ModelError | None:
        """How wrong a law is on states that no trial has seen: of a chain the errors of its lumps say so."""
        return None

    def is_about(self, plant: Any) -> bool:
        """Whether this is the `plant` that is studied."""
        return isinstance(plant, MujocoPlant) and plant.settings == self.spec.plant


def _spread_of_pushes(plant: MujocoPlant, pushes: Array) -> Array | None:
    """A root of the covariance (npush x njoint x njoint) of the joint speeds, in rad/s, that `pushes` (npush x njoint),
    in N s, give a plant about their means; None where pushes do not differ.
    """
    if not plant.settings.faults.push_noise:
        return None
    response = np.array([plant.start_speeds(Start.upright(impulse)) for impulse in np.eye(plant.njoint)]).T
    return np.asarray(response * (plant.settings.faults.push_noise * pushes[:, None]), dtype=np.float64)
