"""Faults of a plant that an estimate may search beside the lumps: their names, their units, and what they truly are.

`delay`: by how long torques come late. `lag`: the time constant of the motors. `tilt`: of the base. `offset`: what each
encoder reads where its joint is straight. `viscous`, `dry`: friction in each joint; `presliding`: the angle over which
dry friction builds up. `spring`: the stiffness of a spring in each joint, at rest where the joint is straight. `bias`:
a torque that each motor adds, whatever it is told. `cogging`: what it adds by its angle q, a cos kq + b sin kq, k times
a turn, by a and b. `rotor`: the reflected inertia of what turns with each joint from
the second on; that of the first is one with its link. `gain`: the torque of each motor from the second on, as a
multiple of what was commanded, where that of the first is taken for 1. A common factor of all motors shows nowhere: all
lumps times the same would move alike. `limit`: the largest torque of each motor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from metaid.models import Array, kind_of
from metaid.plant.arm_plant import ArmPlant
from metaid.plant.faults import of_each
from metaid.plant.mujoco_plant import MujocoPlant

FAULT_UNITS = {
    "delay": "s",
    "lag": "s",
    "tilt": "rad",
    "offset": "rad",
    "viscous": "N m s",
    "dry": "N m",
    "presliding": "rad",
    "spring": "N m/rad",
    "bias": "N m",
    "cogging": "N m",
    "rotor": "kg m²",
    "gain": "1",
    "limit": "N m",
}
OF_PLANT = ("delay", "lag", "tilt", "presliding")  # the others are of each joint
FROM_SECOND = ("rotor", "gain")  # of joints from the second on


def fault_names(kinds: Sequence[str], njoint: int, tilts: int = 1) -> list[str]:
    """`delay`, `tilt`, `viscous_1` … `viscous_n`, `gain_2` … `gain_n` and so on, by `kinds`; `tilt_x` and `tilt_y` of a
    base that may tilt about two axes.
    """
    names: list[str] = []
    for kind in kinds:
        joints = range(2 if kind in FROM_SECOND else 1, njoint + 1)
        own = [f"{kind}_{joint}" for joint in joints]
        if kind == "cogging":
            own = [f"cogging_{part}_{joint}" for part in ("cos", "sin") for joint in joints]
        names += ["tilt_x", "tilt_y"] if (kind, tilts) == ("tilt", 2) else [kind] if kind in OF_PLANT else own
    return names


def fault_unit(name: str) -> str:
    """The SI unit of a fault, by its name."""
    return FAULT_UNITS[kind_of(name)]


def true_faults(plant: MujocoPlant | ArmPlant, kinds: Sequence[str]) -> Array:
    """What the faults of these `kinds` (nfault) of a simulated plant are, in the order of `fault_names`; NaN where its
    file keeps the truth. Friction of an arm is none of its faults.
    """
    faults, n = plant.settings.faults, plant.njoint
    gains = of_each(faults.torque_gain, n)
    true = {
        "delay": np.array([faults.delay * faults.control_period(plant.timestep)]),
        "tilt": of_each(faults.tilt, plant.tilts),
        "offset": of_each(faults.encoder_offset, n),
        "gain": gains[1:] / gains[0],
        "limit": np.where(np.isfinite(limits := of_each(faults.torque_limit, n)), limits, np.nan),
        **plant.hidden_forces,
    }
    none = {kind: np.zeros(len(fault_names((kind,), n, plant.tilts))) for kind in kinds}  # of what no file can say
    values = np.concatenate([np.empty(0), *(true.get(kind, nothing) for kind, nothing in none.items())])
    return values if plant.settings.truth_known else np.full(len(values), np.nan)
