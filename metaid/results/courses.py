"""Where models are tried: on pushes that the search never used, and along a trajectory.

A `Course` is that of one plant. A chain is pushed from the upright and swings about it, an arm is let go within the
ranges of its joints and goes along sinusoids from the middle of them. Sensors of an arm are exact here, for it is
models that are compared.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from metaid.episode import REACH, natural_time, rich_pushes
from metaid.errors import StudyError
from metaid.models import Array, Chain, ChainModel, Lumps
from metaid.models.tree import Tree
from metaid.plant import ArmPlant, ArmStart, FaultSettings, MujocoPlant, Start
from metaid.results.coasting import arm_coasting_steps, coasting_steps
from metaid.results.control import AMPLITUDE, BANDWIDTH, smooth_sinusoids, track
from metaid.study import HORIZON

COASTING_HORIZON = 100.0  # natural times for which a chain is watched
ARM_HORIZON = 1.0  # s for which an arm is watched: joints cross half of their ranges at most
SHORTEST, LONGEST = 1.0, 2.0  # s, periods of the joints of an arm along the trajectory
ARM_BANDWIDTH = 10.0  # rad/s, of the feedback
ROOM = 0.5  # of half a joint's range, that the mean joint of an arm swings at most
SLIDE = 1.0 / 3.0  # m that a slide swings for each rad of a hinge


@dataclass(frozen=True)
class ChainCourse:
    """The course of a simulated chain.

    Attributes:
        plant: that moves.
        nominal: the nominal chain.
        takes_nominal_inertia: whether inertia lumps are not known, so that every model takes the nominal ratios.
        count: of the pushes.
        seed: of these.
    """

    plant: MujocoPlant
    nominal: Chain
    takes_nominal_inertia: bool
    count: int
    seed: int

    @property
    def natural_time(self) -> float:
        """√(l/g), in s."""
        return natural_time(self.nominal, self.plant.gravity)

    @property
    def steps(self) -> int:
        """For how many each push is watched."""
        return round(COASTING_HORIZON * self.natural_time / self.plant.timestep)

    @cached_property
    def pushes(self) -> Array:
        """Impulses (npush x njoint), in N s."""
        return rich_pushes(self.plant, self.count, REACH / (HORIZON * self.natural_time), self.seed)

    def coasting(self, law: Lumps) -> Array:
        """How long each push (npush) coasts under a law, in s, at most for all steps."""
        whole = self._whole(law)
        steps = [coasting_steps(self.plant, whole, impulses, self.steps) for impulses in self.pushes]
        return np.array(steps) * self.plant.timestep

    def tracking(self, law: Lumps) -> tuple[Array, bool]:
        """Errors of the joints (nsteps x njoint), in rad, along smooth sinusoids under computed torque with a law, up
        to where control was lost, and whether it never was. The nominal mass matrix weighs the feedback of every law.
        """
        plant, time = self.plant, self.natural_time
        desired = smooth_sinusoids(plant.njoint, time, plant.timestep)
        model, feedback = ChainModel(self._whole(law), plant.gravity), ChainModel(self.nominal.lumps, plant.gravity)
        seen = track(plant, Start.upright(np.zeros(plant.njoint)), model, feedback, desired, BANDWIDTH / time)
        return seen - desired.angles[: len(seen)], len(seen) == len(desired.angles)

    @property
    def about(self) -> dict[str, Any]:
        """What else a `Validation` says of it."""
        return {"natural_time": self.natural_time, "takes_nominal_inertia": self.takes_nominal_inertia}

    def _whole(self, law: Lumps) -> Lumps:
        """The law with inertia lumps: where none are identified, d_i is μ_i times the nominal model's d_i / μ_i, for
        every model alike.
        """
        if not self.takes_nominal_inertia:
            return law
        return replace(law, inertia=self.nominal.inertia_lumps * law.gravity / self.nominal.lumps.gravity)


@dataclass(frozen=True)
class ArmCourse:
    """The course of a simulated arm.

    Attributes:
        plant: that moves, with exact sensors and drives.
        nominal: the nominal arm, whose mass matrix is the metric of coasting.
        feedback: parameters (njoint x 13), whose mass matrix weighs the feedback along the trajectory.
        starts: of the pushes.
    """

    plant: ArmPlant
    nominal: Tree
    feedback: Array
    starts: tuple[ArmStart, ...]

    @property
    def steps(self) -> int:
        """For how many each push is watched."""
        return round(ARM_HORIZON / self.plant.timestep)

    @property
    def pushes(self) -> Array:
        """Joint coordinates and speeds at the starts (npush x 2 x njoint)."""
        return np.array([(start.pose, start.speeds) for start in self.starts])

    def coasting(self, law: Array) -> Array:
        """How long each push (npush) coasts under a law, in s, at most for all steps."""
        steps = arm_coasting_steps(self.plant, (law, self.nominal), self.starts, self.steps)
        return self.plant.timestep * steps.astype(np.float64)

    def tracking(self, law: Array) -> tuple[Array, bool]:
        """As of a chain, in rad or m, from the middle of the ranges; the feedback is the same for every feedforward."""
        from metaid.compiled.spatial import QuickArm  # loads numba

        plant, tree = self.plant, self.plant.tree
        half, middle = 0.5 * (tree.high - tree.low), np.clip(0.0, tree.low, tree.high)
        is_limited = np.isfinite(half)
        middle[is_limited] = tree.low[is_limited] + half[is_limited]
        widest = np.where(tree.slides, SLIDE * AMPLITUDE, AMPLITUDE)
        amplitude, periods = np.minimum(widest, ROOM * half), (SHORTEST, LONGEST)
        swing = smooth_sinusoids(tree.njoint, 1.0, plant.timestep, amplitude=amplitude, periods=periods)
        desired = swing._replace(angles=middle + swing.angles)
        model, feedback = (QuickArm(tree, np.array(each, order="C")) for each in (law, self.feedback))
        start = ArmStart(desired.angles[0], np.zeros(tree.njoint))
        seen = track(plant, start, model, feedback, desired, ARM_BANDWIDTH)
        return seen - desired.angles[: len(seen)], len(seen) == len(desired.angles)

    @property
    def about(self) -> dict[str, Any]:
        """What else a `Validation` says of it."""
        return {"slides": self.plant.tree.slides}


Course = ChainCourse | ArmCourse


def course_of(problem: Any, identified: Any, pushes: int, seed: int) -> Course:
    """The course of the plant of a study.

    Args:
        problem: of the study.
        identified: the law that is tried.
        pushes: how many.
        seed: of these, as `fresh_seed` makes it.

    Raises:
        StudyError: the plant is a rig.
    """
    plant, nominal = problem.open_plant(), problem.nominal
    if isinstance(plant, MujocoPlant):
        return ChainCourse(plant, nominal, identified.inertia is None, pushes, seed)
    if isinstance(plant, ArmPlant):
        from metaid.plant.description import draw_free_starts  # loads MuJoCo

        starts = draw_free_starts(nominal, pushes, ARM_HORIZON, seed, problem.spec.study.episode.speed)
        exact = plant.settings.model_copy(update={"faults": FaultSettings(tilt=plant.settings.faults.tilt)})
        return ArmCourse(replace(plant, settings=exact, known=plant.tree), nominal, identified, tuple(starts))
    raise StudyError(f"plant {plant.name} is a rig, and this needs a simulated plant")
