"""One row of the trial table, and what is known of a trial that is none of metaid's."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime

from optuna.trial import TrialState

from metaid.episode import Outcome
from metaid.models import Array


@dataclass(frozen=True)
class Trial:
    """One row of the trial table; `factors` (nlump) of the lumps that are searched."""

    number: int
    generation: int
    factors: Array
    outcome: Outcome
    started: datetime | None = None
    completed: datetime | None = None

    @property
    def state(self) -> TrialState:
        """COMPLETE for a survivor, PRUNED for a fall, FAIL where it could not be evaluated."""
        if self.outcome.failure is not None:
            return TrialState.FAIL
        return TrialState.PRUNED if self.outcome.fell else TrialState.COMPLETE


@dataclass(frozen=True)
class ForeignTrial:
    """A trial of a study that metaid did not write: its `number` and the name of its `state` in Optuna's terms.

    Where `metaid.objective` evaluated it, it has the digest of the `experiment` that it is of and its `value`; and,
    where it carries windows or readings, it is a `Trial` itself, `shown`.
    """

    number: int
    state: str
    experiment: str | None = None
    value: float | None = None
    shown: Trial | None = field(default=None, compare=False)
