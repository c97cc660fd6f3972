"""How well a study's result serves: on pushes that the search never used, and in control along a trajectory.

Both are simulated under the nominal law, the identified one and, where the plant knows it, the true one. The true one
only serves to say how good a result could have been.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.errors import StudyError
from metaid.models import Array
from metaid.results.candidates import identified_law, with_references
from metaid.results.courses import course_of
from metaid.results.snapshot import Snapshot
from metaid.study import Problem

PUSHES, MOST_PUSHES = 10, 1000
DEGREES = 180.0 / np.pi
Joints = slice | NDArray[np.bool_]
ALL = slice(None)


@dataclass(frozen=True)
class Validated:
    """How a plant moves under the law named `model`.

    `coasting` (npush): time, in s, for which each push coasts, at most the horizon; `errors` (nsteps x njoint): of the
    joint coordinates along the trajectory, in rad or m, as far as it got before the plant was out of control; `tracked`
    is whether it got to the end.
    """

    model: str
    coasting: Array
    errors: Array
    tracked: bool

    def rms_of(self, joints: Joints = ALL) -> float:
        """Root mean square of the tracking errors of some `joints`, in rad or m; infinite if control was lost."""
        return float(np.sqrt((self.errors[:, joints] ** 2).mean())) if self.tracked else np.inf

    def max_of(self, joints: Joints) -> float:
        """Their largest tracking error, in rad or m; infinite if control was lost."""
        return float(np.abs(self.errors[:, joints]).max()) if self.tracked else np.inf


@dataclass(frozen=True)
class Validation:
    """`models` compared on one `plant`.

    Attributes:
        plant: its name.
        seed: of the pushes.
        pushes: of a chain impulses (npush x njoint), in N s; of an arm joint coordinates and speeds at the starts
            (npush x 2 x njoint).
        timestep: in s.
        horizon: for which each push was watched, in s.
        models: as they did.
        natural_time: √(l/g) of a chain, in s; None of an arm.
        slides: which joints of an arm are slides (njoint), and no hinges; None of a chain.
        takes_nominal_inertia: whether inertia lumps were not searched, so that every model took the nominal ratios.
    """

    plant: str
    seed: int
    pushes: Array
    timestep: float
    horizon: float
    models: tuple[Validated, ...]
    natural_time: float | None = None
    slides: NDArray[np.bool_] | None = None
    takes_nominal_inertia: bool = False

    def __repr__(self) -> str:
        compared = ", ".join(each.model for each in self.models)
        return f"<Validation on {self.plant}: pushes={len(self.pushes)}, {compared}>"

    @property
    def kinds(self) -> dict[str, tuple[Joints, float]]:
        """The joints of each kind, by the unit that their errors are shown in, and how many of it a rad or m is."""
        if self.slides is None:
            return {"deg": (ALL, DEGREES)}
        kinds = {"deg": (~self.slides, DEGREES), "mm": (self.slides, 1e3)}
        return {unit: (joints, scale) for unit, (joints, scale) in kinds.items() if joints.any()}

    def summary(self) -> dict[str, Any]:
        """What `metaid study validate --json` prints; None for the tracking error of a model that lost control."""

        def row(shown: Validated) -> dict[str, Any]:
            median = float(np.median(shown.coasting))
            natural = {} if self.natural_time is None else {"coasting_natural_times": median / self.natural_time}
            tracking = {
                f"tracking_{size}_{unit}": scale * error if np.isfinite(error) else None
                for unit, (joints, scale) in self.kinds.items()
                for size, error in (("rms", shown.rms_of(joints)), ("max", shown.max_of(joints)))
            }
            return {
                "model": shown.model,
                "coasting_s": median,
                **natural,
                "coasting_each_s": shown.coasting.tolist(),
                "coasting_whole_horizon": int((shown.coasting >= self.horizon).sum()),
                **tracking,
            }

        natural = {} if self.natural_time is None else {"natural_time_s": self.natural_time}
        head = {"plant": self.plant, "seed": self.seed, "pushes": len(self.pushes)}
        return {**head, **natural, "horizon_s": self.horizon, "models": [row(shown) for shown in self.models]}


def validate(snapshot: Snapshot, pushes: int = PUSHES, seed: int = 0) -> Validation:
    """`validate_law` of what a study found, on so many new `pushes` of a `seed`.  Raises StudyError where nothing was
    found, and as `validate_law` does.
    """
    verdict, found = snapshot.verdict, snapshot.verdict.lumps
    if not (verdict.has_result or (found["determined"] & found["identified"].notna()).any()):
        raise verdict.refusal(snapshot.name, "nothing to validate")
    return validate_law(snapshot.problem, identified_law(snapshot), pushes, seed)


def validate_law(problem: Problem, identified: Any, pushes: int = PUSHES, seed: int = 0) -> Validation:
    """Coasting and tracking with an identified law, and with the nominal one and the true one beside.

    Args:
        problem: of the study.
        identified: the law, as the plant takes it: lumps of a chain, parameters (njoint x 13) of an arm.
        pushes: how many pushes, which the search never used.
        seed: of these pushes.

    Raises:
        StudyError: the number of pushes or the seed is not allowed, or the plant is a rig.
    """
    if not 1 <= pushes <= MOST_PUSHES or seed < 0:
        raise StudyError(f"pushes is {pushes} and seed is {seed} (allowed: 1 to {MOST_PUSHES} pushes, a seed from 0)")
    laws = with_references(problem, {"identified": identified})
    course = course_of(problem, identified, pushes, fresh_seed(problem.spec.study.seed, seed))
    models = tuple(Validated(name, course.coasting(law), *course.tracking(law)) for name, law in laws.items())
    name, timestep = course.plant.name, course.plant.timestep
    return Validation(name, seed, course.pushes, timestep, course.steps * timestep, models, **course.about)


def fresh_seed(study_seed: int, seed: int) -> int:
    """Of a stream of random numbers that no study's pushes come from; another `seed` gives other pushes."""
    return int(np.random.SeedSequence([study_seed, seed]).generate_state(1)[0])
