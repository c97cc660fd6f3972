"""A study as the DB has it, of a chain or of an arm, and the verdict on it."""

from __future__ import annotations

from metaid.results.arms.arm_snapshot import ArmSnapshot
from metaid.results.arms.arm_validation import validate_arm
from metaid.results.arms.arm_verdict import judge_arm
from metaid.results.snapshot import Snapshot, read_snapshot
from metaid.results.validation import PUSHES, Validation, validate_chain
from metaid.results.verdict import Verdict, judge
from metaid.store import Store
from metaid.study import ENDED_KEY, ArmSpec, stored_spec

AnySnapshot = Snapshot | ArmSnapshot


def read_any_snapshot(store: Store, name: str) -> AnySnapshot:
    """The study of that `name`, its trials read at once.  Raises StorageError."""
    spec = stored_spec(store, name)
    if not isinstance(spec, ArmSpec):
        return read_snapshot(store, name)
    stored = store.read(name, *spec.names)
    return ArmSnapshot(name, spec, stored.own, stored.foreign, store.attribute(name, ENDED_KEY))


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
