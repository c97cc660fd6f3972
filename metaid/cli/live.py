"""What `study run` shows while it runs: on a terminal a bar, the time left and the lumps as they settle, elsewhere
plain lines at intervals, nothing when quiet. All on stderr.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress

import numpy as np
from rich.console import Console, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from metaid.compiled import is_compiling
from metaid.errors import printable
from metaid.models import Array
from metaid.search import SAMPLERS
from metaid.store import Store
from metaid.study import Progress as RunProgress
from metaid.study import problem_of, stored_spec

INTERVAL = 5.0  # s between plain lines
LOOK_BACK = 10  # generations over which a lump's last move is shown
MOST_LUMPS = 12  # in the table


class Live:
    """A context manager whose `update` is given the progress after each generation.

    Args:
        store: the study DB.
        name: the study's.
        quiet: whether nothing is shown.
        console: to show it on; None for stderr.
    """

    def __init__(self, store: Store, name: str, quiet: bool, console: Console | None = None) -> None:
        self._bests: deque[Array] = deque(maxlen=LOOK_BACK)
        self._problem = problem_of(stored_spec(store, name))
        self._sought = self._problem.robot.sought
        true = self._problem.robot.true_values(self._sought)
        self._true_factors = np.where(true == 0.0, np.nan, true) / self._sought.scale
        # Of base parameters, of which one may be next to nothing, a share of an error says nothing.
        self._tells_error = self._sought.deviations is None and not np.isnan(self._true_factors).all()
        self._console = console or Console(stderr=True, markup=False, highlight=False)
        self._prints_lines = not quiet and not self._console.is_terminal
        self._name = printable(name)
        self._bar = _Bar(self._console, quiet or self._prints_lines, self._lumps)
        self._task = self._bar.add_task(self._name, state="")
        self._started: tuple[float, int] | None = None
        self._last_line = time.monotonic()
        self.trials = store.count(name)

    def update(self, progress: RunProgress) -> None:
        """Shows how far the run is."""
        now = time.monotonic()
        self._started = self._started or (now, progress.trials)
        self.trials = progress.trials
        state = self._state(progress, now)
        if progress.best is not None:
            self._bests.append(progress.best.factors)
        self._bar.update(self._task, completed=progress.trials, total=progress.total, state=state)
        if self._prints_lines and now - self._last_line >= INTERVAL:
            self._last_line = now
            with suppress(OSError):  # a full device of its progress must not end a run
                self._console.print(f"{self._name} {progress.trials}/{progress.total} {state}", soft_wrap=True)

    def _state(self, progress: RunProgress, now: float) -> str:
        if progress.waiting is not None:
            return progress.waiting
        begun, first = self._started or (now, 0)
        rate = (progress.trials - first) / (now - begun) if now > begun else 0.0
        parts = [f"{rate:.0f} trials/s", f"{progress.falls} falls"]
        if progress.best is not None:
            parts.append(f"best {progress.best.outcome.value:.2g} {self._problem.measure.unit}")
        if progress.spread is not None:
            name = SAMPLERS[self._problem.spec.study.sampler].spread_name
            parts.append(f"{name} {progress.spread:.2g}")
        if progress.best is not None and self._tells_error:
            errors = np.abs(progress.best.factors / self._true_factors - 1.0)[self._problem.robot.seen]
            parts.append(f"error {np.nanmax(errors):.2%}")
        return ", ".join(parts)

    def _lumps(self) -> Table:
        """The best candidate's lumps, and how far each has moved lately: what stands still has settled."""
        table = Table(box=None, padding=(0, 2), header_style="dim")
        if not self._bests:
            return table
        best, earlier = self._bests[-1], self._bests[0]
        for title in ("lump", "identified", "", "moved lately"):
            table.add_column(title, justify="left" if title in ("lump", "") else "right")
        for i, lump in enumerate(self._problem.names[:MOST_LUMPS]):
            moved = best[i] / earlier[i] - 1.0 if earlier[i] else np.nan
            table.add_row(lump, f"{best[i] * self._sought.scale[i]:.5g}", self._sought.units[i], f"{moved:+.2%}")
        if len(best) > MOST_LUMPS:
            table.add_row(f"and {len(best) - MOST_LUMPS} more", "", "", "")
        return table

    def __enter__(self) -> Live:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Takes the bar away."""
        self._bar.stop()


class _Bar(Progress):
    """A bar with its time left, the state beneath it, and `below`, made anew whenever drawn; gone when it stops."""

    def __init__(self, console: Console, disable: bool, below: Callable[[], RenderableType]) -> None:
        self._below = below
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(compact=True),
            TextColumn("left"),
        )
        super().__init__(*columns, console=console, disable=disable, refresh_per_second=8, transient=True)

    def get_renderables(self) -> Iterable[RenderableType]:
        """The bar, the state of its one task, and what is below."""
        yield self.make_tasks_table(self.tasks)
        compiling = "compiling, the first time on this machine" if is_compiling() else None
        yield from (compiling or str(task.fields["state"]) for task in self.tasks)
        yield self._below()
