"""All that is known of a study, from one reading of the DB. Figures, the report and the dashboard draw from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from metaid.errors import StorageError, unknown
from metaid.models import Array
from metaid.results.arms import ArmFindings, ArmSnapshot, read_any_snapshot
from metaid.results.best import best_index, best_rows
from metaid.results.overview import summarized
from metaid.results.snapshot import Snapshot, read_snapshot
from metaid.results.tables import trials_table
from metaid.results.validation import Validation, validate_chain
from metaid.results.verdict import Verdict, judge
from metaid.store import Store
from metaid.study import Problem, StudySpec
from metaid.study.estimates import ChainFound

if TYPE_CHECKING:
    from metaid.compiled import Objective

CLOSEST = 50  # best survivors at least, for their correlation


@dataclass(frozen=True)
class Findings:
    """What follows from the `snapshot` of a study and the `verdict` on it: its `trials`, as `metaid.trials` has them,
    the `lumps` that it searched, as `metaid.lumps` has them, and its `summary`.
    """

    snapshot: Snapshot
    verdict: Verdict
    trials: pd.DataFrame
    lumps: pd.DataFrame
    summary: dict[str, Any]

    @property
    def name(self) -> str:
        return self.snapshot.name

    @property
    def spec(self) -> StudySpec:
        return self.snapshot.spec

    @property
    def problem(self) -> Problem:
        return self.snapshot.problem

    @property
    def estimate(self) -> ChainFound | None:
        """From all trials; None where nothing can be made of them."""
        return self.snapshot.estimate

    @property
    def names(self) -> list[str]:
        """The lumps' names, as the columns of `trials` have them."""
        return self.problem.names

    @property
    def known_lumps(self) -> pd.DataFrame:
        """The lumps that the study stands by: of an estimate all of them, those of inertia too."""
        return self.verdict.shown

    @cached_property
    def validation(self) -> Validation | None:
        """On new pushes and along a trajectory; None where nothing was found, or the plant is a rig."""
        if not self.verdict.has_result or not self.problem.is_simulated:
            return None
        return validate_chain(self.snapshot, self.verdict)

    @property
    def label(self) -> str:
        """The measure with its unit, for an axis."""
        unit = self.problem.measure.unit
        return "whole periods" if unit == "periods" else f"frequency, {unit}"

    @property
    def interval_name(self) -> str:
        """What `low` to `high` of the lumps is."""
        if self.verdict.source == "best trial" or self.estimate is None:
            return "range"
        return self.estimate.interval_name

    @property
    def survivors(self) -> pd.DataFrame:
        """Rows of trials that did not fall."""
        return self.trials.loc[self.trials["state"] == "COMPLETE"]

    @property
    def falls(self) -> pd.DataFrame:
        """Rows of trials that fell."""
        return self.trials.loc[self.trials["state"] == "PRUNED"]

    @property
    def true_factors(self) -> Array | None:
        """True ÷ nominal (nlump), or None where the plant does not know."""
        true: Array = (self.lumps["true"] / self.lumps["nominal"]).to_numpy()
        return None if np.isnan(true).any() else true

    @property
    def best_factors(self) -> Array:
        """Factors (nlump) of the best survivor.  Raises StorageError where there is none yet."""
        survivors = self.survivors
        if survivors.empty:
            raise StorageError(f"study '{self.name}' has no survivor yet, so there is nothing to show: run it first")
        best = best_index(survivors["value"].to_numpy())
        factors: Array = survivors[self.names].to_numpy(dtype=np.float64)[best]
        return factors

    @property
    def identified_factors(self) -> Array:
        """Factors (nlump) of the identified lumps; 1 where a lump is not identified.  Raises StorageError where there
        is no survivor yet.
        """
        _ = self.best_factors
        factor: Array = self.lumps["factor"].to_numpy()
        return np.where(np.isnan(factor), 1.0, factor)

    def errors(self, trials: pd.DataFrame) -> Array:
        """The largest error of an identified lump in each of `trials` (ntrial), relative to the truth; NaN where the
        plant does not know it, or no lump is identified.
        """
        true = (self.lumps["true"] / self.lumps["nominal"]).to_numpy()
        identified = self.lumps["identified"].notna().to_numpy()
        if not identified.any():
            return np.full(len(trials), np.nan)
        errors: Array = np.abs(trials[self.names].to_numpy() / true - 1.0)[:, identified].max(axis=1, initial=0.0)
        return errors

    @property
    def bests(self) -> pd.DataFrame:
        """Survivors that were the best when they came; the last of them is the best of all."""
        survivors = self.survivors
        bests: pd.DataFrame = survivors[survivors["value"] <= survivors["value"].cummin()]
        return bests

    @property
    def equals(self) -> pd.DataFrame:
        """Survivors that the measure cannot tell from the best one; their range is `low` to `high`."""
        survivors = self.survivors
        equal: pd.DataFrame = survivors[survivors["value"] <= self.problem.as_good_as(survivors["value"].min())]
        return equal

    @property
    def closest(self) -> pd.DataFrame:
        """The `equals`, or the CLOSEST best survivors if those are more."""
        return best_rows(self.survivors, max(len(self.equals), CLOSEST))

    def objective(self) -> Objective:
        """What the study evaluated its candidates with."""
        return self.problem.make_objective()

    def index(self, lump: str) -> int:
        """Where a lump stands.  Raises StorageError, naming the allowed ones."""
        if lump not in self.names:
            raise StorageError(unknown("lump", lump, self.names))
        return self.names.index(lump)


def read_findings(store: Store, name: str) -> Findings:
    """The findings of a study in the DB.  Raises StorageError."""
    return findings_of(read_snapshot(store, name))


def read_any_findings(store: Store, name: str) -> Findings | ArmFindings:
    """The same of a study of a chain or of an arm."""
    snapshot = read_any_snapshot(store, name)
    return ArmFindings(snapshot) if isinstance(snapshot, ArmSnapshot) else findings_of(snapshot)


def findings_of(snapshot: Snapshot) -> Findings:
    """The findings of a study that has been read."""
    verdict = judge(snapshot)
    searched = verdict.shown[verdict.shown["name"].isin(snapshot.problem.names)].reset_index(drop=True)
    return Findings(snapshot, verdict, trials_table(snapshot), searched, summarized(snapshot, verdict))
