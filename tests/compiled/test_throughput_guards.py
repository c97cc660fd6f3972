"""What keeps a large study as fast and as small as a new one, without a clock: how often, how much, how many."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import sqlalchemy as sa
from conftest import Finished

from benchmarks import common, study
from metaid.episode import Outcome
from metaid.store import Store, Trial
from metaid.study import Problem, create_study, load_study, run_study

pytestmark = pytest.mark.slow

GENERATION = 9  # of cmaes at three links


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """A study DB with one study, `study`, without trials."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, load_study("three-link-coast"), "study")
    return store


def test_a_generation_takes_as_many_statements_late_as_early(store: Store) -> None:
    """Nothing is asked of the DB trial by trial, nor more of it as it grows."""
    statements, per_generation = [], []
    sa.event.listen(store._engine, "before_cursor_execute", lambda *about: statements.append(about[2]))

    def look(_progress: object) -> None:
        per_generation.append(len(statements))
        statements.clear()

    run_study(store, "study", trials=20 * GENERATION, watch=look)
    assert len(set(per_generation[2:])) == 1
    assert per_generation[-1] <= GENERATION


def test_the_end_of_a_study_is_found_without_walking_its_trials(store: Store) -> None:
    """Looking up a study's last trial sorts nothing and scans no table."""
    seen = []
    sa.event.listen(store._engine, "before_cursor_execute", lambda *about: seen.append(about[2:4]))
    run_study(store, "study", trials=GENERATION)
    assert store.count("study") == GENERATION
    with store._engine.connect() as connection:
        statement, values = seen[-1]
        plan = " ".join(row[-1] for row in connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}", values))
    assert "SEARCH" in plan
    assert "SCAN" not in plan
    assert "TEMP B-TREE" not in plan


def test_a_run_keeps_a_generation_and_not_all_of_its_trials(store: Store) -> None:
    """What is written and told is let go, resumed runs included."""
    alive = []

    def look(_progress: object) -> None:
        gc.collect()
        alive.append(sum(type(thing) is Trial for thing in gc.get_objects()))

    run_study(store, "study", trials=4 * GENERATION)
    gc.collect()
    run_study(store, "study", trials=8 * GENERATION, watch=look)
    assert max(alive[2:]) <= 2 * GENERATION + 1


def test_an_interrupted_run_has_written_all_that_was_seen(store: Store) -> None:
    """The generation that waited to be written is in the DB, and the study goes on to the same trials as another."""

    def look(progress) -> None:  # type: ignore[no-untyped-def]
        if progress.trials == 3 * GENERATION:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(store, "study", watch=look)
    assert store.count("study") == 3 * GENERATION
    run_study(store, "study", trials=5 * GENERATION)
    create_study(store, load_study("three-link-coast"), "other")
    run_study(store, "other", trials=5 * GENERATION)
    names = Problem(load_study("three-link-coast")).names
    for one, other in zip(store.trials("study", names), store.trials("other", names), strict=True):
        assert one.factors.tobytes() == other.factors.tobytes()
        assert one.outcome == other.outcome


def test_trials_are_read_back_as_they_were_written(tmp_path: Path) -> None:
    """Every number to the last bit, in order, when studies have written by turns into one DB."""
    store, spec = Store(str(tmp_path / "metaid.db"), create=True), load_study("three-link-coast")
    problem, random = Problem(spec), np.random.default_rng(0)
    written: dict[str, list[Trial]] = {"one": [], "two": []}
    for name in written:
        create_study(store, spec, name)
    for generation in range(5):
        for name, trials in written.items():
            fresh = [
                Trial(
                    number=len(trials) + i,
                    generation=generation,
                    factors=random.uniform(0.5, 2.0, len(problem.names)),
                    outcome=Outcome(
                        random.uniform(), bool(random.integers(2)), int(random.integers(1000)), (1, 22, 333)
                    ),
                )
                for i in range(7)
            ]
            store.append(name, problem.names, problem.low, problem.high, fresh)
            trials += fresh
    for name, trials in written.items():
        for wrote, read in zip(trials, store.trials(name, problem.names), strict=True):
            assert (wrote.number, wrote.generation, wrote.outcome) == (read.number, read.generation, read.outcome)
            assert wrote.factors.tobytes() == read.factors.tobytes()


@pytest.mark.parametrize(("trials", "advised"), [(2000, False), (2001, True)])
def test_a_long_tpe_study_is_advised_against(metaid: Callable[..., Finished], trials: int, advised: bool) -> None:
    """One line on stderr, and the study is made nevertheless."""
    made = metaid("study", "create", "two-link-tpe", "--set", f"trials={trials}")
    assert made.status == 0
    assert made.err.count("\n") == int(advised)
    assert ("advised" in made.err) == advised
    assert metaid("study", "show", "two-link-tpe", "--json").status == 0


def test_benchmark_compares_the_same_episodes() -> None:
    """The script that metaid is compared with gives the same candidates the same values, falls at the same steps."""
    for nlink in (3, 5):
        study.check_same(common.make_spec(nlink))
