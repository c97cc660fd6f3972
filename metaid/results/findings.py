"""All that is known of a study, from one reading of the DB. Figures, the report and the dashboard draw from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from metaid.errors import StorageError, unknown
from metaid.models import Array
from metaid.results.best import best_rows
from metaid.results.candidates import law_error
from metaid.results.overview import summarized
from metaid.results.snapshot import Snapshot, read_snapshot, trials_table
from metaid.results.validation import Validation, validate
from metaid.results.verdict import Verdict
from metaid.store import Store
from metaid.study import Parameters, Problem, StudySpec
from metaid.study.estimates import StudyEstimate

CLOSEST = 50  # best survivors at least, for their correlation
MODEL_ERRORS = {"gravity": "gravity torque", "coriolis": "Coriolis torque", "mass_matrix": "mass matrix"}


@dataclass(frozen=True)
class Findings:
    """What follows from the `snapshot` of a study: its `trials`, as `metaid.trials` has them,
    the `lumps` that it searched, as `metaid.lumps` has them, and its `summary`. Of an arm lumps are base parameters,
    and candidates are these and not factors.
    """

    snapshot: Snapshot
    trials: pd.DataFrame
    lumps: pd.DataFrame
    summary: dict[str, Any]

    def __repr__(self) -> str:
        return f"<Findings of {self.name}: trials={len(self.trials)}, {self.verdict.word}>"

    @property
    def name(self) -> str:
        return self.snapshot.name

    @property
    def verdict(self) -> Verdict:
        return self.snapshot.verdict

    @property
    def spec(self) -> StudySpec:
        return self.snapshot.spec

    @property
    def problem(self) -> Problem:
        return self.snapshot.problem

    @property
    def estimate(self) -> StudyEstimate | None:
        """From all trials; None where nothing can be made of them."""
        return self.snapshot.estimate

    @property
    def sought(self) -> Parameters:
        """What was searched."""
        return self.problem.robot.sought

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
        if not self.verdict.has_result or not self.problem.spec.is_simulated:
            return None
        return validate(self.snapshot)

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
        """The candidate (nlump) that is true, or None where the plant does not know."""
        true: Array = self.lumps["true"].to_numpy() / self.sought.scale
        return None if np.isnan(true).any() else true

    @property
    def best_factors(self) -> Array:
        """The candidate (nlump) of the best survivor.  Raises StorageError where there is none yet."""
        best = self.snapshot.best
        if best is None:
            raise StorageError(f"study '{self.name}' has no survivor yet, so there is nothing to show: run it first")
        return best.factors

    @property
    def identified_factors(self) -> Array:
        """The candidate (nlump) that is identified; the nominal one where a lump is not.  Raises StorageError where
        there is no survivor yet.
        """
        _ = self.best_factors
        return self.lumps["identified"].fillna(self.lumps["nominal"]).to_numpy() / self.sought.scale

    def drawn(self, factors: Array) -> Array:
        """Candidates (... x nlump) as figures show them."""
        return (factors - self.sought.origin) / self.sought.step

    def drawn_rows(self, trials: pd.DataFrame) -> pd.DataFrame:
        """Some `trials` with candidates as figures show them."""
        shown = self.drawn(trials[self.names].to_numpy(dtype=np.float64))
        return trials.assign(**dict(zip(self.names, shown.T, strict=True)))

    def errors(self, trials: pd.DataFrame) -> Array:
        """The largest error of an identified lump in each of `trials` (ntrial), relative to the truth; NaN where the
        plant does not know it, or no lump is identified.
        """
        true = self.lumps["true"].to_numpy() / self.sought.scale
        identified = self.lumps["identified"].notna().to_numpy()
        if not identified.any():
            return np.full(len(trials), np.nan)
        errors: Array = np.abs(trials[self.names].to_numpy() / true - 1.0)[:, identified].max(axis=1, initial=0.0)
        return errors

    def error_curves(self, trials: pd.DataFrame) -> Mapping[str, Array]:
        """How wrong each of some `trials` is (ntrial), by what it is that is wrong: the largest error of a lump, or
        parts of the dynamics on states that no trial has seen; nothing where that is not known.
        """
        laws = map(self.problem.robot.differ_from.law_of, trials[self.names].to_numpy(dtype=np.float64))
        found = [error for law in laws if (error := law_error(self.problem, law)) is not None]
        if found:
            return {name: np.array([error[key] for error in found]) for key, name in MODEL_ERRORS.items()}
        if self.true_factors is None or np.isnan(errors := self.errors(trials)).all():
            return {}
        return {"largest lump error": errors}

    @cached_property
    def nominal_error(self) -> dict[str, float] | None:
        """How wrong the nominal law is on states that no trial has seen; None where that is not known."""
        return law_error(self.problem, self.problem.robot.differ_from.law)

    @property
    def bests(self) -> pd.DataFrame:
        """Survivors that were the best when they came; the last of them is the best of all."""
        survivors = self.survivors
        return survivors[survivors["value"] <= survivors["value"].cummin()]

    @property
    def equals(self) -> pd.DataFrame:
        """Survivors that the measure cannot tell from the best one; their range is `low` to `high`."""
        survivors = self.survivors
        return survivors[survivors["value"] <= self.problem.as_good_as(survivors["value"].min())]

    @property
    def closest(self) -> pd.DataFrame:
        """The `equals`, or the CLOSEST best survivors if those are more."""
        return best_rows(self.survivors, max(len(self.equals), CLOSEST))

    def index(self, lump: str) -> int:
        """Where a lump stands.  Raises StorageError, naming the allowed ones."""
        if lump not in self.names:
            raise StorageError(unknown(self.sought.noun, lump, self.names))
        return self.names.index(lump)


def read_findings(store: Store, name: str) -> Findings:
    """The findings of a study in the DB.  Raises StorageError."""
    snapshot = read_snapshot(store, name)
    shown = snapshot.verdict.shown.set_index("name")
    searched = shown.reindex(snapshot.problem.names).rename_axis("name").reset_index()
    known = searched.assign(determined=searched["determined"].eq(True))  # an estimate may be of fewer than the search
    return Findings(snapshot, trials_table(snapshot), known, summarized(snapshot))
