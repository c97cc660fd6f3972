"""Plants: what is pushed and watched.

A plant is anything that answers to `Plant`, so that a rig can be one (docs/your-rig.md). `MujocoPlant` is a planar
chain of hinges in MuJoCo, built from a plant file. The search sees a plant only through an episode;
`true_lumps` is for the report.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Protocol, runtime_checkable

import mujoco
import numpy as np
from pydantic import Field, model_validator

from metaid.chain import FRICTION, IDEAL, Array, Chain, Lumps, speeds_after
from metaid.errors import PlantError
from metaid.faults import FaultSettings
from metaid.files import Settings, check, find_file, read_toml
from metaid.possible import least_inertia, refuse_impossible, refuse_too_long_a_step

Positive = Annotated[float, Field(ge=1e-6, le=1e6)]


@runtime_checkable
class Plant(Protocol):
    """What an episode needs of a plant: states, torques, steps, and the truth or None. Angles are joint angles from
    the upright.
    """

    @property
    def name(self) -> str: ...
    @property
    def njoint(self) -> int: ...
    @property
    def timestep(self) -> float:
        """Time between two control steps, in s."""

    @property
    def gravity(self) -> float:
        """Gravitational acceleration, in m/s²."""

    def push(self, impulses: Array) -> None:
        """Brings the plant to rest upright, then strikes the link tips with horizontal `impulses` (njoint), in N s."""

    def states(self) -> tuple[Array, Array]:
        """Joint angles (njoint), in rad, and joint speeds (njoint), in rad/s."""

    def apply_torque(self, torque: Array) -> None:
        """Sets the joint torque (njoint), in N m, that holds during the next step."""

    def step(self) -> None:
        """Lets one timestep pass."""

    def stop(self) -> None:
        """Takes the torque off at once: a push is over, a link has fallen, or something went wrong. Must not raise."""

    def close(self) -> None:
        """Lets go of the plant: nothing more is asked of it."""

    def true_lumps(self) -> Lumps | None:
        """The plant's own lumps, where it knows them. Only reports ask."""


class LinkSettings(Settings):
    """One `[[links]]` table: `length` and `com` (from the joint; default half the length) in m, `mass` in kg,
    `inertia` about the centre of mass (default: a slender rod's) in kg m²; of its joint the `damping` in N m s, the dry
    friction `frictionloss` in N m, and the `stiffness` of a spring, at rest when the joint is straight, in N m/rad."""

    length: Positive
    mass: Positive
    com: Annotated[float, Field(gt=0, le=1e6)] | None = None
    inertia: Annotated[float, Field(gt=0, le=1e9)] | None = None
    damping: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    frictionloss: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    stiffness: Annotated[float, Field(ge=0, le=1e6)] = 0.0

    @model_validator(mode="after")
    def _can_be_a_body(self) -> LinkSettings:
        if self.com is not None and self.com > self.length:
            raise ValueError(
                f"com {self.com} lies beyond the link's length {self.length} (allowed: above 0, at most the length)"
            )
        least = least_inertia(self.mass, self.length)
        if self.inertia is not None and self.inertia < least:
            raise ValueError(
                f"inertia {self.inertia} is below what the mass allows: a body of {self.mass} kg on a link of "
                f"{self.length} m has at least {least:.3g} kg m²"
            )
        return self


class PlantSettings(Settings):
    """A plant file: links from the base up, `gravity` in m/s², `timestep` in s; `truth_known = false` keeps the truth
    from reports.

    `over_compensation` is a declared fault: the torque that the plant receives has gravity factors larger by this. The
    faults of a real plant are in `[faults]`.
    """

    description: str = ""
    gravity: Annotated[float, Field(ge=1e-3, le=1e3)] = 9.81
    timestep: Annotated[float, Field(ge=1e-6, le=0.1)] = 0.002
    truth_known: bool = True
    over_compensation: Annotated[float, Field(gt=-1, lt=1)] = 0.0
    faults: FaultSettings = FaultSettings()
    links: Annotated[tuple[LinkSettings, ...], Field(min_length=1, max_length=64, strict=False)]

    @model_validator(mode="after")
    def _one_limit_a_joint(self) -> PlantSettings:
        limit = self.faults.torque_limit
        if isinstance(limit, tuple) and len(limit) != len(self.links):
            raise ValueError(f"faults: torque_limit has {len(limit)} numbers (allowed: one, or {len(self.links)})")
        return self

    @property
    def control_period(self) -> float:
        """Time between two torques, and between two readings, in s."""
        return self.timestep * self.faults.control_every


def chain_of(links: tuple[LinkSettings, ...]) -> Chain:
    """The physical parameters of `links`, defaults filled in."""

    def column(values: list[float]) -> Array:
        array = np.array(values)
        array.setflags(write=False)
        return array

    coms = [link.length / 2 if link.com is None else link.com for link in links]
    inertias = [link.mass * link.length**2 / 12 if link.inertia is None else link.inertia for link in links]
    return Chain(
        length=column([link.length for link in links]),
        mass=column([link.mass for link in links]),
        com=column(coms),
        inertia=column(inertias),
        damping=column([link.damping for link in links]),
        coulomb=column([link.frictionloss for link in links]),
        stiffness=column([link.stiffness for link in links]),
    )


def build_spec(chain: Chain, gravity: float, timestep: float) -> mujoco.MjSpec:
    """A lean MuJoCo chain: hinges about y, explicit inertials, nothing that an episode can do without.

    Autoreset is off: a diverged episode must not silently restart. Euler: a torque is written once a step
    (docs/method.md). Viscous friction is explicit, at the speed that a step begins with, as the law's is; dry friction
    is a constraint, so only a chain that has some is given MuJoCo's solver.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.gravity = [0.0, 0.0, -gravity]
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


@dataclass(eq=False)
class MujocoPlant:
    """A planar chain in MuJoCo; `model` and `data` are its own, so a worker needs a plant of its own."""

    name: str
    settings: PlantSettings

    def __post_init__(self) -> None:
        self.chain = chain_of(self.settings.links)
        refuse_impossible(f"plant {self.name}", self.chain)
        refuse_too_long_a_step(f"plant {self.name}", self.chain, self.gravity, self.timestep)
        try:
            self.model = build_spec(self.chain, self.felt_gravity, self.timestep).compile()
        except (ValueError, mujoco.FatalError) as problem:
            raise PlantError(f"plant {self.name}: MuJoCo cannot build it: {' '.join(str(problem).split())}") from None
        if tilt := self.settings.faults.tilt:
            self.model.opt.gravity[:] = self.felt_gravity * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
        self.data = mujoco.MjData(self.model)

    @property
    def njoint(self) -> int:
        return self.chain.nlink

    @property
    def timestep(self) -> float:
        return self.settings.timestep

    @property
    def gravity(self) -> float:
        return self.settings.gravity

    @property
    def felt_gravity(self) -> float:
        """In m/s². Too large a torque by a share of the gravity terms is the same as gravity weaker by that share."""
        return self.gravity * (1.0 - self.settings.over_compensation)

    def start_speeds(self, impulses: Array) -> Array:
        """Joint speeds (njoint), in rad/s, just after `impulses` (njoint), in N s, at the link tips of the chain at
        rest upright.
        """
        return np.diff(speeds_after(self.chain, impulses), prepend=0.0)

    def push(self, impulses: Array) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qvel[:] = self.start_speeds(impulses)

    def states(self) -> tuple[Array, Array]:
        return self.data.qpos.copy(), self.data.qvel.copy()

    def apply_torque(self, torque: Array) -> None:
        self.data.qfrc_applied[:] = torque

    def step(self) -> None:
        mujoco.mj_step(self.model, self.data)

    def stop(self) -> None:
        self.data.qfrc_applied[:] = 0.0

    def close(self) -> None:
        """A simulated plant holds nothing that anybody waits for."""

    def true_lumps(self) -> Lumps | None:
        if not self.settings.truth_known:
            return None
        return replace(self.chain.lumps_of((*IDEAL, *FRICTION)), searched=self.chain.kinds)


def load_plant(name: str | Path) -> MujocoPlant:
    """The shipped plant of that name, or the plant file at that path.  Raises PlantError."""
    path = find_file("plants", str(name), PlantError)
    return MujocoPlant(path.stem, read_plant(path))


def read_plant(path: Path) -> PlantSettings:
    """The checked contents of the file of a simulated plant.  Raises PlantError."""
    tables = read_toml(path, PlantError)
    if "socket" in tables:
        raise PlantError(
            f"{path}: a plant behind a socket has no links to simulate or draw (allowed: plant show, and in a study)"
        )
    return check(PlantSettings, tables, str(path), PlantError)
