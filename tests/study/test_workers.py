"""Ray workers that die, hang or are not there: the trials are the same, and what cannot be evaluated is a FAIL."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import ray
from conftest import Finished, matching_spec, what_is_known
from pandas.testing import assert_frame_equal
from ray.cluster_utils import Cluster

from metaid import results
from metaid.episode import Outcome
from metaid.models import Array
from metaid.store import Store
from metaid.study import Problem, create_study, load_study, run_study
from metaid.study.evaluation import RayEvaluator, ThreadEvaluator, engines, ray_actors
from metaid.study.evaluation.shares import LOSSES_ALLOWED

pytestmark = pytest.mark.slow

LONGEST = 600  # s that a test may take on the busiest machine
CHANGES = {"trials": 45, "search.coordinates": "plain", "search.start": 0.8, "episode.fall_limit": 1.0}


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """A Ray cluster on loopback whose head evaluates nothing."""
    os.environ.update(RAY_USAGE_STATS_ENABLED="0", RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO="0")
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    ray.init(address=cluster.address, log_to_driver=False, logging_level="ERROR")
    yield cluster
    ray.shutdown()
    cluster.shutdown()


@pytest.fixture(autouse=True)
def end_of_waiting() -> Iterator[None]:
    """What is tested is that nothing is waited for without end: then a test must not do so either."""
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.alarm(LONGEST)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture
def node(cluster: Cluster) -> Any:
    """A node with room for two workers, the only one."""
    return next(iter(cluster.worker_nodes), None) or cluster.add_node(num_cpus=2)


@pytest.fixture
def problem() -> Problem:
    """Survivors and falls."""
    return Problem(load_study("three-link-coast", CHANGES))


def batch_of(problem: Problem) -> Array:
    """Candidates of which some survive and some fall."""
    return np.random.default_rng(0).uniform(0.5, 1.6, (12, len(problem.names)))


def at_full_strength(evaluator: RayEvaluator, problem: Problem) -> RayEvaluator:
    """The evaluator once all of its workers have started."""
    while len(processes(evaluator)) < 2:
        time.sleep(0.5)  # a worker that evaluates takes the processor from one that starts
        evaluator.evaluate(batch_of(problem))
    return evaluator


def expected(problem: Problem) -> list[Outcome]:
    """What threads make of the batch."""
    with closing(ThreadEvaluator(problem, 1)) as evaluator:
        return evaluator.evaluate(batch_of(problem))


def processes(evaluator: RayEvaluator) -> list[int]:
    """Those of the evaluator's workers."""
    return [actor.location[1] for actor in evaluator._actors if actor.location is not None]


def workers_here() -> set[int]:
    """The processes on this machine that Ray has named after a worker of ours, started or not."""
    commands = {process.pid: process.info["cmdline"] or [""] for process in psutil.process_iter(["cmdline"])}
    return {process for process, command in commands.items() if command[0].startswith("ray::_Worker")}


def test_workers_that_hang_or_are_killed_at_work_are_replaced(node: Any, problem: Problem) -> None:
    """A stopped process is given up after a while and ended, so that another has its place; then SIGKILL of both while
    they evaluate: every outcome is there, the same as any other's.
    """
    with closing(RayEvaluator(problem, 2, None)) as evaluator:
        hanging, _ = processes(at_full_strength(evaluator, problem))
        patience, evaluator._patience = evaluator._patience, 3.0
        evaluator._slowest_candidate = 0.0  # a hundred times that of a worker that starts on a busy machine is minutes
        os.kill(hanging, signal.SIGSTOP)
        assert evaluator.evaluate(batch_of(problem)) == expected(problem)
        assert hanging not in processes(evaluator)
        evaluator._patience = patience
        killed = processes(at_full_strength(evaluator, problem))
        with pytest.raises(ProcessLookupError):
            os.kill(hanging, 0)
        for process in killed:
            os.kill(process, signal.SIGSTOP)  # so that it will not have done its work when it is killed

        def kill() -> None:
            for process in killed:
                os.kill(process, signal.SIGKILL)

        assert evaluator.evaluate(batch_of(problem), while_waiting=kill) == expected(problem)
        assert not set(killed) & set(processes(evaluator))


def test_worker_killed_while_it_starts_is_replaced(node: Any, problem: Problem) -> None:
    """Before it has said where it is, or been given anything."""
    before = workers_here()
    with closing(RayEvaluator(problem, 1, None, patience=120.0)) as evaluator:
        while not (killed := workers_here() - before):
            time.sleep(0.05)  # it starts for a second: a search for it is dear
        for process in killed:
            os.kill(process, signal.SIGKILL)
        assert evaluator.evaluate(batch_of(problem)) == expected(problem)
        assert not killed & set(processes(evaluator))


def test_candidate_that_ends_its_worker_is_a_failure_and_the_search_goes_on(
    node: Any, problem: Problem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A FAIL trial with its reason after bounded tries; a resumed run has the trials of an uninterrupted one."""
    store, spec = Store(str(tmp_path / "metaid.db"), create=True), load_study("three-link-coast", CHANGES)
    for name in ("sound", "failing", "whole"):
        create_study(store, spec, name)
    run_study(store, "sound")
    fatal = store.trials("sound", problem.names)[5].factors
    died = tmp_path / "died"

    class Fatal(ray_actors._Worker):
        def evaluate(self, batch: Array, trials: list[int]) -> tuple[list[Outcome], float]:
            if any(np.array_equal(fatal, candidate) for candidate in batch):
                died.open("a").write("†")
                os.abort()
            return super().evaluate(batch, trials)

    with monkeypatch.context() as patch:
        patch.setattr(ray_actors, "_Worker", Fatal)
        run_study(store, "failing", trials=9, workers=1, engine="ray")
    assert len(died.read_text()) == LOSSES_ALLOWED + 1
    run_study(store, "failing", trials=45)
    failing = results.trials_frame(store, "failing")
    assert failing["number"][failing["state"] == "FAIL"].tolist() == [5]
    reason = store.trials("failing", problem.names)[5].outcome.failure
    assert reason == "its worker's process ended, 3 times"

    class Uninterrupted(ThreadEvaluator):
        def evaluate(
            self, batch: Array, first: int = 0, while_waiting: Callable[[], None] = lambda: None
        ) -> list[Outcome]:
            outcomes = super().evaluate(batch, first, while_waiting)
            for i, candidate in enumerate(batch):
                if np.array_equal(fatal, candidate):
                    outcomes[i] = problem.failed(reason)
            return outcomes

    monkeypatch.setattr(engines, "ThreadEvaluator", Uninterrupted)
    run_study(store, "whole")
    assert_frame_equal(failing, results.trials_frame(store, "whole"), check_exact=True)
    assert not failing.equals(results.trials_frame(store, "sound"))


@pytest.mark.parametrize("noisy", [False, True], ids=["ideal", "noisy"])
def test_estimate_of_what_ray_workers_have_seen_is_the_same(node: Any, noisy: bool, tmp_path: Path) -> None:
    """Windows and readings come back from other processes as they are, to the last bit."""
    store, spec = Store(str(tmp_path / "metaid.db"), create=True), matching_spec(noisy)
    for name, engine in (("local", "local"), ("ray", "ray")):
        create_study(store, spec, name)
        run_study(store, name, workers=1, engine=engine)
    assert store.count("ray") == 4
    assert what_is_known(store, "ray") == what_is_known(store, "local")


def test_nodes_come_and_go_and_the_trials_are_the_same(
    cluster: Cluster, node: Any, problem: Problem, tmp_path: Path
) -> None:
    """Fewer places than workers, the only node removed in mid-run, another added."""
    store, spec = (
        Store(str(tmp_path / "metaid.db"), create=True),
        load_study("three-link-coast", {**CHANGES, "trials": 54}),
    )
    for name in ("local", "ray"):
        create_study(store, spec, name)
    run_study(store, "local")

    def change(progress: Any) -> None:
        if progress.trials == 27:
            cluster.remove_node(node)
            cluster.add_node(num_cpus=1)  # a worker costs seconds to start

    run_study(store, "ray", workers=3, engine="ray", watch=change)
    assert_frame_equal(*(results.trials_frame(store, name) for name in ("local", "ray")), check_exact=True)


def test_run_without_any_node_stops_in_one_line(
    cluster: Cluster,
    metaid: Callable[..., Finished],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """It waits for a while, and says so; then it says how to go on, and the DB is whole."""
    for node in list(cluster.worker_nodes):
        cluster.remove_node(node)
    metaid("study", "create", "three-link-coast", "--set", "trials=45")
    run_study(Store("metaid.db"), "three-link-coast", trials=18)
    monkeypatch.setattr(ray_actors, "WARN_AFTER", 0.5)
    stopped = metaid("study", "run", "three-link-coast", "--engine", "ray", "--patience", "2", "--quiet")
    assert stopped.status == 2
    assert caplog.messages == ["no Ray worker yet: waiting for one, 2 s at most"]
    how = "18 trials are in metaid.db; go on with: metaid study run three-link-coast"
    assert stopped.err == f"metaid: no Ray worker for 2 s; {how}\n"
    assert metaid("study", "run", "three-link-coast", "--quiet").status == 0
