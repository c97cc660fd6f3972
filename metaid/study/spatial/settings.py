"""What a study file of an arm says, and the study with nothing left to look up."""

from __future__ import annotations

from hashlib import blake2b
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from metaid.errors import StudyError
from metaid.files import Settings
from metaid.models import Array
from metaid.models.tree import PriorDeviations, Tree, base_parameters, joint_mass_matrix
from metaid.plant import ArmStart, FaultSettings, SocketSettings
from metaid.search import OutputErrorOptions, StepOptions
from metaid.study.estimating import AnyEstimateSettings, with_trials

Vector = Annotated[tuple[float, ...], Field(strict=False)]
Share = Annotated[float, Field(gt=0, le=10)]

STIFFEST = 30.0  # 1/s², of the springs; a push of 0.3 s is then a quarter of a period
SPARED = 0.3  # of a joint's torque limit, for the torque of a spring
FEW = 4  # trials by default


class DrawnNominalSettings(Settings):
    """`[nominal]`: a nominal arm that is drawn at random, with a `seed`, about the arm of a `plant` file. Masses,
    moments of inertia and centres of mass are as wrong as `[estimate]` says that they may be, friction and rotors are
    not known.
    """

    plant: str
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


class ArmSearchSettings(StepOptions, OutputErrorOptions):
    """`[search]`: a `target` of the measure at which the search may stop, and the options of the sampler. Its first
    step `sigma` is small: a law that is far off in many base parameters lets a push fall.
    """

    sigma: Annotated[float, Field(gt=0, le=10)] = 0.05
    target: Annotated[float, Field(ge=0)] | None = None


class ArmEpisodeSettings(Settings):
    """`[episode]`: how many pushes coast, `coasts` (default: 2 a joint), and how many swing as on springs, `springs`
    (default: 1 a joint), with the `stiffness` k in 1/s² of the q̈ = −k (q − q₀) that their law asks for (default: by the
    torque limits, at most 30); how long each is, `horizon` in s; the `speed` of the fastest joint at a start in rad/s;
    how many times faster a joint must be to have run away, `runaway`; the `lead` in s, for an arm whose torques come
    late: the law gets the coordinates that the speeds lead to by then.
    """

    coasts: Annotated[int, Field(ge=1, le=1000)] | None = None
    springs: Annotated[int, Field(ge=0, le=1000)] | None = None
    stiffness: Annotated[float, Field(gt=0, le=1e6)] | None = None
    horizon: Annotated[float, Field(gt=0, le=60)] = 0.3
    speed: Annotated[float, Field(gt=0, le=100)] = 3.0
    runaway: Annotated[float, Field(gt=1, le=1e6)] = 5.0
    lead: Annotated[float, Field(ge=0, le=1)] = 0.0

    def stiffness_of(self, nominal: Tree, start: ArmStart) -> float:
        """k of a push with springs, in 1/s²: an oscillation from speeds v needs torques of √k M v, which the motors are
        to spare.
        """
        if self.stiffness is not None:
            return self.stiffness
        momentum: Array = np.abs(joint_mass_matrix(nominal, start.pose) @ start.speeds)
        room = SPARED * nominal.torque_limit / np.maximum(momentum, 1e-12)
        return float(min(STIFFEST, np.min(room) ** 2))


class ArmEstimateSettings(AnyEstimateSettings):
    """`[estimate]` of an arm, with what it has of any robot. How wrong the nominal arm may be, as standard deviations:
    of each link's `mass`, of its centre of mass `com` as a share of its distance from the joint, of its
    moments of `inertia`; of each joint's `rotor`, `damping` and dry friction `coulomb`, as shares of the joint's torque
    (docs/method.md, Eq. 41).
    """

    mass: Share = 0.3
    com: Share = 0.15
    inertia: Share = 0.3
    rotor: Share = 0.5
    damping: Share = 0.5
    coulomb: Share = 0.3

    @property
    def prior(self) -> PriorDeviations:
        """The same as the model has it."""
        return PriorDeviations(**self.model_dump(exclude=set(AnyEstimateSettings.model_fields)))

    @field_validator("faults")
    @classmethod
    def _not_known(cls, faults: tuple[str, ...] | str) -> tuple[str, ...] | str:
        if {"viscous", "dry", "presliding", "rotor"} & set(faults):
            raise ValueError(
                "friction and rotors of an arm's joints are among its base parameters, and always searched "
                "(allowed: delay, lag, tilt, offset, spring, bias, gain)"
            )
        return faults


class ArmStudySettings(Settings):
    """A study file of an arm."""

    description: str = ""
    plant: str
    nominal: str | DrawnNominalSettings
    sampler: Literal["output-error", "cmaes", "tpe", "optuna-cmaes"] = "output-error"
    trials: Annotated[int, Field(ge=1, le=1_000_000)] = FEW
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    workers: Annotated[int, Field(ge=1, le=1024)] = 1
    search: ArmSearchSettings = ArmSearchSettings()
    episode: ArmEpisodeSettings = ArmEpisodeSettings()
    estimate: ArmEstimateSettings = ArmEstimateSettings()

    @model_validator(mode="before")
    @classmethod
    def _with_trials(cls, tables: Any) -> Any:
        return with_trials(tables)


class TreeSettings(Settings):
    """A `Tree`, written out; an open end of a range and an unknown torque limit are null."""

    names: Annotated[tuple[str, ...], Field(strict=False)]
    position: Annotated[tuple[Vector, ...], Field(strict=False)]
    rotation: Annotated[tuple[Annotated[tuple[Vector, ...], Field(strict=False)], ...], Field(strict=False)]
    axis: Annotated[tuple[Vector, ...], Field(strict=False)]
    slides: Annotated[tuple[bool, ...], Field(strict=False)]
    low: Annotated[tuple[float | None, ...], Field(strict=False)]
    high: Annotated[tuple[float | None, ...], Field(strict=False)]
    torque_limit: Annotated[tuple[float | None, ...], Field(strict=False)]
    gravity: Vector
    parameters: Annotated[tuple[Vector, ...], Field(strict=False)]

    @classmethod
    def of(cls, tree: Tree) -> TreeSettings:
        """A `tree`, written out."""

        def ends(values: Any) -> tuple[float | None, ...]:
            return tuple(value if np.isfinite(value) else None for value in values.tolist())

        return cls(
            names=tree.names,
            position=tree.position.tolist(),
            rotation=tree.rotation.tolist(),
            axis=tree.axis.tolist(),
            slides=tree.slides.tolist(),
            low=ends(tree.low),
            high=ends(tree.high),
            torque_limit=ends(tree.torque_limit),
            gravity=tree.gravity.tolist(),
            parameters=tree.parameters.tolist(),
        )

    @property
    def tree(self) -> Tree:
        """The arm that is written out."""
        njoint = len(self.names)
        bodiless = Tree(
            names=self.names,
            position=np.array(self.position),
            rotation=np.array(self.rotation),
            axis=np.array(self.axis),
            slides=np.array(self.slides, dtype=np.bool_),
            low=np.array([-np.inf if end is None else end for end in self.low]),
            high=np.array([np.inf if end is None else end for end in self.high]),
            torque_limit=np.array([np.inf if end is None else end for end in self.torque_limit]),
            gravity=np.array(self.gravity),
            mass=np.ones(njoint),
            com=np.zeros((njoint, 3)),
            inertia=np.zeros((njoint, 3, 3)),
            rotor=np.zeros(njoint),
            damping=np.zeros(njoint),
            coulomb=np.zeros(njoint),
        )
        return bodiless.with_parameters(np.array(self.parameters))


class ArmPlantSettings(Settings):
    """A simulated arm with nothing left to look up: its `arm`, its `timestep` in s, its `faults`, and the stiffness of
    springs in its joints, by their names, in N m/rad or N/m.
    """

    arm: TreeSettings
    timestep: float
    truth_known: bool
    faults: FaultSettings
    stiffness: dict[str, float] = Field(default_factory=dict)


class StartSettings(Settings):
    """From where a push begins: joint coordinates `pose`, in rad or m, and joint `speeds`, in rad/s or m/s."""

    pose: Vector
    speeds: Vector


class ArmPushedSettings(Settings):
    """What was found at a rig when the study was created: the joint coordinates `poses` and `speeds` (npush x njoint)
    with which its pushes begin, on average, and by how much they differ from one time to the next, `pose_spread` and
    `speed_spread` (njoint); `angle_noise` and `speed_noise` (njoint): the standard deviations of the readings at rest.
    In rad and rad/s, of slides in m and m/s.
    """

    poses: Annotated[tuple[Vector, ...], Field(strict=False)]
    speeds: Annotated[tuple[Vector, ...], Field(strict=False)]
    pose_spread: Vector
    speed_spread: Vector
    angle_noise: Vector
    speed_noise: Vector

    @property
    def begun(self) -> Array:
        """Joint coordinates and speeds at the start of each push (npush x 2 x njoint)."""
        return np.stack([np.array(self.poses), np.array(self.speeds)], axis=1)


class ArmSpec(Settings):
    """A study of an arm with nothing left to look up: the parameters that its base parameters are `counted_by`; from
    where its pushes begin, `starts`, and their `stiffness` k in 1/s², which is 0 where the arm is to coast.
    """

    kind: Literal["arm"] = "arm"
    name: str
    plant_name: str
    plant: ArmPlantSettings | SocketSettings
    nominal: TreeSettings
    counted_by: Annotated[tuple[str, ...], Field(strict=False)]
    starts: Annotated[tuple[StartSettings, ...], Field(strict=False)]
    stiffness: Vector
    study: ArmStudySettings
    pushed: ArmPushedSettings | None = None

    def __repr__(self) -> str:
        return f"<ArmSpec {self.name}: plant {self.plant_name}, {self.study.sampler}, trials={self.study.trials}>"

    @property
    def timestep(self) -> float:
        """Time between two control steps, in s."""
        return self.plant.timestep * self.faults.control_every

    @property
    def faults(self) -> FaultSettings:
        """Of a simulated plant; a rig's are not known."""
        return FaultSettings() if self.simulated is None else self.simulated.faults

    @property
    def simulated(self) -> ArmPlantSettings | None:
        """The simulated plant; None where it is a rig."""
        return None if isinstance(self.plant, SocketSettings) else self.plant

    def with_nominal(self, nominal: Any) -> ArmSpec:
        """A study of the same arm with another nominal one.  Raises StudyError where the `nominal`
        model is no arm with its joints.
        """
        names = getattr(nominal, "names", None)
        if names != self.nominal.names:
            what = "a planar chain" if names is None else f"an arm with the joints {', '.join(names)}"
            raise StudyError(
                f"study {self.name}: its plant {self.plant_name} is an arm with the joints "
                f"{', '.join(self.nominal.names)}, and the model to start from is {what}"
            )
        stiffness = tuple(
            0.0 if old == 0.0 else self.study.episode.stiffness_of(nominal, start)
            for old, start in zip(self.stiffness, self.arm_starts, strict=True)
        )
        counted_by = base_parameters(nominal, None, self.tilts).names
        changes = {"nominal": TreeSettings.of(nominal), "counted_by": counted_by, "stiffness": stiffness}
        return self.model_copy(update=changes)

    @property
    def tilts(self) -> bool:
        """Whether the base may be tilted, as far as the study knows."""
        return "tilt" in self.study.estimate.undeclared_faults

    @property
    def arm_starts(self) -> tuple[ArmStart, ...]:
        """From where the pushes begin."""
        return tuple(ArmStart(np.array(start.pose), np.array(start.speeds)) for start in self.starts)

    @property
    def names(self) -> list[str]:
        """The names under which the base parameters of candidates are in the DB."""
        return list(self.counted_by)

    @property
    def joints(self) -> tuple[str, ...]:
        """What its joints are called."""
        return self.nominal.names

    @property
    def gravity(self) -> tuple[float, ...]:
        """In the frame of the base (3), in m/s²."""
        return self.nominal.gravity

    @property
    def measure(self) -> str:
        """The name of what is measured."""
        return "kinetic"

    @property
    def joints_with_periods(self) -> int:
        """How many joints have their periods counted in each trial: none of an arm."""
        return 0

    @property
    def experiment(self) -> str:
        """A digest of what a trial's outcome follows from, beside its parameters and its number."""
        study = self.study
        parts = (self.plant, self.nominal, study.episode, study.estimate, *self.starts, self.pushed)
        texts = ["" if part is None else part.model_dump_json() for part in parts] + [str(study.seed)]
        return blake2b("\n".join(texts).encode(), digest_size=6).hexdigest()
