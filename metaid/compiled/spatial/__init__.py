"""Arms at full speed: their dynamics, and an episode around MuJoCo's step.

`ArmLoop` runs episodes of a simulated arm. `track_arm` drives one along a motion.
"""

from metaid.compiled.spatial.arm_loop import ArmLoop, QuickSpatial, commanded_arm_torques
from metaid.compiled.spatial.arm_validation import track_arm
from metaid.compiled.spatial.dynamics import (
    Frames,
    Space,
    accelerating_torques,
    factorise,
    fill_mass_matrix,
    frames_of,
    move_links,
    new_space,
    solve,
)
from metaid.compiled.spatial.vectors import cross, dot, inward, plus, symmetric, triple
