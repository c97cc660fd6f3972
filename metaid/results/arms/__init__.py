"""What a study of an arm found: its base parameters, the verdict, and how well the arm is known."""

from metaid.results.arms.arm_findings import ArmFindings
from metaid.results.arms.arm_snapshot import ArmSnapshot
from metaid.results.arms.arm_tables import arm_trials_table
from metaid.results.arms.arm_verdict import arm_summary, judge_arm
from metaid.results.arms.either import AnySnapshot, judge_any, laws_of, read_any_snapshot, validate_any

__all__ = [
    "AnySnapshot",
    "ArmFindings",
    "ArmSnapshot",
    "arm_summary",
    "arm_trials_table",
    "judge_any",
    "judge_arm",
    "laws_of",
    "read_any_snapshot",
    "validate_any",
]
