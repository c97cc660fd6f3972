"""metaid on a rig, for so many seconds of motion: pushes under the law of a candidate, without a sensor of torques."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.chains import Links
from benchmarks.rivals.conditions import Condition
from benchmarks.rivals.judging import Found
from metaid.compiled import Objective
from metaid.episode import Outcome
from metaid.estimation import Estimate, Experiment, ReadTrial
from metaid.models import Array, Lumps, compensation_basis
from metaid.results import identified_factors
from metaid.search import make_searcher
from metaid.study import Problem, StudySettings, StudySpec
from metaid.study.estimates import estimate_of

SEARCHED = {"friction": "viscous", "tilt": "tilt", "delay": "delay", "offset": "offset"}  # as a study has them
# Of `output-error`: there are more pushes in a trial where there is more time, and fewer where there is little. One law
# alone says little of what it compensates, so two trials of a push each say more than one of two.
FEWEST_TRIALS, MOST_TRIALS = 2, 4


def trials_of(pushes: int, nlink: int) -> int:
    """How many trials of `output-error` so many pushes are: two for each link in each, or two trials of fewer."""
    return min(int(np.clip(pushes // (2 * nlink), FEWEST_TRIALS, MOST_TRIALS)), pushes)


@dataclass(frozen=True)
class Tried:
    """A law, by its `factors` (nlump) of the nominal lumps, and what became of it."""

    factors: Array
    outcome: Outcome


class Rig:
    """A chain that is pushed, by a study with this `sampler` for so many `seconds` of motion."""

    def __init__(
        self, true: Links, nominal: Links, condition: Condition, sampler: str, seconds: float, seed: int
    ) -> None:
        self.condition, self.seconds = condition, seconds
        plant = condition.plant(true)
        settings = {"plant": "rig", "nominal": "believed", "sampler": sampler, "trials": 100_000, "seed": seed}
        faults = tuple(SEARCHED[name] for name in condition.searched) or ("proposed" if condition.has_unknown else ())
        estimate = {"faults": faults}
        episode = {"measure": "spectral" if condition.is_exact else "smoothed"}

        def spec(**further: Any) -> StudySpec:
            whole = settings | {"episode": episode, "estimate": estimate} | further
            study = StudySettings.model_validate(whole)
            return StudySpec(name="rig", plant_name="rig", plant=plant, nominal=nominal, study=study)

        self.spec = spec()
        if sampler == "output-error":
            one = spec(episode={**episode, "count": 1})
            pushes = max(round(seconds / plant.timestep) // Problem(one).episode.steps, 1)
            trials = trials_of(pushes, len(nominal))
            self.spec = spec(trials=trials, episode={**episode, "count": pushes // trials})
        self.problem = Problem(self.spec)
        self.objective = self.problem.make_objective()

    def experiment(self) -> Experiment | None:
        """What the estimate knows: not that torques are late, unless it finds that by itself."""
        known = self.problem.experiment()
        return known if known is None or known.loop is None else replace(known, loop=replace(known.loop, delay=0))

    def run(self) -> list[Tried]:
        """All trials of the study for which there is time."""
        study, problem = self.spec.study, self.problem
        searcher = make_searcher(study.sampler, problem.coordinates, study.seed, study.search, self.experiment)
        tried: list[Tried] = []
        left = round(self.seconds / problem.timestep)
        each = problem.episode.total_steps
        # One that is sure that another trial tells no more has it nevertheless: all have the same time.
        while len(tried) < study.trials and (left >= each or not tried):
            if self.condition.is_exact and searcher.finished():
                break
            batch = searcher.ask()[: max(left // each, 1)]
            outcomes = [self.objective.evaluate(factors, len(tried) + i) for i, factors in enumerate(batch)]
            tried += [Tried(*pair) for pair in zip(batch, outcomes, strict=True)]
            left -= sum(outcome.steps for outcome in outcomes)
            if left >= each:  # of a generation there may be time for a part alone
                searcher.tell(outcomes)
        return tried

    def found(self, lumps: Lumps, inertia: Array, tried: list[Tried], verdict: str) -> Found:
        """What was found by these trials."""
        problem, kinds = self.problem, ("gravity", "coriolis")
        seconds = sum(each.outcome.steps for each in tried) * problem.timestep
        return Found(np.append(lumps.vector_of(kinds), inertia), seconds, *self._strain(tried), verdict)

    def _strain(self, tried: list[Tried]) -> tuple[float, float]:
        """The largest joint torque in N m, and range of an angle in rad, of the first trial and of the last that is
        kept.
        """
        experiment, torque, moved = self.experiment(), 0.0, np.zeros((2, len(self.spec.joints)))
        kept = [number for number, each in enumerate(tried) if each.outcome.readings or each.outcome.windows]
        for number in {kept[0], kept[-1]} if kept else ():
            each = tried[number]
            trial = experiment.trial(each.factors, each.outcome) if experiment else None
            if isinstance(trial, ReadTrial):
                angles, torques = trial.readings, trial.torques
            else:
                angles, torques = self._watched(each, number)
            torque = max(torque, float(np.abs(torques).max()))
            every = angles.reshape(-1, angles.shape[-1])
            moved = np.stack([np.minimum(moved[0], every.min(axis=0)), np.maximum(moved[1], every.max(axis=0))])
        return torque, float(np.ptp(moved, axis=0).max())

    def _watched(self, tried: Tried, number: int) -> tuple[Array, Array]:
        """Joint angles in rad, and the torques in N m that the law made of them, (nstep x njoint) each, of a trial of
        an ideal rig.
        """
        problem = self.problem
        watched = replace(problem.episode, keep_angles=True)
        objective = Objective(problem.make_plant(), problem.chain.lumps, watched, problem.measure.name)
        pushes = objective.record(tried.factors, number).angles
        absolute = np.concatenate([np.cumsum(push[1:], axis=1) for push in pushes])
        speeds = np.concatenate([np.cumsum(np.diff(push, axis=0), axis=1) for push in pushes]) / problem.timestep
        forces = compensation_basis(absolute, speeds, problem.spec.gravity) @ (
            problem.chain.lumps.vector * tried.factors
        )
        return np.concatenate(pushes), np.cumsum(forces[:, ::-1], axis=1)


def output_error(true: Links, nominal: Links, condition: Condition, seconds: float, seed: int) -> Found:
    """What metaid's estimate is of all pushes, and whether it says that it has found it."""
    rig = Rig(true, nominal, condition, "output-error", seconds, seed)
    tried = rig.run()
    experiment = rig.experiment()
    assert experiment is not None
    trials = tuple(t for each in tried if (t := experiment.trial(each.factors, each.outcome)) is not None)
    found = estimate_of(experiment, trials, is_probed=True)
    if found is None:
        return rig.found(rig.problem.nominal.lumps, rig.problem.nominal.inertia_lumps, tried, "not found")
    assert isinstance(found.estimate, Estimate)
    lumps = found.estimate.lumps
    return rig.found(lumps, lumps.of("inertia"), tried, "found" if found.explains else "not found")


def best_trial(true: Links, nominal: Links, condition: Condition, seconds: float, seed: int) -> Found:
    """What the minimiser `cmaes` has found by itself, without an estimate. It finds no inertia lumps: those of the
    nominal chain are scaled as the gravity lumps are.
    """
    rig = Rig(true, nominal, condition, "cmaes", seconds, seed)
    tried = rig.run()
    standing = [each for each in tried if not each.outcome.fell]
    factors = np.ones(len(rig.problem.names))
    if standing:
        values = np.array([each.outcome.value for each in standing])
        factors = identified_factors(rig.problem, np.array([each.factors for each in standing]), values)
    lumps = rig.problem.chain.lumps.scaled(factors)
    inertia = rig.problem.nominal.inertia_lumps * lumps.gravity / rig.problem.nominal.lumps.gravity
    return rig.found(lumps, inertia, tried, "")
