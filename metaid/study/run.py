"""A study run a generation at a time, resumed by replaying what the DB holds.

The trial table depends on the study's settings and seed alone. On another kind of processor, or with another BLAS, it
is the same to rounding. So a study says what it was begun with. The searcher proposes a generation, the workers
evaluate it, and the searcher gets the outcomes. The store writes it in one transaction while the workers are at the
next. A run that was stopped anywhere goes on from the last whole generation in the DB.
"""

from __future__ import annotations

import logging
import platform
from collections.abc import Callable
from contextlib import closing
from copy import copy
from dataclasses import replace
from datetime import UTC, datetime

from threadpoolctl import threadpool_info, threadpool_limits

from metaid.errors import PlantError, StorageError, StudyError, printable
from metaid.models import Array
from metaid.store import Lease, Store, Trial
from metaid.study.create import stored_spec
from metaid.study.estimates import keep_estimate
from metaid.study.evaluation import Evaluator, make_evaluator
from metaid.study.forecast import refuse_until
from metaid.study.loading import problem_of
from metaid.study.problem import MOST_TRIALS, Problem
from metaid.study.progress import Progress, Run
from metaid.study.spec import StudySpec
from metaid.study.writer import Writer

ARITHMETIC_KEY = "metaid:arithmetic"  # of a study: what its first trials were made with
ENDED_KEY = "metaid:ended"  # of a study: with how many trials its search had nothing left to do
MOST_FAILURES = 2  # trials on a rig, one after the other: it is not to be moved any more

log = logging.getLogger("metaid")


def arithmetic() -> str:
    """What rounds here: the kind of processor, and the BLAS with the kernels that it has chosen for it."""
    import scipy.linalg  # noqa: F401, SciPy has a BLAS of its own, which is to be named whether it is loaded yet or not

    blas = [library for library in threadpool_info() if library["user_api"] == "blas"]
    named = {" ".join(str(library.get(key)) for key in ("internal_api", "version", "architecture")) for library in blas}
    return ", ".join([platform.machine(), *sorted(named)])


def run_study(
    store: Store,
    name: str,
    trials: int | None = None,
    workers: int | None = None,
    engine: str = "local",
    ray_address: str | None = None,
    watch: Callable[[Progress], None] = lambda progress: None,
    patience: float | None = None,
    until: float | None = None,
) -> Progress:
    """Runs a study, or goes on with it, until the DB holds all its trials or the searcher is finished.

    A KeyboardInterrupt leaves the DB at the last generation that `watch` saw. A kill may lose that one.

    Args:
        store: the study DB.
        name: of the study in the DB.
        trials: in all, those in the DB included; default: the study's, or with `until` as many as an estimate is made
            of.
        workers: that evaluate; default: the study's.
        engine: "local", for threads of this process, or "ray".
        ray_address: of a running Ray cluster; default: one on this machine.
        watch: called with the progress after each generation, and once a second while a DB server does not answer.
        patience: s after which a silent Ray worker or DB server is given up; default: 120 and 300.
        until: a share; the run ends once all lumps at once are known to it with 95 %, and not where intervals stop
            shrinking.

    Returns:
        The progress at the end.

    Raises:
        StudyError: the number of trials or workers is not allowed, or the engine cannot be used.
        StorageError: the DB cannot be used, its trials do not follow from the settings, or another driver runs the
            study.
        PlantError: two trials on a rig failed, one after the other.
        WorkerError: workers were lost again and again.
    """
    spec = stored_spec(store, name)
    if until is not None:
        refuse_until(spec, until)
    planned = spec.study.trials if until is None else MOST_TRIALS
    total = planned if trials is None else trials
    workers = spec.study.workers if workers is None else workers
    if total < 1 or workers < 1:
        raise StudyError(f"trials is {total} and workers is {workers} (allowed: 1 or more of each)")
    if not spec.is_simulated and workers != 1:
        raise StudyError(f"plant {spec.plant_name} is one rig: workers is {workers} (allowed: 1)")
    store.check()
    # At these sizes BLAS threads cost far more than they give.
    with threadpool_limits(1), Lease(store, name) as lease:
        run = _replayed(store, name, spec, total, until)
        watch(run.progress)

        def wait(trials: int, why: str) -> None:
            watch(replace(run.progress, trials=trials, waiting=why))

        if not run.done:
            with (
                closing(make_evaluator(run.problem, engine, workers, ray_address, patience)) as evaluator,
                Writer(lease, run.problem, patience, wait) as writer,
            ):
                _finish(run, evaluator, writer, watch)
        if run.number < total and store.attribute(name, ENDED_KEY) != run.number:
            store.set_attribute(name, ENDED_KEY, run.number)
        keep_estimate(lease, problem_of(spec))
    store.check_written(name, run.number)
    return run.progress


def _replayed(store: Store, name: str, spec: StudySpec, total: int, until: float | None) -> Run:
    stored = store.trials(name, spec.names)
    # A run moves bounds, and what follows from the settings is not to be changed.
    run, here = Run(copy(problem_of(spec)), max(total, len(stored)), until), arithmetic()
    if not stored:
        store.set_attribute(name, ARITHMETIC_KEY, here)
        return run
    begun = store.attribute(name, ARITHMETIC_KEY)
    begun = printable(begun[:200]) if isinstance(begun, str) and begun != here else None
    try:
        run.replay(stored, f"{store.url}: study '{name}'")
    except StorageError as problem:
        if begun is None:
            raise
        raise StorageError(f"{problem}, or begun with other arithmetic ({begun}; this is {here})") from None
    if begun is not None and not run.done:
        log.warning(
            "study '%s' was begun with other arithmetic (%s; this is %s): "
            "its trials are now those of an undisturbed run to rounding, not to the last bit",
            printable(name),
            begun,
            here,
        )
    return run


def _finish(run: Run, evaluator: Evaluator, writer: Writer, watch: Callable[[Progress], None]) -> None:
    """Goes on with a run until it is done."""
    problem = run.problem
    budget = problem.trials_with_windows, problem.trials_with_readings
    failures = 0
    while not run.done:
        batch = run.candidates()
        if not problem.spec.is_simulated:
            batch = batch[:1]  # a rig's episodes are dear: each is kept, whatever becomes of the next
        started = datetime.now(UTC).replace(tzinfo=None)
        outcomes = evaluator.evaluate(batch, run.number, writer.write)
        completed = datetime.now(UTC).replace(tzinfo=None)
        trials = [
            Trial(run.number + i, run.generation, batch[i], outcome, started, completed)
            for i, outcome in enumerate(outcomes)
        ]
        trials = [within_budget(trial, *budget) for trial in trials]
        writer.trials = trials
        before = problem.low, problem.high
        run.add(trials)
        if moved := _moved_bounds(problem, *before):
            log.warning("bounds held the search back and are moved: %s", moved)
        watch(run.progress)
        if not problem.spec.is_simulated:
            failures = failures + 1 if trials[-1].outcome.failure is not None else 0
            _refuse_more_failures(failures, trials[-1], problem.spec.plant_name)


def _moved_bounds(problem: Problem, low: Array, high: Array) -> str:
    """Which bounds of a study are no longer what they were, `low` and `high` (nlump each); empty where none is."""
    sides = ("low", low, problem.low), ("high", high, problem.high)
    return ", ".join(
        f"search.{side} of {name} from {was:g} to {now:g}"
        for side, before, after in sides
        for name, was, now in zip(problem.names, before.tolist(), after.tolist(), strict=True)
        if was != now
    )


def _refuse_more_failures(failures: int, last: Trial, plant: str) -> None:
    """Ends a run on a rig that has failed as many trials, one after the other, up to the `last`.  Raises PlantError."""
    if failures == MOST_FAILURES:
        raise PlantError(
            f"the last {failures} trials on the rig '{plant}' failed, so the run ends; trial {last.number}: "
            f"{last.outcome.failure}; once the rig is mended, the same command goes on"
        )


def within_budget(trial: Trial, windows: int, readings: int) -> Trial:
    """The trial without its windows unless it is one of the first `windows`, and readings likewise."""
    shown = trial.outcome.windows if trial.number < windows else None
    read = trial.outcome.readings if trial.number < readings else None
    return replace(trial, outcome=replace(trial.outcome, windows=shown, readings=read))
