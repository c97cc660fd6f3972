"""A study with nothing left to look up: all that a run depends on.

It goes into the study DB, so a study can be resumed and shown without its files.
"""

from __future__ import annotations

import json
from hashlib import blake2b
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from metaid.errors import StudyError
from metaid.files import Settings
from metaid.models import lump_names
from metaid.models.tree import Tree, base_parameters, joint_mass_matrix
from metaid.plant import ArmStart, FaultSettings, LinkSettings, PlantSettings, SocketSettings
from metaid.study.settings import NominalSettings, StudySettings

Vector = Annotated[tuple[float, ...], Field(strict=False)]
Vectors = Annotated[tuple[Vector, ...], Field(strict=False)]

STIFFEST = 30.0  # 1/s², of the springs; a push of 0.3 s is then a quarter of a period
OPEN = {"low": -np.inf, "high": np.inf, "torque_limit": np.inf}  # of an arm: what null stands for
SPARED = 0.3  # of a joint's torque limit, for the torque of a spring


class TreeSettings(Settings):
    """A `Tree`, written out; an open end of a range and an unknown torque limit are null."""

    names: Annotated[tuple[str, ...], Field(strict=False)]
    position: Vectors
    rotation: Annotated[tuple[Vectors, ...], Field(strict=False)]
    axis: Vectors
    slides: Annotated[tuple[bool, ...], Field(strict=False)]
    low: Annotated[tuple[float | None, ...], Field(strict=False)]
    high: Annotated[tuple[float | None, ...], Field(strict=False)]
    torque_limit: Annotated[tuple[float | None, ...], Field(strict=False)]
    gravity: Vector
    parameters: Vectors

    @classmethod
    def of(cls, tree: Tree) -> TreeSettings:
        """A `tree`, written out."""
        written = {name: np.asarray(getattr(tree, name)).tolist() for name in cls.model_fields}
        for name in OPEN:
            written[name] = [value if np.isfinite(value) else None for value in written[name]]
        return cls(**written)

    @property
    def tree(self) -> Tree:
        """The arm that is written out."""
        written = {name: getattr(self, name) for name in TreeSettings.model_fields}
        for name, nothing in OPEN.items():
            written[name] = [nothing if value is None else value for value in written[name]]
        names, parameters = written.pop("names"), written.pop("parameters")
        geometry = {name: np.array(value) for name, value in written.items()}
        bodies: dict[str, Any] = dict.fromkeys(("mass", "com", "inertia", "rotor", "damping", "coulomb"), np.zeros(0))
        return Tree(names=names, **geometry, **bodies).with_parameters(np.array(parameters))  # which says all of these


class ArmPlantSettings(Settings):
    """A simulated arm with nothing left to look up: its `arm`, its `timestep` in s, its `faults`, and of the springs in
    its joints, by their names, the `stiffness` in N m/rad or N/m and where they are `slack`, in rad or m.
    """

    arm: TreeSettings
    timestep: float
    truth_known: bool
    faults: FaultSettings
    stiffness: dict[str, float] = Field(default_factory=dict)
    slack: dict[str, float] = Field(default_factory=dict)

    @property
    def gravity(self) -> tuple[float, ...]:
        """In the frame of the base (3), in m/s²."""
        return self.arm.gravity


class StartSettings(Settings):
    """From where a push of an arm begins: joint coordinates `pose`, in rad or m, and joint `speeds`, in rad/s or m/s;
    and k of the springs as on which it swings, its `stiffness` in 1/s², which is 0 where the arm is to coast.
    """

    pose: Vector
    speeds: Vector
    stiffness: float = 0.0

    @classmethod
    def of(cls, start: ArmStart) -> StartSettings:
        """A `start`, written out."""
        return cls(pose=start.pose.tolist(), speeds=start.speeds.tolist())

    @property
    def start(self) -> ArmStart:
        """That is written out."""
        return ArmStart(np.array(self.pose), np.array(self.speeds))

    def with_springs(self, nominal: Tree, wanted: float | None) -> StartSettings:
        """The same of a push that swings as on springs: of the stiffness that is `wanted`, or else of that for which
        the motors have torque to spare. An oscillation from speeds v needs torques of √k M v.
        """
        if wanted is None:
            momentum = np.abs(joint_mass_matrix(nominal, np.array(self.pose)) @ np.array(self.speeds))
            room = SPARED * nominal.torque_limit / np.maximum(momentum, 1e-12)
            wanted = float(min(STIFFEST, np.min(room) ** 2))
        return self.model_copy(update={"stiffness": wanted})


class PushedSettings(Settings):
    """What was found at a rig when the study was created. Its pushes (npush x njoint): `impulses` in N s, none of an
    arm, which is brought to where they begin; and on average the joint `angles` and `speeds` with which they begin. By
    how much an impulse differs from one time to the next is `push_noise`, as a share of it. By how much angles and
    speeds (njoint) differ beyond that from what they are on average is `angle_spread` and `speed_spread`, and what
    is read at rest `angle_noise` and `speed_noise`, standard deviations all. In rad and rad/s, of slides in m and m/s.
    """

    impulses: Vectors = ()
    angles: Vectors
    speeds: Vectors
    push_noise: float = 0.0
    angle_spread: Vector
    speed_spread: Vector
    angle_noise: Vector
    speed_noise: Vector


class StudySpec(Settings):
    """A study with nothing left to look up. Of an arm also the parameters that its base parameters are `counted_by`,
    and from where its pushes begin, `starts`.
    """

    name: str
    plant_name: str
    plant: PlantSettings | ArmPlantSettings | SocketSettings
    nominal: Annotated[tuple[LinkSettings, ...], Field(strict=False)] | TreeSettings
    study: StudySettings
    counted_by: Annotated[tuple[str, ...], Field(strict=False)] = ()
    starts: Annotated[tuple[StartSettings, ...], Field(strict=False)] = ()
    pushed: PushedSettings | None = None

    def __repr__(self) -> str:
        return f"<StudySpec {self.name}: plant {self.plant_name}, {self.study.sampler}, trials={self.study.trials}>"

    @property
    def is_arm(self) -> bool:
        """Whether it is of an arm in space, and not of a planar chain."""
        return not isinstance(self.nominal, tuple)

    @property
    def links(self) -> tuple[LinkSettings, ...]:
        """Of the nominal model of a chain."""
        assert isinstance(self.nominal, tuple), "it is of an arm"
        return self.nominal

    @property
    def tree(self) -> Tree:
        """The nominal model of an arm."""
        assert not isinstance(self.nominal, tuple), "it is of a chain"
        return self.nominal.tree

    @property
    def simulated(self) -> Any:
        """The simulated plant, of a chain `PlantSettings` and of an arm `ArmPlantSettings`; None where it is a rig."""
        return None if isinstance(self.plant, SocketSettings) else self.plant

    @property
    def is_simulated(self) -> bool:
        """Whether the plant is simulated here, and not a rig, which is not to be moved without need."""
        return not isinstance(self.plant, SocketSettings)

    @property
    def timestep(self) -> float:
        """Time between two control steps, in s."""
        return self.faults.control_period(self.plant.timestep)

    @property
    def faults(self) -> FaultSettings:
        """Of a simulated plant; a rig's are not known."""
        return FaultSettings() if isinstance(self.plant, SocketSettings) else self.plant.faults

    @property
    def keeps_readings(self) -> bool:
        """Whether trials keep what sensors read, and no windows: as on a rig, of a plant with faults or a law that
        leads, and where faults are searched.
        """
        wanted, springs = self.study, getattr(self.plant, "stiffness", None)
        is_ideal = not (self.faults.named or springs or wanted.episode.lead or wanted.estimate.faults)
        return not (self.is_simulated and is_ideal)

    @property
    def tilts(self) -> bool:
        """Whether the base may be tilted, as far as the study knows."""
        return "tilt" in self.study.estimate.undeclared_faults

    @property
    def experiment(self) -> str:
        """A digest of what a trial's outcome follows from, beside its factors and its number: the plant, the nominal
        model, the pushes, what is searched. Studies that differ in nothing but sampler and trials have the same.
        """
        parts = self.model_dump(mode="json", include={"plant", "nominal", "starts", "pushed"})
        parts |= {"episode": self.study.episode.model_dump(mode="json"), "seed": self.study.seed, "names": self.names}
        return blake2b(json.dumps(parts, sort_keys=True).encode(), digest_size=6).hexdigest()

    @property
    def names(self) -> list[str]:
        """The names under which the numbers of candidates are in the DB: lumps of a chain, which they are factors of,
        or base parameters.
        """
        return list(self.counted_by) or lump_names(len(self.joints), self.study.search.lumps)

    @property
    def joints(self) -> tuple[str, ...]:
        """What its joints are called."""
        if isinstance(self.nominal, tuple):
            return tuple(f"joint {i + 1}" for i in range(len(self.nominal)))
        return self.nominal.names

    @property
    def gravity(self) -> Any:
        """In m/s², a number; of an arm a vector (3), in the frame of the base."""
        return self.plant.gravity if isinstance(self.nominal, tuple) else self.nominal.gravity

    @property
    def measure(self) -> str:
        """The name of what is measured."""
        return "kinetic" if self.is_arm else self.study.episode.measure

    @property
    def joints_with_periods(self) -> int:
        """How many joints have their periods counted in each trial: none of an arm."""
        return 0 if self.is_arm else len(self.joints)

    def with_nominal(self, nominal: tuple[LinkSettings, ...] | Tree) -> StudySpec:
        """A study of the same robot with another `nominal` model: the links of a chain, or an arm.  Raises StudyError
        where that is none with its joints.
        """
        own = self.nominal if isinstance(self.nominal, tuple) else self.nominal.tree
        if _described(nominal) != _described(own):
            raise StudyError(
                f"study {self.name}: its plant {self.plant_name} is {_described(own)}, and the model to start from is "
                f"{_described(nominal)}"
            )
        if isinstance(nominal, tuple):
            study = self.study.model_copy(update={"nominal": NominalSettings(links=nominal)})
            return self.model_copy(update={"nominal": nominal, "study": study})
        wanted = self.study.episode.stiffness
        starts = tuple(each.with_springs(nominal, wanted) if each.stiffness else each for each in self.starts)
        counted_by = base_parameters(nominal, None, self.tilts).names
        return self.model_copy(update={"nominal": TreeSettings.of(nominal), "counted_by": counted_by, "starts": starts})


def _described(nominal: tuple[LinkSettings, ...] | Tree) -> str:
    """What a nominal model is one of, in words."""
    if isinstance(nominal, tuple):
        return f"a planar chain of {len(nominal)} links"
    return f"an arm with the joints {', '.join(nominal.names)}"
