"""What the parts of the soak share: what a part found, and folders of their own for their studies."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
METAID = (sys.executable, "-c", "from metaid.cli import main; main()")  # the command, in this very environment


@dataclass(frozen=True)
class SoakResult:
    """What one promise came to: how many cases were `promised`, how many were `done`, what failed among them (one
    line each), and how long it took.
    """

    name: str
    promised: int
    done: int
    failures: tuple[str, ...]
    seconds: float

    @property
    def kept(self) -> bool:
        return not self.failures and self.done >= self.promised


def soaked(name: str, promised: int, work: Callable[[], tuple[int, Sequence[str]]]) -> SoakResult:
    """The result of `work`, which returns how many cases it did and what failed among them; an error that it raises
    is a failure as well.
    """
    begun = time.perf_counter()
    try:
        done, failures = work()
    except Exception as problem:  # a soak of many parts goes on to the next
        done, failures = 0, [f"{type(problem).__name__}: {' '.join(str(problem).split())[:300]}"]
    return SoakResult(name, promised, done, tuple(failures), time.perf_counter() - begun)


def table(results: Sequence[SoakResult]) -> str:
    """Results as a Markdown table."""
    lines = ["| what was done | promised | done | failed | seconds |", "| --- | --: | --: | --: | --: |"]
    lines += [
        f"| {found.name} | {found.promised:,} | {found.done:,} | {len(found.failures):,} | {found.seconds:.0f} |"
        for found in results
    ]
    return "\n".join(lines)
