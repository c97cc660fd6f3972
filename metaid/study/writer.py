"""Writes the last generation of a run to the study DB."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType

from metaid.errors import StorageError
from metaid.store import SERVER_PATIENCE, Lease, Store, Trial, keep_trying
from metaid.study.problem import Problem


class Writer:
    """A context manager that holds the `trials` of the last generation until `write` is called, or until its end.

    It writes at its end whatever ends it, an interrupt included, unless the DB itself has failed. It has no thread of
    its own: an error in writing ends the run at once.

    Args:
        store: the study DB.
        name: the study's.
        problem: of which the trials are.
        lease: by which this driver holds the study.
        patience: s without an answer of the DB's server after which the run ends; None for SERVER_PATIENCE.
        on_wait: called while the server does not answer, with the number of trials in the DB and what is waited for.
    """

    def __init__(
        self,
        store: Store,
        name: str,
        problem: Problem,
        lease: Lease,
        patience: float | None,
        on_wait: Callable[[int, str], None],
    ) -> None:
        self._store = store
        self._name = name
        self._problem = problem
        self._lease = lease
        self._patience = SERVER_PATIENCE if patience is None else patience
        self._on_wait = on_wait
        self._is_unreachable = False  # whether the server did not answer the last attempt
        self.trials: list[Trial] = []

    def write(self) -> None:
        """Writes what it holds, if anything, in one transaction; waits for a server that does not answer.

        Raises StorageError, also where another driver has taken the study.
        """
        if self.trials:
            before = self.trials[0].number
            go_on = f"{before} trials are in it; go on with: metaid study run {self._name}"
            keep_trying(self._append, self._patience, self._report_waiting, go_on)
            self._is_unreachable = False
            self.trials = []

    def _append(self) -> None:
        # A server that goes away in the middle of a commit may have written them all the same.
        if not self._is_unreachable or self._store.count(self._name) != self.trials[-1].number + 1:
            of = self._problem
            self._store.append(self._name, of.names, of.low, of.high, self.trials, write_check=self._lease.renew)

    def _report_waiting(self, reason: str) -> None:
        self._is_unreachable = True
        self._on_wait(self.trials[0].number, reason)

    def __enter__(self) -> Writer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, StorageError) or (error is not None and self._is_unreachable):
            return
        # An interrupt may come just after the transaction that wrote them.
        if error is None or (self.trials and self._store.count(self._name) == self.trials[0].number):
            self.write()
