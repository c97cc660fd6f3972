"""The last generation of a run on its way into the DB."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType

from metaid.errors import StorageError
from metaid.store import SERVER_PATIENCE, Lease, Store, Trial, keep_trying
from metaid.study.problem import Problem


class Writer:
    """Holds the `trials` of the last generation until there is time to write them; at the end, whatever it is, there
    is. It has no thread of its own: an error in writing ends the run there and then.
    """

    def __init__(
        self,
        store: Store,
        name: str,
        problem: Problem,
        lease: Lease,
        patience: float | None,
        wait: Callable[[int, str], None],
    ) -> None:
        self._store = store
        self._name = name
        self._problem = problem
        self._lease = lease
        self._patience = SERVER_PATIENCE if patience is None else patience
        self._wait = wait  # told how many trials are in the DB, and what it waits for
        self._away = False  # whether the server did not answer when it was last asked
        self.trials: list[Trial] = []

    def write(self) -> None:
        """Writes what it holds, if anything, in one transaction; waits for a server that does not answer."""
        if self.trials:
            before = self.trials[0].number
            go_on = f"{before} trials are in it; go on with: metaid study run {self._name}"
            keep_trying(self._append, self._patience, self._tell, go_on)
            self._away = False
            self.trials = []

    def _append(self) -> None:
        # A server that goes away in the middle of a commit may have written them all the same.
        if not self._away or self._store.count(self._name) != self.trials[-1].number + 1:
            space = self._problem.space
            self._store.append(
                self._name, space.names, space.low, space.high, self.trials, write_check=self._lease.renew
            )

    def _tell(self, why: str) -> None:
        self._away = True
        self._wait(self.trials[0].number, why)

    def __enter__(self) -> Writer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, StorageError) or (error is not None and self._away):
            return
        # An interrupt may come just after the transaction that wrote them.
        if error is None or (self.trials and self._store.count(self._name) == self.trials[0].number):
            self.write()
