"""The identified model of a study as files to use elsewhere: plant file, MJCF, URDF, the law in Python and C, JSON.

`identified_model` reads it from a study; `chain_dynamics` and `arm_dynamics` make what is written of lumps or base
parameters alone.
"""

from metaid.results.arms import AnySnapshot, ArmSnapshot
from metaid.results.exporting.arm_studies import identified_arm
from metaid.results.exporting.chain_studies import identified_chain
from metaid.results.exporting.dynamics import Dynamics, arm_dynamics, chain_dynamics
from metaid.results.exporting.identified import SUFFIXES, IdentifiedModel, covariance_frame

__all__ = [
    "SUFFIXES",
    "Dynamics",
    "IdentifiedModel",
    "arm_dynamics",
    "chain_dynamics",
    "covariance_frame",
    "identified_model",
]


def identified_model(snapshot: AnySnapshot) -> IdentifiedModel:
    """What a study identified.  Raises StudyError where it identified nothing, and says why."""
    return identified_arm(snapshot) if isinstance(snapshot, ArmSnapshot) else identified_chain(snapshot)
