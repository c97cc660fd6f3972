"""Commands in processes of their own, forked from one that has metaid loaded: loading takes most of a short command."""

from __future__ import annotations

import multiprocessing
import os
import signal
from pathlib import Path

from metaid.cli import main

FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(
    ["metaid.cli", "metaid.study.run", "metaid.results", "metaid.compiled", "mujoco", "optuna"]
)


class Command:
    """A command of metaid that runs in a process of its own, and is killed with this one.

    Args:
        folder: for what it prints.
        arguments: of the command.
        first: Python that is run before it.
    """

    def __init__(self, folder: Path, *arguments: str, first: str = "") -> None:
        self._out, self._err = folder / "out", folder / "err"
        self._process = FORKS.Process(target=_run, args=(self._out, self._err, first, arguments), daemon=True)
        self._process.start()

    @property
    def pid(self) -> int:
        """The number of its process."""
        assert self._process.pid is not None
        return self._process.pid

    @property
    def out(self) -> str:
        """What it has printed."""
        return self._out.read_text(encoding="utf-8")

    @property
    def err(self) -> str:
        """What it has said to whoever calls it, errors above all."""
        return self._err.read_text(encoding="utf-8")

    def poll(self) -> int | None:
        """Its exit status, or less zero the signal that ended it; None while it runs."""
        return self._process.exitcode

    def wait(self, patience: float = 120.0) -> int:
        """The same once it has ended, for which it has so many s."""
        self._process.join(patience)
        assert self._process.exitcode is not None, "it still runs"
        return self._process.exitcode

    def send(self, number: signal.Signals) -> None:
        """Sends it a signal."""
        os.kill(self.pid, number)

    def kill(self) -> None:
        """Ends it for good, if it still runs."""
        self._process.kill()
        self._process.join()


def _run(out: Path, err: Path, first: str, arguments: tuple[str, ...]) -> None:
    for path, number in ((out, 1), (err, 2)):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    exec(first, {})
    main(arguments)
