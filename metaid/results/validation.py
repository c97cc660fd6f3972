"""How well a study's result serves: on pushes that the search never used, and in control along a trajectory.

Both are simulated with the nominal lumps, the identified ones and, where the plant knows them, the true ones. The true
ones only serve to say how good a result could have been.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metaid.episode import REACH, natural_time, rich_pushes
from metaid.errors import StudyError
from metaid.models import Array, Chain, ChainModel, Lumps, compensation_torque, kind_of
from metaid.plant import MujocoPlant, Plant, Start
from metaid.results.control import BANDWIDTH, smooth_sinusoids, track
from metaid.results.snapshot import Snapshot
from metaid.results.verdict import Verdict
from metaid.study import HORIZON, Problem

COASTING = 0.1  # a joint speed changed by more than this share of the fastest link's is no longer coasting
COASTING_HORIZON = 100.0  # natural times for which coasting is watched
PUSHES, MOST_PUSHES = 10, 1000
DEGREES = 180.0 / np.pi
Joints = slice | NDArray[np.bool_]


@dataclass(frozen=True)
class Validated:
    """How a plant moves with the lumps named `model`.

    `coasting` (npush): time, in s, for which each push coasts, at most the horizon; `errors` (nsteps x njoint): of the
    joint coordinates along the trajectory, in rad or m, as far as it got before the plant was out of control; `tracked`
    is whether it got to the end.
    """

    model: str
    coasting: Array
    errors: Array
    tracked: bool

    @property
    def rms_error(self) -> float:
        """Root of the mean square of the tracking errors, in rad; infinite if control was lost."""
        return self.rms_of(slice(None))

    def rms_of(self, joints: Joints) -> float:
        """The same of some `joints`, in rad or m."""
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

    @property
    def kinds(self) -> dict[str, tuple[Joints, float]]:
        """The joints of each kind, by the unit that their errors are shown in, and how many of it a rad or m is."""
        if self.slides is None:
            return {"deg": (slice(None), DEGREES)}
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


def check_pushes(pushes: int, seed: int) -> None:
    """Raises StudyError where so many pushes, or such a seed, are not allowed."""
    if not 1 <= pushes <= MOST_PUSHES or seed < 0:
        raise StudyError(f"pushes is {pushes} and seed is {seed} (allowed: 1 to {MOST_PUSHES} pushes, a seed from 0)")


def fresh_seed(study_seed: int, seed: int) -> int:
    """Of a stream of random numbers that no study's pushes come from."""
    return int(np.random.SeedSequence([study_seed, seed]).generate_state(1)[0])


def validate_chain(snapshot: Snapshot, verdict: Verdict, pushes: int = PUSHES, seed: int = 0) -> Validation:
    """`validate_factors` of what a study found.

    Args:
        snapshot: of the study.
        verdict: on it.
        pushes: how many pushes, which the search never used.
        seed: of these pushes.

    Raises:
        StudyError: no lump was found, or as `validate_factors` does.
    """
    found = verdict.lumps.set_index("name")
    if not (verdict.has_result or (found["determined"] & found["factor"].notna()).any()):
        raise verdict.refusal(snapshot.name, "nothing to validate")
    factors = found["factor"].fillna(1.0)
    inertia = factors[[lump for lump in found.index if kind_of(lump) == "inertia"]]
    values = (inertia * found["nominal"][inertia.index]).to_numpy() if len(inertia) else None
    return validate_factors(snapshot.problem, factors[snapshot.problem.names].to_numpy(), pushes, seed, values)


def validate_factors(
    problem: Problem, factors: Array, pushes: int = PUSHES, seed: int = 0, inertia: Array | None = None
) -> Validation:
    """Coasting and tracking with identified lumps, and with the nominal ones and the true ones beside.

    Args:
        problem: of the study.
        factors: of its lumps (nlump), as identified.
        pushes: how many rich pushes.
        seed: of these pushes.
        inertia: the inertia lumps (nlink), in kg m², where an estimate has identified them.

    Raises:
        StudyError: the number of pushes or the seed is not allowed, or the plant is a rig.
    """
    check_pushes(pushes, seed)
    plant, nominal = problem.make_plant(), problem.nominal
    time = natural_time(nominal, plant.gravity)
    fresh = fresh_pushes(plant, pushes, REACH / (HORIZON * time), problem.spec.study.seed, seed)
    steps = round(COASTING_HORIZON * time / plant.timestep)
    candidates = {"nominal": problem.lumps, "identified": replace(problem.lumps.scaled(factors), inertia=inertia)}
    truth = plant.true_lumps()
    if truth is not None:
        candidates["true"] = truth
    if inertia is None:
        candidates = {name: _with_nominal_inertia_ratio(lumps, nominal) for name, lumps in candidates.items()}

    def validated(name: str, lumps: Lumps) -> Validated:
        coasting = np.array([coasting_time(plant, lumps, impulses, steps) for impulses in fresh])
        return Validated(name, coasting, *tracking_errors(plant, lumps, nominal))

    models = tuple(validated(name, lumps) for name, lumps in candidates.items())
    horizon, assumed = steps * plant.timestep, inertia is None
    return Validation(plant.name, seed, fresh, plant.timestep, horizon, models, time, takes_nominal_inertia=assumed)


def _with_nominal_inertia_ratio(lumps: Lumps, nominal: Chain) -> Lumps:
    """Where inertia lumps are not identified, d_i is μ_i times the nominal model's d_i / μ_i, for every model alike."""
    return replace(lumps, inertia=nominal.inertia_lumps * lumps.gravity / nominal.lumps.gravity)


def fresh_pushes(plant: Plant, count: int, peak_speed: float, study_seed: int, seed: int) -> Array:
    """Rich pushes from a stream of random numbers that no study's pushes come from.

    Args:
        plant: that is pushed.
        count: of the pushes.
        peak_speed: of the fastest link after each, in rad/s.
        study_seed: the study's seed.
        seed: of the validation; another one gives other pushes.

    Returns:
        The impulses (count x njoint), in N s.
    """
    return rich_pushes(plant, count, peak_speed, fresh_seed(study_seed, seed))


def coasting_time(plant: Plant, lumps: Lumps, impulses: Array, steps: int) -> float:
    """For how long a plant coasts after a push, with `lumps` in the law.

    It has coasted until a joint's speed has changed by a tenth of the speed of the fastest link after the push. A
    MujocoPlant is watched by a compiled loop, any other step by step.

    Args:
        plant: it is brought to rest upright first.
        lumps: of the law.
        impulses: of the push (njoint), in N s.
        steps: after which it is no longer watched.

    Returns:
        The time in s, at most that of all `steps`.
    """
    if not isinstance(plant, MujocoPlant):
        return coasting_time_stepwise(plant, lumps, impulses, steps)
    from metaid.compiled import coasting_steps

    return coasting_steps(plant, lumps, impulses, steps, COASTING) * plant.timestep


def coasting_time_stepwise(plant: Plant, lumps: Lumps, impulses: Array, steps: int) -> float:
    """`coasting_time` on any plant, in s, step by step in Python: the reference for the compiled loop.

    Args:
        plant: it is brought to rest upright first.
        lumps: of the law.
        impulses: of the push (njoint), in N s.
        steps: after which it is no longer watched.
    """
    plant.push(Start.upright(impulses))
    angles, speeds = plant.states()
    pushed, tolerance = speeds, COASTING * np.abs(np.cumsum(speeds)).max()
    for step in range(steps):
        plant.apply_torque(compensation_torque(lumps, angles, speeds, plant.gravity))
        plant.step()
        angles, speeds = plant.states()
        if not np.abs(speeds - pushed).max() <= tolerance:
            return step * plant.timestep
    return steps * plant.timestep


def tracking_errors(plant: Plant, lumps: Lumps, nominal: Chain) -> tuple[Array, bool]:
    """Errors of the joint angles (nsteps x njoint), in rad, along smooth sinusoids under computed torque with `lumps`,
    up to where control was lost, and whether it never was.

    The feedback is weighted by the nominal mass matrix, for every model alike.
    """
    time = natural_time(nominal, plant.gravity)
    desired = smooth_sinusoids(plant.njoint, time, plant.timestep)
    model, feedback = ChainModel(lumps, plant.gravity), ChainModel(nominal.lumps, plant.gravity)
    seen = track(plant, model, feedback, desired, BANDWIDTH / time)
    return seen.angles - desired.angles[: len(seen.angles)], len(seen.angles) == len(desired.angles)
