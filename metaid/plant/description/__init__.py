"""The description of a robot, an MJCF or URDF as its users have it, read as a serial arm.

MuJoCo compiles the user's whole file. What hangs on one moving joint becomes one link of a `Tree`, and an `ArmPlant`
simulates a lean model that `build_arm_spec` makes of the tree alone; `set_parameters` makes it a candidate's. MuJoCo is
loaded when an arm is first looked at.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metaid.plant.description.lean import arm_model, build_arm_spec, build_spec, set_parameters
    from metaid.plant.description.reading import Arm, read_arm
    from metaid.plant.description.shapes import Surface, rod, surfaces
    from metaid.plant.description.starts import CLEARANCE, Clearance, draw_free_starts, draw_starts


_LOADS_MUJOCO = {"Arm": "reading", "read_arm": "reading"}
_LOADS_MUJOCO |= dict.fromkeys(("CLEARANCE", "Clearance", "draw_free_starts", "draw_starts"), "starts")
_LOADS_MUJOCO |= dict.fromkeys(("Surface", "rod", "surfaces"), "shapes")
_LOADS_MUJOCO |= dict.fromkeys(("arm_model", "build_arm_spec", "build_spec", "set_parameters"), "lean")


def __getattr__(name: str) -> Any:
    if name in _LOADS_MUJOCO:
        return getattr(import_module(f"metaid.plant.description.{_LOADS_MUJOCO[name]}"), name)
    raise AttributeError(f"module 'metaid.plant.description' has no attribute '{name}'")
