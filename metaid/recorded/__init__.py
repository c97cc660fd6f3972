"""What logs of a robot say, for those who have data already: nothing is pushed.

`estimate` reads logs and a nominal robot and says what the logs tell. In steps: `every_run` reads logs,
`chain_model` and `arm_model` say what is unknown, `estimate_records` finds it from short windows by the weak form of
the equations of motion, over bodies that can be, with windows and terms chosen by the error on parts that were left
out. `judge_records` says whether the result can be used.
"""

from metaid.recorded.absolute import Absolute, absolute_of
from metaid.recorded.choosing import Choices
from metaid.recorded.doubts.checks import facts_of
from metaid.recorded.doubts.conventions import Fact
from metaid.recorded.estimating import RecordedEstimate, equations_like, estimate_records
from metaid.recorded.gains import Gains, Payload, drive_gains
from metaid.recorded.held_out import HeldOut
from metaid.recorded.reading.log import Intake, every_run
from metaid.recorded.reading.readings import LogRun
from metaid.recorded.result import Log, estimate
from metaid.recorded.telling.curves import FrictionCurve, GravityCurve, friction_curves, gravity_curves
from metaid.recorded.telling.judging import RecordedVerdict, judge_records
from metaid.recorded.telling.told import FileError, LeftOut, RecordedResult
from metaid.recorded.weak_form.linear_model import TERMS, LinearModel
from metaid.recorded.weak_form.nominal import arm_model, chain_model, model_of
