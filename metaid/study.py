"""A study: created in a DB, run a generation at a time, resumed by replaying what the DB holds.

The trial table depends on the study's settings and seed alone. The searcher is asked for a generation, the crew
evaluates it, the searcher is told; the store writes it in one transaction while the crew is at the next. A run that
was stopped anywhere goes on from the last whole generation in the DB.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from types import TracebackType

from threadpoolctl import threadpool_limits

from metaid.crew import Crew
from metaid.crews import make_crew
from metaid.errors import StorageError, StudyError
from metaid.lease import Lease, refuse_if_run
from metaid.patience import SERVER_PATIENCE, keep_trying
from metaid.problem import Problem
from metaid.rows import Trial
from metaid.running import Progress, Run
from metaid.socket_plant import SocketSettings
from metaid.spec import PushedSettings, StudySpec
from metaid.store import Store

LARGEST_TPE = 2000  # trials; what the next one costs grows with all before it


def create_study(store: Store, spec: StudySpec, name: str | None = None) -> str:
    """Puts a study without trials into the DB and returns its name.  Raises StorageError if the name is taken.

    A rig is pushed, to find what pushes it needs and what they do.  Raises LostPlant where it does not answer.
    """
    problem = Problem(spec)
    _refuse_what_cannot_be_run(problem)
    name = spec.name if name is None else name
    if not name or len(name) > 200 or not name.isprintable():
        raise StudyError("a study's name has 1 to 200 printable characters")
    if not problem.is_simulated:
        if name in store.names():
            raise StorageError(f"{store.url} has a study '{name}' already (choose another with --name, or delete it)")
        spec = _pushed_spec(problem)
        _refuse_what_cannot_be_run(Problem(spec))
    store.create(name, spec.model_dump_json())
    return name


def _refuse_what_cannot_be_run(problem: Problem) -> None:
    for stage in problem.stages():
        stage.make_searcher()


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
    patience: float | None = None,
) -> Progress:
    """Runs a study, or goes on with it, until the DB holds `trials` in all (default: the study's own) or the searcher
    is finished.

    `watch` is called after each generation. A KeyboardInterrupt leaves the DB at the last generation that `watch` saw;
    a kill may lose that one. A Ray worker or a DB server that is silent is given up after `patience` (s; default:
    120 and 300); `watch` is called while a server is waited for, once a second.  Raises StudyError,
    StorageError, also where another driver runs the study, and WorkerError.
    """
    spec = stored_spec(store, name)
    total = spec.study.total_trials if trials is None else trials
    workers = spec.study.workers if workers is None else workers
    if total < 1 or workers < 1:
        raise StudyError(f"trials is {total} and workers is {workers} (allowed: 1 or more of each)")
    if isinstance(spec.plant, SocketSettings) and workers != 1:
        raise StudyError(f"plant {spec.plant_name} is one rig: workers is {workers} (allowed: 1)")
    store.check()
    # At these sizes BLAS threads cost far more than they give.
    with threadpool_limits(1), Lease(store, name) as lease:
        run = _replayed(store, name, spec, total)
        watch(run.progress)

        def wait(trials: int, why: str) -> None:
            watch(replace(run.progress, trials=trials, waiting=why))

        while not run.done:
            problem = run.problem
            with (
                make_crew(problem, engine, workers, ray_address, patience) as crew,
                _Writer(store, name, problem, lease, patience, wait) as writer,
            ):
                _run_stage(run, crew, writer, watch)
    return run.progress


def _replayed(store: Store, name: str, spec: StudySpec, total: int) -> Run:
    stored = store.trials(name, *spec.names)
    run = Run(Problem(spec), max(total, len(stored)))
    run.replay(stored, f"{store.url}: study '{name}'")
    return run


def _run_stage(run: Run, crew: Crew, writer: _Writer, watch: Callable[[Progress], None]) -> None:
    """Goes on with a run until it is done, or its stage is."""
    problem = run.problem
    stage = None if problem.is_only else problem.stage
    while run.problem is problem and not run.done:
        batch = run.candidates()
        if not problem.is_simulated:
            batch = batch[:1]  # a rig's episodes are dear: each is kept, whatever becomes of the next
        started = datetime.now(UTC).replace(tzinfo=None)
        outcomes = crew.evaluate(batch, meanwhile=writer.write)
        completed = datetime.now(UTC).replace(tzinfo=None)
        trials = [
            Trial(run.number + i, run.generation, batch[i], outcome, started, completed, stage)
            for i, outcome in enumerate(outcomes)
        ]
        writer.trials = trials
        run.add(trials)
        watch(run.progress)


class _Writer:
    """Holds the `trials` of the last generation until there is time to write them; at the end, whatever it is, there
    is. It has no thread of its own: an error in writing ends the run there and then.
    """

    def __init__(
        self,
        store: Store,
        name: str,
        problem: Problem,
        lease: Lease,
        patience: float | None,
        wait: Callable[[int, str], None],
    ) -> None:
        self._store = store
        self._name = name
        self._problem = problem
        self._lease = lease
        self._patience = SERVER_PATIENCE if patience is None else patience
        self._wait = wait  # told how many trials are in the DB, and what it waits for
        self._away = False  # whether the server did not answer when it was last asked
        self.trials: list[Trial] = []

    def write(self) -> None:
        """Writes what it holds, if anything, in one transaction; waits for a server that does not answer."""
        if self.trials:
            before = self.trials[0].number
            go_on = f"{before} trials are in it; go on with: metaid study run {self._name}"
            keep_trying(self._append, self._patience, self._tell, go_on)
            self._away = False
            self.trials = []

    def _append(self) -> None:
        # A server that goes away in the middle of a commit may have written them all the same.
        if not self._away or self._store.count(self._name) != self.trials[-1].number + 1:
            names, low, high = self._problem.searched[1:]
            self._store.append(self._name, names, low, high, self.trials, guard=self._lease.renew)

    def _tell(self, why: str) -> None:
        self._away = True
        self._wait(self.trials[0].number, why)

    def __enter__(self) -> _Writer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, StorageError) or (error is not None and self._away):
            return
        # An interrupt may come just after the transaction that wrote them.
        if error is None or (self.trials and self._store.count(self._name) == self.trials[0].number):
            self.write()
