"""The same episode at full speed: one compiled function around MuJoCo's stages.

`Objective` evaluates candidates with the fastest loop that a plant has. numba and MuJoCo are loaded with this package.
"""

from metaid.compiled.arm_push import ArmPush, push_arm
from metaid.compiled.decorator import choose, compiled, fused, is_compiling
from metaid.compiled.fastest import agrees_with_stepwise, fastest_loop
from metaid.compiled.faulty_loop import FaultyLoop
from metaid.compiled.kalman import (
    Filtered,
    Spread,
    correct,
    keep_gain,
    keep_step,
    likelihood_about,
    run_of,
    spread_of,
    weigh,
    widen,
)
from metaid.compiled.loop import CompiledLoop
from metaid.compiled.objective import Objective
from metaid.compiled.products import BLOCK, LANES, factorise, multiply, solve, solve_rows, whole
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.sharing import share_out
from metaid.compiled.stages import Step, fastest_step, step_of
