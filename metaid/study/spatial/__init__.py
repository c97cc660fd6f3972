"""Studies of serial arms: what their files say, and what follows from that before any trial.

An arm is known by its base parameters. Candidates are these, in SI units. A trial sends the law of one candidate on
pushes that coast and on pushes that swing as on springs.
"""

from metaid.study.spatial.identifiability import ArmIdentifiability, arm_identifiability, arm_rehearsal
from metaid.study.spatial.nominal import drawn_nominal
from metaid.study.spatial.problem import ArmProblem
from metaid.study.spatial.reading import arm_spec
from metaid.study.spatial.settings import (
    ArmEstimateSettings,
    ArmSearchSettings,
    ArmSpec,
    ArmStudySettings,
    DrawnNominalSettings,
)

__all__ = [
    "ArmEstimateSettings",
    "ArmIdentifiability",
    "ArmProblem",
    "ArmSearchSettings",
    "ArmSpec",
    "ArmStudySettings",
    "DrawnNominalSettings",
    "arm_identifiability",
    "arm_rehearsal",
    "arm_spec",
    "drawn_nominal",
]
