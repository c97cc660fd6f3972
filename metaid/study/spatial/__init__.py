"""Studies of serial arms: what follows from their settings before any trial.

An arm is known by its base parameters. Candidates are these, in SI units. A trial sends the law of one candidate on
pushes that coast and on pushes that swing as on springs.
"""

from metaid.study.spatial.identifiability import ArmIdentifiability, arm_identifiability, arm_rehearsal
from metaid.study.spatial.problem import ArmProblem

__all__ = ["ArmIdentifiability", "ArmProblem", "arm_identifiability", "arm_rehearsal"]
