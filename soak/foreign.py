"""Trials that others add to a study while it runs, by every way that Optuna has: metaid's own are those of a run that
was left alone, and each of the others is named.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from random import Random

import optuna
from optuna.trial import TrialState, create_trial

from metaid.results import summary, trials_frame
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from soak.common import METAID, SoakResult, soaked

FOREIGN = 100
NAME = "shared"
CHANGES = {"trials": 900, "sampler": "random", "search.low": 0.6, "episode.fall_limit": 1.0, "episode.steps": 4000}
LONGEST_WAIT = 0.02  # s between two of them


def _ask(study: optuna.Study) -> None:
    study.ask().suggest_float("gravity_1", 0.5, 2.0)


def _enqueue(study: optuna.Study) -> None:
    study.enqueue_trial({"gravity_1": 1.0})


def _add(study: optuna.Study) -> None:
    study.add_trial(create_trial(value=1.0, user_attrs={"steps": "x", "generation": None}))


def _copy(study: optuna.Study) -> None:
    trials = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    study.add_trials(trials[-1:] or [create_trial(value=2.0)])


def _fail(study: optuna.Study) -> None:
    study.tell(study.ask(), state=TrialState.FAIL)


WAYS: tuple[Callable[[optuna.Study], None], ...] = (_ask, _enqueue, _add, _copy, _fail)


def run(scale: float) -> list[SoakResult]:
    """FOREIGN of them, over as many studies as it takes."""
    count = max(round(FOREIGN * scale), len(WAYS))

    def work() -> tuple[int, list[str]]:
        with tempfile.TemporaryDirectory() as folder:
            return add_often(Path(folder), count)

    return [soaked("trials of others added in mid-run: our own are those of a run left alone", count, work)]


def add_often(folder: Path, count: int) -> tuple[int, list[str]]:
    """Adds so many trials to runs in `folder`; how many, and what went wrong. Stops after a study of which something
    did.
    """
    random, failures, done, seed = Random(4), list[str](), 0, 0
    while done < count and not failures:
        spec = load_study("three-link-coast", {**CHANGES, "seed": seed})
        path, alone = folder / f"{seed}.db", folder / f"{seed}-alone.db"
        for storage in (path, alone):
            with closing(Store(str(storage), create=True)) as store:
                create_study(store, spec, NAME)
        with closing(Store(str(alone))) as store:
            run_study(store, NAME)
            whole = trials_frame(store, NAME)
        study = optuna.load_study(study_name=NAME, storage=f"sqlite:///{path}")
        command = [*METAID, "study", "run", NAME, "--quiet", "--storage", str(path)]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            while process.poll() is None and done < count:
                random.choice(WAYS)(study)
                done += 1
                time.sleep(random.uniform(0.0, LONGEST_WAIT))
            _, said = process.communicate()
        if process.returncode != 0:
            failures.append(f"seed {seed}: exit status {process.returncode}: {said.strip()[-300:]}")
        with closing(Store(str(path))) as store:
            if not trials_frame(store, NAME).equals(whole):
                failures.append(f"seed {seed}: the trials are not those of a run left alone")
            named = len(summary(store, NAME).get("foreign_trials", []))
        there = len(study.get_trials(deepcopy=False)) - len(whole)  # Optuna's `ask` takes one that is enqueued
        if named != there:
            failures.append(f"seed {seed}: {named} trials of others are named and not {there}")
        seed += 1
    return done, failures
