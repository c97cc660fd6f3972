"""What a trial costs outside its episode: CPU time, memory, space in the DB; and how soon 50,000 trials are back.

Real studies of episodes of a few steps, so all but nothing of the time is theirs. CMA-ES would be finished long before
trial 50,000, so it starts again, with another seed, whenever it is.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import optuna

from benchmarks.common import Row, made, make_spec, run_alone, seconds
from metaid.episode import Outcome
from metaid.models import Array
from metaid.results import trials_frame
from metaid.search import SAMPLERS, Cmaes, Coordinates, Sampler, SamplerOptions
from metaid.store import Store
from metaid.study import Problem, run_study

MARKS = (100, 1_000, 10_000, 50_000)
TPE_MARKS = (100, 300, 1_000, 2_000)
IN_OPTUNA = 5  # links of the study that plain Optuna opens; it takes nearly a ms a trial
WINDOW = 0.2  # of the trials up to a mark are what it is measured over
MEGABYTE = 1e6


class EndlessCmaes:
    """CMA-ES that starts again, with the next seed, when it is finished."""

    def __init__(self, coordinates: Coordinates, seed: int, options: SamplerOptions) -> None:
        self._coordinates, self._seed, self._options = coordinates, seed, options
        self._searcher = self._make()

    def _make(self) -> Cmaes:
        return Cmaes(self._coordinates, self._seed, self._options)

    @property
    def spread(self) -> float | None:
        return self._searcher.spread

    def ask(self) -> Array:
        return self._searcher.ask()

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        self._searcher.tell(outcomes)
        if self._searcher.finished():
            self._seed += 1
            self._searcher = self._make()

    def finished(self) -> bool:
        return False


SAMPLERS["endless-cmaes"] = Sampler(lambda coordinates, seed, options, _: EndlessCmaes(coordinates, seed, options))


def measure(quick: bool) -> dict[str, list[Row]]:
    """A table of costs a trial, one of what 50,000 trials are."""
    marks = MARKS[:2] if quick else MARKS
    # The one that plain Optuna opens comes last: it would leave its memory to the others.
    pairs = sorted((_grow(nlink, marks) for nlink in (2, 10, IN_OPTUNA)), key=lambda pair: pair[0]["lumps"])
    grown, whole = zip(*pairs, strict=True)
    tpe = _costs(2, "tpe", TPE_MARKS[:1] if quick else TPE_MARKS)
    return {
        "Overhead: CPU ms a trial outside the episode, cmaes": list(grown),
        "Overhead: CPU ms a trial outside the episode, tpe": [tpe],
        f"A study of {marks[-1]:,} trials": list(whole),
    }


def _grow(nlink: int, marks: tuple[int, ...]) -> tuple[Row, Row]:
    spec = make_spec(nlink, steps=2, trials=marks[-1], sampler="endless-cmaes")
    with made(spec) as (store, name):
        watch = _Watch()
        run_study(store, name, watch=watch.look)
        costs = _row(nlink, watch, marks)
        begun = watch.memory_at(min(1000, marks[0]))
        growth = (watch.memory_at(marks[-1]) - begun) / (marks[-1] - min(1000, marks[0]))
        peak = max(watch.memory)
        path = Path(store.url.removeprefix("sqlite:///"))
        store.close()
        size = sum(file.stat().st_size for file in path.parent.iterdir())
        resume = seconds(lambda: run_study(store, name))
        frame = seconds(lambda: trials_frame(store, name))
        opens = None
        if nlink == IN_OPTUNA:
            opens = seconds(lambda: _opens_in_optuna(store, name, spec.study.trials, len(Problem(spec).names)))
        facts = {"growth of memory, bytes a trial": growth, "peak memory, MB": peak / MEGABYTE}
        facts |= {"DB, bytes a trial": size / marks[-1], "resume, s": resume, "metaid.trials, s": frame}
        return costs, {"lumps": costs["lumps"], **facts, "optuna.load_study and all trials, s": opens}


def _costs(nlink: int, sampler: str, marks: tuple[int, ...]) -> Row:
    with made(make_spec(nlink, steps=2, trials=marks[-1], sampler=sampler)) as (store, name):
        watch = _Watch()
        run_study(store, name, watch=watch.look)
        return _row(nlink, watch, marks)


def _row(nlink: int, watch: _Watch, marks: tuple[int, ...]) -> Row:
    costs = {f"at trial {mark:,}": 1e3 * watch.cost_at(mark) for mark in marks}
    ratio = {"last ÷ at 1,000": costs[f"at trial {marks[-1]:,}"] / costs["at trial 1,000"]} if 1000 in marks else {}
    return {"lumps": nlink * (nlink + 1) // 2, **costs, **ratio}


class _Watch:
    """CPU time and memory of this process after every generation."""

    def __init__(self) -> None:
        self.trials: list[int] = []
        self.cpu: list[float] = []
        self.memory: list[int] = []

    def look(self, progress: object) -> None:
        self.trials.append(progress.trials)  # type: ignore[attr-defined]
        self.cpu.append(time.process_time())
        self.memory.append(int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE"))

    def cost_at(self, trial: int) -> float:
        """CPU seconds a trial, over the trials just before that one."""
        first, last = np.searchsorted(self.trials, [trial * (1.0 - WINDOW), trial])
        return float((self.cpu[last] - self.cpu[first]) / (self.trials[last] - self.trials[first]))

    def memory_at(self, trial: int) -> int:
        return self.memory[int(np.searchsorted(self.trials, trial))]


def _opens_in_optuna(store: Store, name: str, total: int, nlump: int) -> None:
    """Checks that plain Optuna sees every trial, numbered, finished and with all its parameters."""
    trials = optuna.load_study(study_name=name, storage=store.url).trials
    assert [trial.number for trial in trials] == list(range(total)), "trials are missing"
    assert all(trial.state.is_finished() and len(trial.params) == nlump for trial in trials), "trials are not whole"


if __name__ == "__main__":
    run_alone("overhead", measure)
