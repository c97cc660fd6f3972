"""A DB whose file is deleted, moved, replaced or copied over, or loses its write-ahead log, at random moments of real
runs: a run that ends with status 0 has its whole table in the file, any other ends in one line, and what is put back is
gone on with.
"""

from __future__ import annotations

import shutil
import sqlite3
import subprocess
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from random import Random
from typing import Any

import pandas as pd

from metaid.results import trials_frame
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from soak.common import METAID, SoakResult, soaked
from soak.kills import count, faults

VANISHINGS = 30
NAME = "vanishing"
CHANGES: dict[str, Any] = {"trials": 1500, "sampler": "random", "search.low": 0.6, "episode.fall_limit": 1.0}
LONGEST_WAIT = 0.3  # s from the first write that a run makes


def deleted(path: Path) -> None:
    """The file alone, as `rm` of it does."""
    path.unlink()


def moved(path: Path) -> None:
    """The file alone; its log stays behind."""
    path.rename(path.with_name("elsewhere.db"))


def replaced(path: Path) -> None:
    """Another file under its name: a copy of the DB as it is now."""
    other = path.with_name("other.db")
    with closing(sqlite3.connect(path, timeout=60)) as ours, closing(sqlite3.connect(other)) as copy:
        ours.backup(copy)
    other.replace(path)


def copied_over(path: Path) -> None:
    """The study without a trial, written into the very same file."""
    path.write_bytes(path.with_name("empty.db").read_bytes())


def without_log(path: Path) -> None:
    """The file with what has been carried over into it."""
    path.with_name(f"{path.name}-wal").unlink(missing_ok=True)


WAYS = (deleted, moved, replaced, copied_over, without_log)


def run(scale: float) -> list[SoakResult]:
    """VANISHINGS of them, each way by turns."""
    times = max(round(VANISHINGS * scale), len(WAYS))

    def work() -> tuple[int, list[str]]:
        with tempfile.TemporaryDirectory() as folder:
            return vanish_often(Path(folder), times)

    return [soaked("a DB file deleted, moved, replaced, copied over or without its log in mid-run", times, work)]


def vanish_often(folder: Path, times: int) -> tuple[int, list[str]]:
    """Lets the file of a run in `folder` vanish so many times; how often it did, and what went wrong."""
    random, failures = Random(3), list[str]()
    empty, alone = folder / "empty.db", folder / "alone.db"
    with closing(Store(str(empty), create=True)) as store:
        create_study(store, load_study("three-link-coast", CHANGES), NAME)
    shutil.copy(empty, alone)
    with closing(Store(str(alone))) as store:
        run_study(store, NAME)
        whole = trials_frame(store, NAME)
    for turn in range(times):
        what = WAYS[turn % len(WAYS)]
        own = folder / str(turn)
        own.mkdir()
        shutil.copy(empty, own / "empty.db")
        path = Path(shutil.copy(empty, own / "metaid.db"))
        failures += [f"{what.__name__}, {turn}: {fault}" for fault in _vanish(path, what, random, whole)]
    return times, failures


def _vanish(path: Path, what: Callable[[Path], None], random: Random, whole: pd.DataFrame) -> list[str]:
    command = [*METAID, "study", "run", NAME, "--quiet", "--storage", str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and count(path) == 0:
            time.sleep(0.01)
        time.sleep(random.uniform(0.0, LONGEST_WAIT))
        over = process.poll() is not None
        what(path)
        _, said = process.communicate()
    if process.returncode == 0:
        return [] if over else faults(path, NAME, whole, finished=True)
    wrong = []
    if process.returncode != 2 or said.count("\n") != 1 or not said.startswith("metaid: "):
        wrong.append(f"exit status {process.returncode}: {said[-300:]}")
    if what is moved:
        path.with_name("elsewhere.db").rename(path)
    elif what is not without_log and what is not replaced:
        for file in path.parent.glob("metaid.db*"):
            file.unlink()
        shutil.copy(path.with_name("empty.db"), path)
    again = subprocess.run(command, capture_output=True, text=True)
    if again.returncode != 0:
        return [*wrong, f"does not go on: {again.stderr.strip()}"]
    return wrong + faults(path, NAME, whole, finished=True)
