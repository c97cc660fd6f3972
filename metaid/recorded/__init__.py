"""What logs of a robot say, for those who have data already: nothing is pushed.

`identify` reads logs and a nominal robot and says what the logs tell. In steps: `read_record` reads a log,
`chain_model` and `arm_model` say what is unknown, `estimate_records` finds it from short windows by the weak form of
the equations of motion, over bodies that can be, with windows and terms chosen by the error on parts that were left
out. `judge_records` says whether the result can be used.
"""

from metaid.recorded.checks import Fact, facts_of
from metaid.recorded.choosing import Choices
from metaid.recorded.estimate import RecordedEstimate, estimate_records
from metaid.recorded.friction_curve import FrictionCurve, friction_curves
from metaid.recorded.held_out import HeldOut
from metaid.recorded.judging import RecordedVerdict, judge_records
from metaid.recorded.laws import law_torques
from metaid.recorded.linear_model import TERMS, LinearModel, arm_model, chain_model
from metaid.recorded.log import Record, read_record
from metaid.recorded.model_files import FileError
from metaid.recorded.result import Log, RecordedResult, identify

__all__ = [
    "TERMS",
    "Choices",
    "Fact",
    "FileError",
    "FrictionCurve",
    "HeldOut",
    "LinearModel",
    "Log",
    "Record",
    "RecordedEstimate",
    "RecordedResult",
    "RecordedVerdict",
    "arm_model",
    "chain_model",
    "estimate_records",
    "facts_of",
    "friction_curves",
    "identify",
    "judge_records",
    "law_torques",
    "read_record",
]
