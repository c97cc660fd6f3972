"""The description of a robot, an MJCF or URDF as its users have it, read as a serial arm.

MuJoCo compiles the user's whole file. What hangs on one moving joint becomes one link of a `Tree`, and an `ArmPlant`
simulates a lean model that `build_arm_spec` makes of the tree alone; `set_parameters` makes it a candidate's. MuJoCo is
loaded with this package.
"""

from metaid.plant.description.reading import Arm, read_arm
from metaid.plant.description.shapes import rod, surfaces
from metaid.plant.description.starts import CLEARANCE, Clearance, draw_free_starts, draw_starts
from metaid.plant.lean import arm_model, build_arm_spec, build_spec, set_parameters
