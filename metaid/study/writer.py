"""Writes the last generation of a run to the study DB."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType

from metaid.errors import StorageError, UnreachableError
from metaid.store import Lease, Trial
from metaid.study.problem import Problem

SERVER_PATIENCE = 300.0  # s without an answer of the DB's server after which it is given up, as when it is restarted
PAUSE = 1.0  # s between attempts


class Writer:
    """A context manager that holds the `trials` of the last generation until `write` is called, or until its end.

    It writes at its end whatever ends it, an interrupt included, unless the DB itself has failed. It has no thread of
    its own: an error in writing ends the run at once.

    Args:
        lease: by which this driver holds the study.
        problem: of which the trials are.
        patience: s without an answer of the DB's server after which the run ends; None for SERVER_PATIENCE.
        on_wait: called while the server does not answer, with the number of trials in the DB and what is waited for.
    """

    def __init__(
        self, lease: Lease, problem: Problem, patience: float | None, on_wait: Callable[[int, str], None]
    ) -> None:
        self._lease = lease
        self._problem = problem
        self._patience = SERVER_PATIENCE if patience is None else patience
        self._on_wait = on_wait
        self._is_unreachable = False  # whether the server did not answer the last attempt
        self.trials: list[Trial] = []

    def write(self) -> None:
        """Writes what it holds, if anything, in one transaction; waits for a server that does not answer.

        Raises StorageError, also where another driver has taken the study.
        """
        begun: float | None = None  # when the server did not answer for the first time
        while self.trials:
            try:
                self._append()
            except UnreachableError as problem:
                self._is_unreachable, now = True, time.monotonic()
                begun = now if begun is None else begun
                before = self.trials[0].number
                if now - begun >= self._patience:
                    raise StorageError(
                        f"{problem}; no answer for {self._patience:g} s; {before} trials are in it; go on with: "
                        f"metaid study run {self._lease.name}"
                    ) from None
                self._on_wait(before, f"waiting for the study DB: {problem}")
                time.sleep(min(PAUSE, self._patience - (now - begun)))
            else:
                self._is_unreachable, self.trials = False, []

    def _append(self) -> None:
        # A server that goes away in the middle of a commit may have written them all the same.
        of, store, name = self._problem, self._lease.store, self._lease.name
        if not self._is_unreachable or store.count(name) != self.trials[-1].number + 1:
            store.append(name, of.names, of.low, of.high, self.trials, write_check=self._lease.renew)

    def __enter__(self) -> Writer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, StorageError) or (error is not None and self._is_unreachable):
            return
        # An interrupt may come just after the transaction that wrote them.
        if error is None or (self.trials and self._lease.store.count(self._lease.name) == self.trials[0].number):
            self.write()
