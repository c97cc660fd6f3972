"""Arms at full speed: their dynamics, and an episode around MuJoCo's step.

`ArmLoop` runs episodes of a simulated arm. `QuickArm` is what moves one, a state at a time.
"""

from metaid.compiled.spatial.arm_loop import ArmLoop, QuickSpatial, commanded_arm_torques
from metaid.compiled.spatial.arm_model import QuickArm
from metaid.compiled.spatial.dynamics import (
    Frames,
    Space,
    accelerating_torques,
    fill_mass_matrix,
    frames_of,
    joint_torques,
    move_links,
    new_space,
    place_link,
)
from metaid.compiled.spatial.vectors import cross, dot, outward, plus, put, symmetric, triple
