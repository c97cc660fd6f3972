"""What `study run` shows while it runs: a bar on a terminal, plain lines at intervals elsewhere, nothing when quiet.
All on stderr.
"""

from __future__ import annotations

import time
from types import TracebackType

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from metaid.problem import Problem
from metaid.store import Store
from metaid.study import Progress as RunProgress
from metaid.study import stored_spec

INTERVAL = 5.0  # s between plain lines


class Live:
    """A context manager whose `update` is given the progress after each generation."""

    def __init__(self, store: Store, name: str, quiet: bool) -> None:
        problem = Problem(stored_spec(store, name))
        truth = problem.make_plant().true_lumps()
        self._true_factors = None if truth is None else truth.vector / problem.nominal.lumps.vector
        self._determined = [problem.measure.determines(lump) for lump in problem.names]
        self._unit = problem.measure.unit
        self._console = Console(stderr=True, markup=False, highlight=False)
        self._plain = not quiet and not self._console.is_terminal
        columns = (
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TextColumn("{task.fields[state]}"),
            TimeRemainingColumn(),
        )
        self._bar = Progress(*columns, console=self._console, disable=quiet or self._plain, refresh_per_second=8)
        self._task = self._bar.add_task(name, state="")
        self._name = name
        self._started: tuple[float, int] | None = None
        self._last_line = time.monotonic()
        self.trials = 0

    def update(self, progress: RunProgress) -> None:
        """Shows how far the run is."""
        now = time.monotonic()
        self._started = self._started or (now, progress.trials)
        self.trials = progress.trials
        state = self._state(progress, now)
        self._bar.update(self._task, completed=progress.trials, total=progress.total, state=state)
        if self._plain and now - self._last_line >= INTERVAL:
            self._last_line = now
            self._console.print(f"{self._name} {progress.trials}/{progress.total} {state}", soft_wrap=True)

    def _state(self, progress: RunProgress, now: float) -> str:
        begun, first = self._started or (now, 0)
        rate = (progress.trials - first) / (now - begun) if now > begun else 0.0
        parts = [f"{rate:.0f}/s", f"{progress.falls} falls"]
        if progress.best is not None:
            parts.append(f"best {progress.best.outcome.value:.2g} {self._unit}")
            if self._true_factors is not None:
                errors = np.abs(progress.best.factors / self._true_factors - 1.0)[self._determined]
                parts.append(f"error {errors.max():.2%}")
        return ", ".join(parts)

    def __enter__(self) -> Live:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
