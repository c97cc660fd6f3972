"""A study as the DB has it, of a chain or of an arm, and the verdict on it."""

from __future__ import annotations

import numpy as np

from metaid.errors import StorageError
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant.arms import ArmPlant
from metaid.results.arms.arm_snapshot import ArmSnapshot
from metaid.results.arms.arm_validation import validate_arm
from metaid.results.arms.arm_verdict import judge_arm, laws
from metaid.results.snapshot import Snapshot, read_snapshot
from metaid.results.validation import PUSHES, Validation, validate_chain
from metaid.results.verdict import Verdict, judge
from metaid.store import Store
from metaid.study import ENDED_KEY, ArmSpec, stored_spec
from metaid.study.estimates import kept_with

AnySnapshot = Snapshot | ArmSnapshot


def read_any_snapshot(store: Store, name: str) -> AnySnapshot:
    """The study of that `name`, its trials read at once.  Raises StorageError."""
    spec = stored_spec(store, name)
    if not isinstance(spec, ArmSpec):
        return read_snapshot(store, name)
    stored = store.read(name, spec.names)
    return ArmSnapshot(name, spec, stored.own, stored.foreign, store.attribute(name, ENDED_KEY), kept_with(store, name))


def judge_any(snapshot: AnySnapshot) -> Verdict:
    """The verdict on a study as it is in the DB."""
    return judge_arm(snapshot) if isinstance(snapshot, ArmSnapshot) else judge(snapshot)


def validate_any(snapshot: AnySnapshot, pushes: int = PUSHES, seed: int = 0) -> Validation:
    """Coasting and tracking with the identified model of a study, and with the nominal one and the true one beside.

    Args:
        snapshot: of the study.
        pushes: how many pushes, which the search never used.
        seed: of these pushes.

    Raises:
        StudyError: nothing was found, the plant is a rig, or the number of pushes or the seed is not allowed.
    """
    if isinstance(snapshot, ArmSnapshot):
        return validate_arm(snapshot, judge_arm(snapshot), pushes, seed)
    return validate_chain(snapshot, judge(snapshot), pushes, seed)


def laws_of(store: Store, name: str, arm: ArmPlant) -> tuple[Tree, dict[str, Array]]:
    """The nominal arm of the study of that `name`, and its `laws`.  Raises StorageError where that is about another
    plant than this `arm`.
    """
    snapshot = read_any_snapshot(store, name)
    if not isinstance(snapshot, ArmSnapshot) or not _is_same(snapshot.problem.make_plant().tree, arm.tree):
        raise StorageError(f"study '{name}' is about the plant {snapshot.spec.plant_name}, not about {arm.name}")
    return snapshot.problem.nominal, laws(snapshot, judge_arm(snapshot))


def _is_same(one: Tree, other: Tree) -> bool:
    """Whether two arms are the same to rounding."""
    pairs = (one.position, other.position), (one.parameters, other.parameters)
    return one.names == other.names and all(np.allclose(*pair, rtol=1e-6, atol=1e-12) for pair in pairs)
