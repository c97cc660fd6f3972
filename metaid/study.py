"""A study: created in a DB, run a generation at a time, resumed by replaying what the DB holds.

The trial table depends on the study's settings and seed alone. The searcher is asked for a generation, the crew
evaluates it, the searcher is told; the store writes it in one transaction while the crew is at the next. A run that
was stopped anywhere goes on from the last whole generation in the DB.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from types import TracebackType

import numpy as np
from optuna.trial import TrialState
from threadpoolctl import threadpool_limits

from metaid.chain import Array
from metaid.crews import make_crew
from metaid.errors import StorageError, StudyError
from metaid.lease import Lease, refuse_if_run
from metaid.objective import Outcome
from metaid.problem import Problem, PushedSettings, StudySpec
from metaid.ray_crew import PATIENCE
from metaid.rows import Trial
from metaid.searchers import Searcher
from metaid.socket_plant import SocketSettings
from metaid.store import Store

LARGEST_TPE = 2000  # trials; what the next one costs grows with all before it
REPLAY_TOLERANCE = 1e-6  # relative; another machine's linear algebra may round differently


@dataclass(frozen=True)
class Progress:
    """How far a run is: trials done, how many of them fell, trials in all, the best survivor, the searcher's
    spread, the run's state.
    """

    trials: int
    falls: int
    total: int
    best: Trial | None
    spread: float | None
    generation: int


def create_study(store: Store, spec: StudySpec, name: str | None = None) -> str:
    """Puts a study without trials into the DB and returns its name.  Raises StorageError if the name is taken.

    A rig is pushed, to find what pushes it needs and what they do.  Raises LostPlant where it does not answer.
    """
    problem = Problem(spec)
    problem.make_searcher()  # what cannot be run is not created
    name = spec.name if name is None else name
    if not name or len(name) > 200 or not name.isprintable():
        raise StudyError("a study's name has 1 to 200 printable characters")
    if not problem.is_simulated:
        if name in store.names():
            raise StorageError(f"{store.url} has a study '{name}' already (choose another with --name, or delete it)")
        spec = _pushed_spec(problem)
        Problem(spec).make_searcher()
    store.create(name, spec.model_dump_json())
    return name


def _pushed_spec(problem: Problem) -> StudySpec:
    """The study with the pushes that its rig needs, and what they do to it."""
    with closing(problem.open_plant()) as plant:
        episode, speeds = problem.at_plant(plant)
    pushed = PushedSettings(impulses=episode.pushes.tolist(), speeds=speeds.tolist())
    return problem.spec.model_copy(update={"pushed": pushed})


def advice(spec: StudySpec) -> str | None:
    """What to think over before the study is run, in one line; None if nothing."""
    if spec.study.sampler != "tpe" or spec.study.trials <= LARGEST_TPE:
        return None
    return (
        f"{spec.study.trials} trials with tpe: each takes longer than the one before "
        f"(advised: at most {LARGEST_TPE} with tpe, or sampler = 'cmaes')"
    )


def stored_spec(store: Store, name: str) -> StudySpec:
    """The settings that a study in the DB was made from.  Raises StorageError."""
    try:
        return StudySpec.model_validate_json(store.spec(name))
    except ValueError:
        raise StorageError(f"{store.url}: study '{name}' was made by another version of metaid") from None


def delete_study(store: Store, name: str) -> None:
    """Deletes a study and its trials from the DB.  Raises StorageError if it is not there, or is being run."""
    store.delete(name, lambda connection, study_id: refuse_if_run(connection, study_id, name))


def run_study(
    store: Store,
    name: str,
    trials: int | None = None,
    workers: int | None = None,
    engine: str = "local",
    ray_address: str | None = None,
    watch: Callable[[Progress], None] = lambda progress: None,
    patience: float = PATIENCE,
) -> Progress:
    """Runs a study, or goes on with it, until the DB holds `trials` in all (default: the study's own) or the searcher
    is finished.

    `watch` is called after each generation. A KeyboardInterrupt leaves the DB at the last generation that `watch` saw;
    a kill may lose that one. Ray's workers are given `patience` (s), see `RayCrew`.  Raises StudyError, StorageError,
    also where another driver runs the study, and WorkerError.
    """
    spec = stored_spec(store, name)
    total = spec.study.trials if trials is None else trials
    workers = spec.study.workers if workers is None else workers
    if total < 1 or workers < 1:
        raise StudyError(f"trials is {total} and workers is {workers} (allowed: 1 or more of each)")
    if isinstance(spec.plant, SocketSettings) and workers != 1:
        raise StudyError(f"plant {spec.plant_name} is one rig: workers is {workers} (allowed: 1)")
    store.check()
    # At these sizes BLAS threads cost far more than they give.
    with threadpool_limits(1), Lease(store, name) as lease:
        problem = Problem(spec)
        run = _Run(problem, problem.make_searcher(), total, spec.study.search.target)
        pending = run.replay(store.trials(name, problem.names), f"{store.url}: study '{name}'")
        watch(run.progress)
        if run.done:
            return run.progress
        with (
            make_crew(problem, engine, workers, ray_address, patience) as crew,
            _Writer(store, name, problem, lease) as writer,
        ):
            while not run.done:
                batch = pending if pending is not None else run.searcher.ask()
                have = len(run.outcomes)
                started = datetime.now(UTC).replace(tzinfo=None)
                # A rig's episodes are dear: each is kept, whatever becomes of the next.
                until = have + min(total - run.number, len(batch) if problem.is_simulated else 1)
                outcomes = crew.evaluate(batch[have:until], meanwhile=writer.write)
                completed = datetime.now(UTC).replace(tzinfo=None)
                fresh = [
                    Trial(run.number + i, run.generation, batch[have + i], outcome, started, completed)
                    for i, outcome in enumerate(outcomes)
                ]
                writer.trials = fresh
                pending = run.add(fresh, batch)
                watch(run.progress)
    return run.progress


class _Writer:
    """Holds the `trials` of the last generation until there is time to write them; at the end, whatever it is, there
    is. It has no thread of its own: an error in writing ends the run there and then.
    """

    def __init__(self, store: Store, name: str, problem: Problem, lease: Lease) -> None:
        self._store = store
        self._name = name
        self._problem = problem
        self._lease = lease
        self.trials: list[Trial] = []

    def write(self) -> None:
        """Writes what it holds, if anything, in one transaction."""
        if self.trials:
            problem = self._problem
            self._store.append(
                self._name, problem.names, problem.low, problem.high, self.trials, guard=self._lease.renew
            )
            self.trials = []

    def __enter__(self) -> _Writer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, StorageError):
            return
        # An interrupt may come just after the transaction that wrote them.
        if error is None or (self.trials and self._store.count(self._name) == self.trials[0].number):
            self.write()


class _Run:
    """Where a run stands: how many trials there are, and what is known of the generation that is not yet whole."""

    def __init__(self, problem: Problem, searcher: Searcher, total: int, target: float | None) -> None:
        self.problem = problem
        self.searcher = searcher
        self.total = total
        self.target = target
        self.number = self.falls = self.generation = 0
        self.best: Trial | None = None
        self.outcomes: list[Outcome] = []

    @property
    def progress(self) -> Progress:
        return Progress(self.number, self.falls, self.total, self.best, self.searcher.spread, self.generation)

    @property
    def done(self) -> bool:
        reached = self.target is not None and self.best is not None and self.best.outcome.value <= self.target
        return self.number >= self.total or (not self.outcomes and (reached or self.searcher.finished()))

    def add(self, trials: list[Trial], batch: Array) -> Array | None:
        """Takes in trials of the generation `batch`; tells the searcher when it is whole, else returns the batch to
        go on with.
        """
        for trial in trials:
            self.number += 1
            self.falls += trial.state == TrialState.PRUNED
            if not trial.outcome.fell and (self.best is None or trial.outcome.value < self.best.outcome.value):
                self.best = trial
        self.outcomes += [trial.outcome for trial in trials]
        if len(self.outcomes) < len(batch):
            return batch
        self.searcher.tell(self.outcomes)
        self.outcomes = []
        self.generation += 1
        return None

    def replay(self, trials: list[Trial], where: str) -> Array | None:
        """Asks and tells the searcher all that the DB holds; returns the generation to go on with if the last one is
        not whole.
        """
        batch: Array | None = None
        while self.number < len(trials):
            batch = self.searcher.ask()
            stored = trials[self.number : self.number + len(batch)]
            known = np.array([trial.factors for trial in stored])
            if not np.allclose(batch[: len(known)], known, rtol=REPLAY_TOLERANCE, atol=0.0):
                raise StorageError(
                    f"{where}: trial {self.number} and on do not follow from its settings and seed: "
                    "made by another version, or changed"
                )
            batch = self.add(stored, batch)
        return batch
