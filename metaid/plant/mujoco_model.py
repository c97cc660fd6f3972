"""The lean MuJoCo model of a chain, and its state.

MuJoCo is loaded with this module, so a plant imports it when it first moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.errors import PlantError, usable_mujoco
from metaid.models import Chain

with usable_mujoco():
    import mujoco


def build_spec(chain: Chain, gravity: float, timestep: float, tilt: float = 0.0) -> mujoco.MjSpec:
    """A lean MuJoCo chain: hinges about y, explicit inertials, nothing that an episode can do without. What is drawn is
    this with shapes added (`show/scene.py`), so it moves alike.

    Args:
        chain: the links; body i of the spec is named `link_i`, from 1.
        gravity: in m/s².
        timestep: in s.
        tilt: of the base, in rad, positive towards positive angles.

    Autoreset is off: a diverged episode must not silently restart. Euler: a torque is written once a step
    (docs/method.md). Viscous friction is explicit, at the speed that a step begins with, as the law's is; dry friction
    is a constraint, so only a chain that has some is given MuJoCo's solver.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.gravity = [gravity * np.sin(tilt), 0.0, -gravity * np.cos(tilt)]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    off = mujoco.mjtDisableBit
    spec.option.disableflags = int(
        (0 if chain.coulomb.any() else off.mjDSBL_CONSTRAINT)
        | off.mjDSBL_CONTACT
        | off.mjDSBL_AUTORESET
        | off.mjDSBL_SENSOR
        | off.mjDSBL_ACTUATION
        | off.mjDSBL_EULERDAMP
    )
    body, height = spec.worldbody, 0.0
    for i in range(chain.nlink):
        body = body.add_body(
            name=f"link_{i + 1}",
            pos=[0.0, 0.0, height],
            mass=chain.mass[i],
            ipos=[0.0, 0.0, chain.com[i]],
            inertia=[chain.inertia[i]] * 3,
            explicitinertial=True,
        )
        body.add_joint(
            name=f"joint_{i + 1}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0.0, 1.0, 0.0],
            damping=[chain.damping[i], 0.0, 0.0],
            frictionloss=chain.coulomb[i],
            stiffness=[chain.stiffness[i], 0.0, 0.0],
        )
        height = chain.length[i]
    return spec


@dataclass(frozen=True, eq=False)
class Simulation:
    """A compiled `model` and its state, `data`."""

    model: mujoco.MjModel
    data: mujoco.MjData

    def reset(self) -> None:
        """Back to rest upright; nothing is left of the motion before."""
        mujoco.mj_resetData(self.model, self.data)

    def step(self) -> None:
        """Lets one timestep pass."""
        mujoco.mj_step(self.model, self.data)


def simulate(name: str, chain: Chain, gravity: float, timestep: float, tilt: float) -> Simulation:
    """A simulation of the plant of that `name`, at rest upright.

    Args:
        name: of the plant, for the message of an error.
        chain: its links.
        gravity: in m/s².
        timestep: in s.
        tilt: of the base, in rad, positive towards positive angles.

    Raises:
        PlantError: MuJoCo cannot build it.
    """
    try:
        model = build_spec(chain, gravity, timestep, tilt).compile()
    except (ValueError, mujoco.FatalError) as problem:
        raise PlantError(f"plant {name}: MuJoCo cannot build it: {' '.join(str(problem).split())}") from None
    return Simulation(model, mujoco.MjData(model))
