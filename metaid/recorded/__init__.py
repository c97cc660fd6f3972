"""What a rig's log says of it, for those who have data already: no plant is pushed.

`read_record` reads a log, `linear_model` says what is unknown, and `estimate_record` finds it from short windows of the
log by the weak form of the equations of motion, which is linear and needs no accelerations. `judge_record` says which
of it the log has told.
"""

from metaid.recorded.estimate import Choices, RecordedEstimate, estimate_record
from metaid.recorded.judging import RecordedVerdict, judge_record, record_summary
from metaid.recorded.laws import law_torques
from metaid.recorded.linear_model import FRICTION, TERMS, LinearModel, arm_model, chain_model
from metaid.recorded.log import Record, read_record
from metaid.recorded.result import RecordedResult, identify_record
from metaid.recorded.taking_out import recorded_identified_model

__all__ = [
    "FRICTION",
    "TERMS",
    "Choices",
    "LinearModel",
    "Record",
    "RecordedEstimate",
    "RecordedResult",
    "RecordedVerdict",
    "arm_model",
    "chain_model",
    "estimate_record",
    "identify_record",
    "judge_record",
    "law_torques",
    "read_record",
    "record_summary",
    "recorded_identified_model",
]
