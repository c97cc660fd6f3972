"""All that is known of a study of an arm, from one reading of the DB."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from metaid.models.tree import model_error
from metaid.results.arms.arm_snapshot import ArmSnapshot
from metaid.results.arms.arm_tables import arm_trials_table
from metaid.results.arms.arm_validation import validate_arm
from metaid.results.arms.arm_verdict import arm_summary, judge_arm
from metaid.results.validation import Validation
from metaid.results.verdict import Verdict
from metaid.study import ArmProblem, ArmSpec
from metaid.study.estimates import ArmFound


@dataclass(frozen=True)
class ArmFindings:
    """What follows from the `snapshot` of a study of an arm."""

    snapshot: ArmSnapshot

    @property
    def name(self) -> str:
        return self.snapshot.name

    @property
    def spec(self) -> ArmSpec:
        return self.snapshot.spec

    @property
    def problem(self) -> ArmProblem:
        return self.snapshot.problem

    @property
    def estimate(self) -> ArmFound | None:
        """From all trials; None where nothing can be made of them."""
        return self.snapshot.estimate

    @cached_property
    def verdict(self) -> Verdict:
        return judge_arm(self.snapshot)

    @property
    def lumps(self) -> pd.DataFrame:
        """The base parameters, as `metaid.lumps` has them; without numbers where nothing was found."""
        return self.verdict.shown

    @cached_property
    def summary(self) -> dict[str, Any]:
        """As `study show --json` prints it."""
        return arm_summary(self.snapshot, self.verdict)

    @cached_property
    def trials(self) -> pd.DataFrame:
        """As `metaid.trials` has them."""
        return arm_trials_table(self.snapshot)

    @property
    def label(self) -> str:
        """The measure with its unit, for an axis."""
        return f"frequency, {self.problem.measure.unit}"

    @property
    def survivors(self) -> pd.DataFrame:
        """Rows of trials in which no push fell."""
        return self.trials.loc[self.trials["state"] == "COMPLETE"]

    @property
    def falls(self) -> pd.DataFrame:
        """Rows of trials in which one did."""
        return self.trials.loc[self.trials["state"] == "PRUNED"]

    @property
    def bests(self) -> pd.DataFrame:
        """Survivors that were the best when they came; the last of them is the best of all."""
        survivors = self.survivors
        bests: pd.DataFrame = survivors[survivors["value"] <= survivors["value"].cummin()]
        return bests

    def model_errors(self, trials: pd.DataFrame) -> pd.DataFrame | None:
        """How wrong the arms of some `trials` are on states that no trial has seen, a column each for `gravity`,
        `coriolis` and `mass_matrix`, relative to the true arm; None where that is not known.
        """
        truth, prior = self.snapshot.truth, self.problem.prior
        if truth is None:
            return None
        values = trials[self.problem.names].to_numpy(dtype=np.float64)
        return pd.DataFrame([asdict(model_error(truth, law)) for law in prior.parameters_at(values)])

    @cached_property
    def nominal_error(self) -> dict[str, float] | None:
        """How wrong the nominal arm is on states that no trial has seen; None where the truth is not known."""
        truth = self.snapshot.truth
        return None if truth is None else asdict(model_error(truth, self.problem.nominal.parameters))

    @cached_property
    def validation(self) -> Validation | None:
        """On new pushes and along a trajectory; None where nothing was found."""
        return validate_arm(self.snapshot, self.verdict) if self.verdict.has_result else None
