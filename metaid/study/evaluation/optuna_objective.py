"""A study as an objective that Optuna's own `optimize` can call, with any sampler and any pruner; and a sampler that
lets another one work in the nominal model's metric.
"""

from __future__ import annotations

import json
import math
import threading
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from optuna.distributions import FloatDistribution
from optuna.samplers import BaseSampler
from optuna.trial import TrialState

from metaid.errors import StudyError
from metaid.search import MetricSampler, candidate_space, tpe_for_metric
from metaid.store import EXPERIMENT, MOTION_KEYS, outcome_attributes, study_attributes
from metaid.study.create import optuna_spec
from metaid.study.loading import load_study, problem_of
from metaid.study.spec import StudySpec

MINIMIZES = [optuna.study.StudyDirection.MINIMIZE]


class OptunaObjective:
    """`study.optimize(objective, n_trials)`, from one thread or many.

    A trial suggests the factors. After each push it reports the measure's value of the pushes so far at the step that
    was reached, and is pruned where the pruner says so. A fall is pruned at the step that it survived to. The trial's
    user attributes are those of metaid's own trials: steps, periods, and of the first trials the motion that an
    estimate is made of. The Optuna study gets the attributes by which metaid knows its settings, unless it has them; so
    one in a DB can be shown by metaid, and be run on.

    Args:
        spec: the study's settings.

    Raises:
        StudyError: the plant is a rig that nobody has calibrated for this study.
    """

    def __init__(self, spec: StudySpec) -> None:
        self._problem = problem_of(spec)
        self._problem.check()
        if not spec.is_simulated and spec.pushed is None:
            raise StudyError(
                f"plant {spec.plant_name} is a rig, whose pushes are found when a study is created: "
                "create it, and name its storage here"
            )
        self._threads = threading.local()
        self._lock = threading.RLock()
        self._rig: Any = None
        self._with_motion: dict[str, int] = {}  # how many trials of each Optuna study carry their motion

    def __repr__(self) -> str:
        return f"<OptunaObjective of {self.spec.name}: factors={len(self._problem.names)}>"

    @property
    def spec(self) -> StudySpec:
        """The study's settings."""
        return self._problem.spec

    @property
    def space(self) -> dict[str, FloatDistribution]:
        """What is suggested, by name: for `study.ask(objective.space)`."""
        return candidate_space(self._problem.names, self._problem.low, self._problem.high)

    @property
    def start(self) -> dict[str, float]:
        """Where the study's own search begins: for `study.enqueue_trial(objective.start)`."""
        return dict(zip(self._problem.names, self._problem.robot.start.tolist(), strict=True))

    def __reduce__(self) -> tuple[type[OptunaObjective], tuple[StudySpec]]:
        return OptunaObjective, (self.spec,)

    def __call__(self, trial: optuna.trial.BaseTrial) -> float:
        """The measure's value of the candidate that a `trial` suggests.

        Raises:
            optuna.TrialPruned: it fell, or the pruner ended it.
            StudyError: the trial's study is metaid's with other settings, or does not minimise.
            LostPlant: a rig was lost in it.
        """
        study: optuna.Study | None = getattr(trial, "study", None)  # a FixedTrial has none
        if study is not None:
            self._adopt(study)
        factors = np.array([trial.suggest_float(name, each.low, each.high) for name, each in self.space.items()])
        reported = set[int]()  # a rig that was lost is pushed again from the first push on

        def goes_on(record: Any) -> bool:
            if (steps := int(np.sum(record.steps))) not in reported:
                reported.add(steps)
                trial.report(self._objective().value(record), steps)
            return not trial.should_prune()

        with nullcontext() if self.spec.is_simulated else self._lock:  # there is one rig
            outcome = self._objective().evaluate(factors, trial.number, goes_on)
        if study is not None and not self._keeps_motion(study):
            outcome = replace(outcome, windows=None, readings=None)
        attributes = {EXPERIMENT: json.dumps(self.spec.experiment), **outcome_attributes(outcome)}
        for key, text in attributes.items():
            trial.set_user_attr(key, json.loads(text))
        if outcome.steps not in reported:
            trial.report(math.nan if outcome.fell else outcome.value, outcome.steps)
        if outcome.fell or outcome.steps in reported:
            raise optuna.TrialPruned
        return float(outcome.value)

    def close(self) -> None:
        """Lets go of a rig."""
        if self._rig is not None:
            self._rig.close()

    def _objective(self) -> Any:
        """That of this thread, or of the one rig."""
        with self._lock:
            if not self._problem.spec.is_simulated:
                self._rig = self._rig or self._problem.make_objective()
                return self._rig
            if not hasattr(self._threads, "objective"):
                self._threads.objective = self._problem.make_objective()
            return self._threads.objective

    def _adopt(self, study: optuna.Study) -> None:
        """Tells an Optuna study what its trials are of, once.  Raises StudyError where it cannot be of that."""
        stored = optuna_spec(study)
        if stored is None:
            if study.directions != MINIMIZES:
                raise StudyError("the Optuna study does not minimise one value (allowed: direction='minimize')")
            spec = self.spec.model_dump_json()
            for key, value in study_attributes(spec, len(self._problem.spec.joints)).items():
                study.set_user_attr(key, value)
        elif stored.experiment != self.spec.experiment:
            raise StudyError(
                f"the Optuna study '{study.study_name}' is of other settings than '{self.spec.name}' "
                "(allowed: its own, as by metaid.objective(NAME, storage=...), or a new Optuna study)"
            )

    def _keeps_motion(self, study: optuna.Study) -> bool:
        """Whether the trial that has just been evaluated is one of the first, which carry their motion."""
        with self._lock:
            if study.study_name not in self._with_motion:
                finished = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.PRUNED))
                carry = [each for each in finished if EXPERIMENT in each.user_attrs]
                self._with_motion[study.study_name] = sum(
                    not each.user_attrs.keys().isdisjoint(MOTION_KEYS) for each in carry
                )
            kept = self._with_motion[study.study_name]
            if kept >= max(self._problem.trials_with_windows, self._problem.trials_with_readings):
                return False
            self._with_motion[study.study_name] = kept + 1
            return True


class NominalMetricSampler(MetricSampler):
    """Proposes factors for `metaid.objective(study)` in the coordinates of metaid's own samplers (Eq. 16).

    Args:
        study: a shipped name, the path of a study file, settings, or the objective itself.
        sampler: that works in the metric, as `TPESampler` or `CmaEsSampler`; default: multivariate TPE.
        seed: of the default sampler; another one has its own.

    Raises:
        StudyError: the study's pushes cannot tell all lumps apart, so that there is no metric.
    """

    def __init__(
        self,
        study: str | Path | StudySpec | OptunaObjective,
        sampler: BaseSampler | None = None,
        seed: int | None = None,
    ) -> None:
        if isinstance(study, OptunaObjective):
            study = study.spec
        problem = problem_of(load_study(study) if isinstance(study, str | Path) else study)
        super().__init__(problem.names, problem.metric, tpe_for_metric(seed) if sampler is None else sampler)
