"""The laws of a study that are compared: the nominal one, what was identified, and the true one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from metaid.errors import StorageError
from metaid.results.snapshot import Snapshot, read_snapshot
from metaid.store import Store
from metaid.study import Problem


def identified_law(snapshot: Snapshot) -> Any:
    """The law of what was sought, as identified. What a best trial says nothing of is as beforehand."""
    verdict = snapshot.verdict
    return snapshot.problem.robot.law_at(dict(zip(verdict.lumps["name"], verdict.values.tolist(), strict=True)))


def law_error(problem: Problem, law: Any) -> dict[str, float] | None:
    """How wrong a law is on states that no trial has seen; None where that is not known."""
    error = problem.robot.model_error(law)
    return None if error is None else asdict(error)


def candidates(snapshot: Snapshot) -> dict[str, Any]:
    """Laws by name: `nominal`, `identified`, and `true` where that is known. Where nothing was identified there is the
    `best trial` in place of the identified one, if any trial did not fall.
    """
    problem, best = snapshot.problem, snapshot.best
    found = {}
    if snapshot.verdict.shown["identified"].notna().any():
        found["identified"] = identified_law(snapshot)
    elif best is not None:
        found["best trial"] = problem.robot.differ_from.law_of(best.factors)
    return with_references(problem, found)


def with_references(problem: Problem, laws: Mapping[str, Any]) -> dict[str, Any]:
    """These `laws` by name between the `nominal` one and the `true` one, where that is known."""
    true = problem.robot.true_law()
    return {"nominal": problem.robot.differ_from.law, **laws, **({} if true is None else {"true": true})}


def candidates_of(store: Store, name: str, plant: Any) -> tuple[Problem, dict[str, Any]]:
    """What follows from the study of that `name`, and its `candidates`.  Raises StorageError where it is about another
    plant than this one.
    """
    snapshot = read_snapshot(store, name)
    if not snapshot.problem.robot.is_about(plant):
        raise StorageError(f"study '{name}' is about the plant {snapshot.spec.plant_name}, not about {plant.name}")
    return snapshot.problem, candidates(snapshot)
