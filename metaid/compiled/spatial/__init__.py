"""Arms at full speed: their dynamics, an episode around MuJoCo's step, and the twins that an estimate compares.

`ArmLoop` runs episodes of a simulated arm. `follow_laws` and `follow_torques` run simulated twins.
`arm_coasting_steps` and `track_arm` say what a model is worth.
"""

from metaid.compiled.spatial.arm_loop import ArmLoop, commanded_arm_torques
from metaid.compiled.spatial.arm_validation import arm_coasting_steps, track_arm
from metaid.compiled.spatial.dynamics import Frames, frames_of
from metaid.compiled.spatial.filters import DrivenPushes, follow_readings, lead_arm
from metaid.compiled.spatial.twins import (
    EULER,
    MIDPOINT,
    RUNGE_KUTTA,
    Followed,
    Times,
    follow_laws,
    follow_torques,
)

__all__ = [
    "EULER",
    "MIDPOINT",
    "RUNGE_KUTTA",
    "ArmLoop",
    "DrivenPushes",
    "Followed",
    "Frames",
    "Times",
    "arm_coasting_steps",
    "commanded_arm_torques",
    "follow_laws",
    "follow_readings",
    "follow_torques",
    "frames_of",
    "lead_arm",
    "track_arm",
]
