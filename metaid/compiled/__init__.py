"""The same episode at full speed: one compiled function around MuJoCo's stages.

`Objective` evaluates candidates with the fastest loop that a plant has. numba and MuJoCo are loaded with this package.
"""

from metaid.compiled.decorator import compiled, fused
from metaid.compiled.faulty_loop import FaultyLoop
from metaid.compiled.kalman import Spread, add_noise, correct, spread_of, transpose, weigh
from metaid.compiled.loop import CompiledLoop, fastest_step
from metaid.compiled.objective import LARGEST_FACTOR, Objective
from metaid.compiled.quiet import quiet_mujoco
from metaid.compiled.stages import DirectStep, MujocoStep, mujoco_step
from metaid.compiled.validation_loops import coasting_steps, track_compiled

__all__ = [
    "LARGEST_FACTOR",
    "CompiledLoop",
    "DirectStep",
    "FaultyLoop",
    "MujocoStep",
    "Objective",
    "Spread",
    "add_noise",
    "coasting_steps",
    "compiled",
    "correct",
    "fastest_step",
    "fused",
    "mujoco_step",
    "quiet_mujoco",
    "spread_of",
    "track_compiled",
    "transpose",
    "weigh",
]
