"""SIGKILL of Ray actors at random moments of real runs: the trial table is the one of a run that was left alone."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import tempfile
import time
from contextlib import closing
from pathlib import Path
from random import Random

from metaid.results import trials_frame
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from soak.common import METAID, SoakResult, soaked
from soak.kills import faults

KILLS = 20
# Episodes are long and some fall, so that a worker is nearly always in the middle of its candidates.
CHANGES = {"trials": 600, "search.coordinates": "plain", "search.start": 0.8, "episode.steps": 4000}
LONGEST_WAIT = 1.0  # s between two kills
WORKERS = 2


def run(scale: float) -> list[SoakResult]:
    """KILLS of them, over as many studies as it takes."""
    kills = max(round(KILLS * scale), 1)

    def work() -> tuple[int, list[str]]:
        with tempfile.TemporaryDirectory() as folder:
            return kill_workers(Path(folder), kills)

    return [soaked("SIGKILL of Ray actors at work: the table of a run left alone", kills, work)]


def kill_workers(folder: Path, kills: int) -> tuple[int, list[str]]:
    """Kills workers of runs in `folder`; how many, and what went wrong. Stops after a study of which something did."""
    random, failures, done = Random(2), list[str](), 0
    for seed in itertools.count():
        if done == kills or failures:
            break
        name = f"workers-{seed}"
        spec = load_study("three-link-coast", {**CHANGES, "seed": seed})
        path = folder / f"{name}.db"
        with closing(Store(str(folder / f"{name}-alone.db"), create=True)) as store:
            create_study(store, spec, name)
            run_study(store, name)
            whole = trials_frame(store, name)
        with closing(Store(str(path), create=True)) as store:
            create_study(store, spec, name)
        command = [*METAID, "study", "run", name, "--quiet", "--engine", "ray", "--storage", str(path)]
        with subprocess.Popen([*command, "--workers", str(WORKERS)], stdout=subprocess.DEVNULL) as driver:
            while driver.poll() is None:
                time.sleep(random.uniform(0.0, LONGEST_WAIT))
                workers = workers_of(driver.pid)
                if done < kills and workers:
                    os.kill(random.choice(workers), signal.SIGKILL)
                    done += 1
        if driver.returncode != 0:
            failures.append(f"{name}: exit status {driver.returncode}")
        failures += [f"{name}: {fault}" for fault in faults(path, name, whole, finished=True)]
    return done, failures


def workers_of(driver: int) -> list[int]:
    """Processes of those Ray actors that a driver has started and that are at work."""
    parents, workers = dict[int, int](), list[int]()
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except (FileNotFoundError, ProcessLookupError):
            continue
        if at_work(int(folder.name)):
            workers.append(int(folder.name))
    return [worker for worker in workers if driver in _ancestors(worker, parents)]


def at_work(process: int) -> bool:
    """Whether a process is a Ray actor that evaluates."""
    try:
        return Path(f"/proc/{process}/cmdline").read_text().startswith("ray::_Worker.evaluate")
    except (FileNotFoundError, ProcessLookupError):
        return False


def _ancestors(process: int, parents: dict[int, int]) -> list[int]:
    found = []
    while process in parents:
        process = parents[process]
        found.append(process)
    return found
