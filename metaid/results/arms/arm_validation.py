"""How well the result of a study of an arm serves: on coasts that the search never used, and along a trajectory.

Both are simulated with the nominal arm, the identified one and, where the plant knows it, the true one. The true one
only serves to say how good a result could have been. Sensors are exact here, for it is models that are compared.
"""

from __future__ import annotations

import numpy as np

from metaid.models import Array
from metaid.plant.arms import ArmPlant
from metaid.results.arms.arm_snapshot import ArmSnapshot
from metaid.results.arms.arm_verdict import laws
from metaid.results.control import AMPLITUDE, LOST, smooth_sinusoids
from metaid.results.validation import COASTING, PUSHES, Validated, Validation, check_pushes, fresh_seed
from metaid.results.verdict import Verdict

COASTING_HORIZON = 1.0  # s for which coasting is watched: joints cross half of their ranges at most
SHORTEST, LONGEST = 1.0, 2.0  # s, periods of the joints along the trajectory
BANDWIDTH = 10.0  # rad/s, of the feedback
ROOM = 0.5  # of half a joint's range, that the mean joint swings at most
SLIDE = 1.0 / 3.0  # m that a slide swings for each rad of a hinge


def validate_arm(snapshot: ArmSnapshot, verdict: Verdict, pushes: int = PUSHES, seed: int = 0) -> Validation:
    """Coasting and tracking with the identified arm, and with the nominal one and the true one beside.

    Args:
        snapshot: of a study.
        verdict: on it.
        pushes: how many coasts, which the search never used.
        seed: of these.

    Raises:
        StudyError: nothing was found, or the number of pushes or the seed is not allowed.
    """
    from metaid.compiled.arms import arm_coasting_steps  # loads numba
    from metaid.plant.arms import draw_free_starts  # loads MuJoCo

    if not verdict.has_result:
        raise verdict.refusal(snapshot.name, "nothing to validate")
    check_pushes(pushes, seed)
    plant, nominal = snapshot.problem.make_plant(), snapshot.problem.nominal
    study = snapshot.spec.study
    steps, random = round(COASTING_HORIZON / plant.timestep), fresh_seed(study.seed, seed)
    starts = draw_free_starts(nominal, pushes, COASTING_HORIZON, random, study.episode.speed)
    candidates = laws(snapshot, verdict)

    def validated(name: str, law: Array) -> Validated:
        coasted = arm_coasting_steps(plant, (law, nominal.parameters), starts, steps, COASTING)
        return Validated(
            name,
            plant.timestep * coasted.astype(np.float64),
            *arm_tracking_errors(plant, (law, candidates["identified"])),
        )

    models = tuple(validated(name, law) for name, law in candidates.items())
    fresh = np.array([(start.pose, start.speeds) for start in starts])
    return Validation(plant.name, seed, fresh, plant.timestep, steps * plant.timestep, models, slides=nominal.slides)


def arm_tracking_errors(plant: ArmPlant, laws: tuple[Array, Array]) -> tuple[Array, bool]:
    """Errors of the joint coordinates (nsteps x njoint), in rad or m, along smooth sinusoids from the middle of the
    ranges under computed torque, up to where control was lost, and whether it never was.

    Args:
        plant: that moves.
        laws: parameters (njoint x 13 each) of the feedforward, and of the arm whose mass matrix weighs the feedback,
            the same for every feedforward.
    """
    from metaid.compiled.arms import track_arm  # loads numba

    tree = plant.tree
    half = np.where(np.isfinite(tree.low + tree.high), 0.5 * (tree.high - tree.low), np.inf)
    middle = np.where(np.isfinite(half), tree.low + half, np.clip(0.0, tree.low, tree.high))
    widest = np.where(tree.slides, SLIDE * AMPLITUDE, AMPLITUDE)
    amplitude, periods = np.minimum(widest, ROOM * half), (SHORTEST, LONGEST)
    desired = smooth_sinusoids(tree.njoint, 1.0, plant.timestep, amplitude=amplitude, periods=periods)
    angles = middle + desired.angles
    seen = track_arm(plant, laws, (angles, desired.speeds, desired.accelerations), BANDWIDTH, LOST)
    return seen - angles[: len(seen)], len(seen) == len(angles)
