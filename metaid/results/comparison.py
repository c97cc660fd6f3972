"""Several studies of the same plant beside one another: what each cost, and what it found of each lump."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from metaid.errors import StudyError
from metaid.frames import json_rows
from metaid.results.lump_tables import largest_error
from metaid.results.snapshot import Snapshot, counted_states, read_snapshot
from metaid.store import Store

FEWEST = 2  # studies of a comparison
STUDY = ["name", "plant", "sampler", "measure", "verdict", "reasons", "source"]  # the columns of a study
STUDY += ["trials", "pruned", "seconds", "misfit", "max_error"]


@dataclass(frozen=True)
class Comparison:
    """What was compared.

    Attributes:
        studies: one row a study: `name`, `plant`, `sampler`, `measure`, `verdict`, `reasons`, `source`, `trials`,
            `pruned`, `seconds` of motion that the trials took, `misfit`, `max_error`; NaN where not known.
        lumps: one row a lump and study, lumps in order: `name`, `study`, and what `metaid.lumps` has of it.
    """

    studies: pd.DataFrame
    lumps: pd.DataFrame

    def __repr__(self) -> str:
        return f"<Comparison of {', '.join(self.names)}>"

    @property
    def names(self) -> list[str]:
        """Of the studies."""
        return self.studies["name"].tolist()

    @property
    def lump_names(self) -> list[str]:
        """Of the lumps of all studies, in order."""
        return list(dict.fromkeys(self.lumps["name"]))

    @property
    def reference(self) -> pd.Series[float]:
        """By the name of each lump its true value; where the truth is not known what the first study found that knows
        it; NaN where none does.
        """
        column = "true" if self.knows_truth else "identified"
        return self.lumps.groupby("name", sort=False)[column].first().astype(np.float64)

    @property
    def knows_truth(self) -> bool:
        """Whether the true value of any lump is known."""
        return bool(self.lumps["true"].notna().any())

    def of(self, study: str) -> pd.DataFrame:
        """The lumps that one study looked for, by their name."""
        return self.lumps[self.lumps["study"] == study].set_index("name")

    def summary(self) -> dict[str, Any]:
        """What `metaid study compare --json` prints; None where something is not known."""
        return {"studies": json_rows(self.studies), "lumps": json_rows(self.lumps)}


def compare(store: Store, names: Sequence[str]) -> Comparison:
    """Compares studies in the DB.  Raises StorageError, and StudyError where they are not of the same plant."""
    if len(set(names)) < max(FEWEST, len(names)):
        raise StudyError(f"to compare: {', '.join(names) or 'nothing'} (allowed: {FEWEST} studies or more, each once)")
    snapshots = [read_snapshot(store, name) for name in names]
    _refuse_other_plants(snapshots)
    rows = [_study_row(snapshot) for snapshot in snapshots]
    tables = [snapshot.verdict.shown.assign(study=snapshot.name) for snapshot in snapshots]
    lumps = pd.concat(tables).sort_values("name", key=lambda names: pd.factorize(names)[0], kind="stable")
    studies = pd.DataFrame(rows, columns=STUDY).astype({"misfit": np.float64, "max_error": np.float64})
    return Comparison(studies, lumps.set_index(["name", "study"]).reset_index())


def _refuse_other_plants(snapshots: Sequence[Snapshot]) -> None:
    """Joints that differ make lumps that cannot be compared. The same plant may have other faults."""
    first = snapshots[0]
    for other in snapshots[1:]:
        if other.spec.joints != first.spec.joints:
            raise StudyError(
                f"study '{other.name}' is of the plant {other.spec.plant_name}, '{first.name}' of "
                f"{first.spec.plant_name}: only studies of plants with the same joints can be compared"
            )


def _study_row(snapshot: Snapshot) -> dict[str, Any]:
    counts = counted_states(snapshot.trials)
    return {
        **snapshot.head,
        "trials": counts["total"],
        "pruned": counts["pruned"],
        "seconds": sum(trial.outcome.steps for trial in snapshot.trials) * snapshot.spec.timestep,
        "max_error": largest_error(snapshot.verdict.lumps),
    }
