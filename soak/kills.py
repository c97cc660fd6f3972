"""SIGKILL of the driver at random moments, also in the middle of a write, and resume: the trial table is the one of a
run that was left alone, and at every kill it is so as far as it goes.
"""

from __future__ import annotations

import itertools
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from random import Random
from typing import Any

import pandas as pd

from metaid import results
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from soak.common import METAID, ROOT, SoakResult, soaked

KILLS = {"cmaes": 20, "tpe": 15, "random": 15}
CHANGES: dict[str, dict[str, Any]] = {
    "cmaes": {"trials": 3000, "search.coordinates": "plain", "search.start": 0.8, "episode.fall_limit": 1.0},
    "tpe": {"sampler": "tpe", "trials": 400},
    "random": {"sampler": "random", "trials": 1500, "search.low": 0.6, "episode.fall_limit": 1.0},
}
LONGEST_WAIT = 0.4  # s from the first write that a run makes to its kill: most runs are longer
LONGEST_START = 2.0  # s
WRITES, STATEMENTS = 5, 12  # a doomed run dies within its first ones; a write is of six statements and the commit


def run(scale: float) -> list[SoakResult]:
    """All of KILLS, two studies at a time."""
    shares = {sampler: max(round(kills * scale), 1) for sampler, kills in KILLS.items()}

    def work() -> tuple[int, list[str]]:
        with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
            given = [(Path(folder), sampler, CHANGES[sampler], kills) for sampler, kills in shares.items()]
            found = list(pool.map(lambda arguments: kill_often(*arguments), given))
        return sum(done for done, _ in found), [failure for _, failures in found for failure in failures]

    return [soaked("SIGKILL of the driver, gone on with: the table of a run left alone", sum(shares.values()), work)]


def kill_often(folder: Path, sampler: str, changes: Mapping[str, Any], kills: int) -> tuple[int, list[str]]:
    """Kills runs in `folder`, of as many studies as it takes to be killed `kills` times; how often it did, and what
    went wrong. Stops after a study of which something did.
    """
    random, failures, done = Random(1), list[str](), 0
    for seed in itertools.count():
        if done == kills or failures:
            break
        name = f"{sampler}-{seed}"
        spec = load_study("three-link-coast", {**changes, "seed": seed})
        path, alone = folder / f"{name}.db", folder / f"{name}-alone.db"
        with closing(Store(str(alone), create=True)) as store:
            create_study(store, spec, name)
            run_study(store, name)
            whole = results.trials_frame(store, name)
        with closing(Store(str(path), create=True)) as store:
            create_study(store, spec, name)
        while done < kills and _killed(path, name, random):
            done += 1
            failures += [f"{name}, kill {done}: {fault}" for fault in faults(path, name, whole)]
        last = subprocess.run([*METAID, "study", "run", name, "--quiet", "--storage", path], capture_output=True)
        if last.returncode != 0:
            failures.append(f"{name}: {last.stderr.decode().strip()}")
        failures += [f"{name}, at its end: {fault}" for fault in faults(path, name, whole, finished=True)]
    return done, failures


def _killed(path: Path, name: str, random: Random) -> bool:
    """Runs the study and kills it: during a write, at any moment, or while it starts. False if it ended before."""
    how = random.choices(["write", "moment", "start"], [5, 4, 1])[0]
    arguments = ["study", "run", name, "--quiet", "--storage", str(path)]
    if how == "write":
        doom = [str(random.randint(1, WRITES)), str(random.randint(1, STATEMENTS))]
        doomed = [sys.executable, "-m", "soak.doomed", *doom, *arguments]
        return subprocess.run(doomed, cwd=ROOT, capture_output=True).returncode == -signal.SIGKILL
    before = count(path)
    with subprocess.Popen([*METAID, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while how == "moment" and process.poll() is None and count(path) == before:
            time.sleep(0.01)
        time.sleep(random.uniform(0.0, LONGEST_WAIT if how == "moment" else LONGEST_START))
        process.kill()
    return process.returncode == -signal.SIGKILL


def count(path: Path) -> int:
    """How many trials the DB of one study has."""
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=60)) as connection:
        return int(connection.execute("SELECT COUNT(*) FROM trials").fetchone()[0])


def faults(path: Path, name: str, whole: pd.DataFrame, finished: bool = False) -> list[str]:
    """What is wrong with a DB whose trials are to be the first of `whole`, in whole generations.

    A copy is looked at: opening the DB itself would mend what the next run has to mend.
    """
    with tempfile.TemporaryDirectory() as folder:
        for file in path.parent.glob(f"{path.name}*"):
            if not file.name.endswith("-shm"):
                shutil.copy(file, folder)
        copy = Path(folder) / path.name
        with closing(sqlite3.connect(copy)) as connection:
            integrity = connection.execute("PRAGMA integrity_check").fetchall()
            states = {row[0] for row in connection.execute("SELECT DISTINCT state FROM trials")}
        with closing(Store(str(copy))) as store:
            found = results.trials_frame(store, name)
    wrong = [] if integrity == [("ok",)] else [f"integrity_check says {integrity[0][0]}"]
    if not states <= {"COMPLETE", "PRUNED"}:
        wrong.append(f"trials are {', '.join(sorted(states))}")
    if not found.equals(whole.iloc[: len(found)]):
        wrong.append(f"the {len(found)} trials are not those of a run left alone")
    if len(found) not in {0, *whole.groupby("generation")["number"].max() + 1}:
        wrong.append(f"{len(found)} trials are not whole generations")
    if finished and len(found) != len(whole):
        wrong.append(f"{len(found)} trials and not {len(whole)}")
    return wrong
