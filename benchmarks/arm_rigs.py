"""The arms of `benchmarks.arms`: plants, beliefs, and where and how fast a push begins."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.common import NEEDS_MORE
from metaid.episode import Episode, SensorReadings, arm_episode, window_ends
from metaid.estimation import ArmEstimate, ArmLaws, BaseUnknowns, Loop, Motions, Readings, ReadTrial, SeenTrial, fit
from metaid.models import Array
from metaid.models.tree import ArmPrior, PriorDeviations
from metaid.plant import ArmPlant, ArmSettings, FaultSettings, load_plant
from metaid.plant.description import draw_starts
from metaid.study import drawn_nominal

SHIPPED = ("pa10", "crs-a465", "puma560")
OTHERS = ("scara", "spatial-three-link")  # shipped, too
URDFS = {
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
}
JOINTS = {"panda": tuple(f"panda_joint{i}" for i in range(1, 8))}  # of the others all move
HORIZON, WINDOWS, STIFFNESS = 0.3, 6, 30.0  # s, their number, 1/s²
# Of the torque limit: a rotor's inertia per rad/s², viscous friction per rad/s, dry friction.
ROTOR, DAMPING, COULOMB = 0.004, 0.01, 0.02
WITHIN = 0.01  # of all three errors: an arm that is known


def plant_of(name: str, seed: int, noise: float, is_smooth: bool = False) -> ArmPlant:
    """The plant of that name; a smooth one has no dry friction."""
    if name in (*SHIPPED, *OTHERS):
        found = load_plant(name)
        assert isinstance(found, ArmPlant), name
        plant = found
    else:
        plant = ArmPlant(name, _settings(name, seed))
    changes: dict[str, object] = {"faults": FaultSettings(angle_noise=noise, speed_sensor=not noise)}
    if is_smooth:
        changes["frictionloss"] = dict.fromkeys(plant.tree.names, 0.0)
    return ArmPlant(plant.name, plant.settings.model_copy(update=changes))


def experiment_on(plant: ArmPlant, seed: int) -> tuple[ArmPrior, Episode]:
    """What is believed of an arm, and what is done to it."""
    n, steps = plant.njoint, round(HORIZON / plant.timestep)
    starts = draw_starts(plant, 3 * n, HORIZON, seed)
    stiffness = np.where(np.arange(3 * n) < 2 * n, 0.0, STIFFNESS)
    reads = bool(plant.settings.faults.named)
    prior = ArmPrior(drawn_nominal(plant.tree, seed, PriorDeviations()))
    kept = {"window_ends": window_ends(steps, WINDOWS), "readings_steps": steps if reads else 0}
    return prior, arm_episode(prior.nominal, starts, stiffness, steps, seed=seed, **kept)


def read_trial(laws: ArmLaws, law: Array, loop: Loop, read: SensorReadings) -> ReadTrial:
    """The trial on noisy sensors in which a law led to these readings.

    Args:
        laws: of the study.
        law: that was sent (njoint x 13).
        loop: how the arm is controlled and read.
        read: what the sensors read.
    """
    return loop.trial(read, laws.episode.begins, partial(laws.commanded, law))


def estimate_arm(trials: Sequence[SeenTrial], searched: BaseUnknowns, before: ArmEstimate | None) -> ArmEstimate | None:
    """What all `trials` say of what is `searched`, from the estimate `before` where that explained its trials; None
    where no arm shows what they did.
    """
    start = before.start if before is not None and before.is_explained else None
    read = [trial for trial in trials if isinstance(trial, ReadTrial)]
    watched = [trial for trial in trials if not isinstance(trial, ReadTrial)]
    try:
        compared = Readings(read, searched) if read else Motions(watched, searched)
        found: ArmEstimate = fit(compared, start, refines=start is not None)
    except ValueError:
        return None
    return found


def _settings(name: str, seed: int) -> ArmSettings:
    path = _robots() / URDFS[name]
    plain = ArmSettings(urdf=str(path), joints=JOINTS.get(name))
    tree, random = ArmPlant(name, plain).tree, np.random.default_rng(1000 + seed)
    factors = random.uniform(0.5, 1.5, (3, tree.njoint)) * tree.torque_limit

    def said(share: float, row: int, present: Array) -> dict[str, float]:
        values = np.where(present > 0.0, present, share * factors[row])
        return dict(zip(tree.names, values.tolist(), strict=True))

    rotor, damping, coulomb = (
        said(share, row, present)
        for row, (share, present) in enumerate(((ROTOR, tree.rotor), (DAMPING, tree.damping), (COULOMB, tree.coulomb)))
    )
    return plain.model_copy(update={"rotor": rotor, "damping": damping, "frictionloss": coulomb})


def _robots() -> Path:
    for place in map(Path, sys.path):
        for found in place.glob("cmeel.prefix/share/example-robot-data/robots"):
            return found
    print("the URDFs are those of example-robot-data, which make robots installs", file=sys.stderr)
    sys.exit(NEEDS_MORE)
