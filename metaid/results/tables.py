"""What a study found, as pandas frames."""

from __future__ import annotations

import numpy as np
import pandas as pd

from metaid.errors import StudyError
from metaid.results.lump_tables import estimate_table, largest_error
from metaid.results.overview import fault_rows
from metaid.results.snapshot import Snapshot, counted_states, read_snapshot, trials_table
from metaid.store import Store


def trials_frame(store: Store, name: str) -> pd.DataFrame:
    """One row a trial: `number`, `state`, `value` (NaN where it failed), `generation`, `steps`, `periods_i`,
    then a factor per lump, under its name. Of an arm there are no periods, and base parameters in SI units in place of
    factors.
    """
    return trials_table(read_snapshot(store, name))


def lumps_frame(store: Store, name: str) -> pd.DataFrame:
    """One row a lump: `name`, `unit`, `nominal`, `factor`, `identified`, `sd`, `low`, `high`, `true`,
    `error`, `determined`; NaN where not known. `determined` says whether a lump is known to a tenth. There are no
    intervals where the verdict is `not found`: then values are those of the last estimate, or the best trial. `sd`, a
    standard deviation, and `low` to `high` as a 95 % interval are of an estimate; of a best trial `low` to `high` is
    the range of what cannot be told from it. The frame's `attrs` are the `verdict`, its `reasons`, the `source` of the
    lumps, and, where a study searches or takes up faults, these as `faults`, a row each as `study show --json` has it.
    Of an arm a row is a base parameter, with its `expression`.
    """
    snapshot = read_snapshot(store, name)
    verdict = snapshot.verdict
    verdict.lumps.attrs |= fault_rows(snapshot)
    verdict.lumps.attrs |= {"verdict": verdict.word, "reasons": list(verdict.reasons), "source": verdict.source}
    return verdict.lumps


def estimate_frame(snapshot: Snapshot) -> pd.DataFrame:
    """One row a lump of the estimate from all trials of a study, whichever sampler proposed them, as `lumps_frame` has
    them; without intervals where the model does not explain what was seen.  Raises StudyError where no estimate can be
    made.
    """
    if snapshot.estimate is None:
        raise StudyError(f"study '{snapshot.name}' has no estimate: {snapshot.why_no_estimate}")
    return estimate_table(snapshot, snapshot.estimate.explains)


def studies_frame(store: Store) -> pd.DataFrame:
    """One row a study: `name`, `plant`, `sampler`, `measure`, `verdict`, `trials`, `pruned`, `best`, `max_error`."""
    words = {"name": str, "plant": str, "sampler": str, "measure": str, "verdict": str}
    kinds = {**words, "trials": np.int64, "pruned": np.int64, "best": np.float64, "max_error": np.float64}
    rows = [_study_row(store, name) for name in store.names()]
    return pd.DataFrame(rows, columns=list(kinds)).astype(kinds)


def _study_row(store: Store, name: str) -> dict[str, object]:
    snapshot = read_snapshot(store, name)
    spec, counts, best = snapshot.spec, counted_states(snapshot.trials), snapshot.best
    known = {"trials": counts["total"], "pruned": counts["pruned"]}
    try:
        snapshot.problem.check()
    except StudyError:  # too large to be computed: the others are listed all the same, and `show` says why
        head = {"name": name, "plant": spec.plant_name, "sampler": spec.study.sampler, "measure": spec.measure}
        return {**head, **known, "verdict": ""}
    error = largest_error(snapshot.verdict.lumps)
    return {**snapshot.head, **known, "best": best and best.outcome.value, "max_error": error}
