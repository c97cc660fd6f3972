"""Logs of arms that swing as sums of sinusoids, whose torques are exact."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from random_arm import wrong_tree

from metaid.models import Array
from metaid.models.tree import Tree, joint_torque
from metaid.plant import ArmPlant, load_plant
from metaid.recorded import Choices, LogRun, RecordedEstimate, arm_model, estimate_records

DRY = np.array([3.0, 2.0, 1.0])  # N m, of each joint
BASE = ("viscous", "coulomb")
# What a test is not about is said: to choose it takes longer than all else.
SAID: dict[str, Any] = {"friction": ("viscous", "coulomb"), "window": 0.2, "delay": 0.0}


def swinging(
    seconds: float, rows: int, njoint: int, seed: int, period: float | None = None
) -> tuple[Array, Array, Array, Array]:
    """Times (nrow), and coordinates, speeds and accelerations (nrow x njoint) of sums of sinusoids; those that recur
    after a `period`, in s.
    """
    random = np.random.default_rng(seed)
    times = np.linspace(0.0, seconds, rows)
    pulse = random.uniform(2.0, 9.0, (3, njoint))
    if period is not None:
        pulse = 2.0 * np.pi / period * np.ceil(pulse * period / (2.0 * np.pi))
    phase = random.uniform(0.0, 2.0 * np.pi, (3, njoint))
    angle = times[:, None, None] * pulse + phase
    size = random.uniform(0.2, 0.5, (3, njoint))
    return (
        times,
        (size * np.sin(angle)).sum(axis=1),
        (size * pulse * np.cos(angle)).sum(axis=1),
        (-size * pulse**2 * np.sin(angle)).sum(axis=1),
    )


def log_of(
    tree: Tree,
    late: float = 0.0,
    noise: float = 0.0,
    extra: Callable[[Array], Array] | None = None,
    seconds: float = 6.0,
    seed: int = 3,
    period: float | None = None,
) -> LogRun:
    """The log of an arm that swings; its torques act `late` s after they are logged, as an exact model says, and
    `extra` ones that follow from speeds (nrow x njoint).
    """
    fine, rows = 4, round(500 * seconds)
    times, *_ = swinging(seconds, rows + 1, tree.njoint, seed, period)
    every, coordinates, speeds, accelerations = swinging(seconds, rows * fine + 1, tree.njoint, seed, period)
    torques = joint_torque(tree, coordinates, speeds, accelerations)
    torques += 0.0 if extra is None else extra(speeds)
    shifted = times[:, None] + late + times[1] * (np.arange(fine) + 0.5) / fine  # a torque holds until the next
    held = np.stack([np.interp(shifted, every, column).mean(axis=1) for column in torques.T], axis=1)
    angles = coordinates[::fine] + noise * np.random.default_rng(1).standard_normal((rows + 1, tree.njoint))
    return LogRun("swing.csv", times, angles, None, held)


def swinging_arm() -> Tree:
    """A shipped arm, its friction left out."""
    plant = load_plant("spatial-three-link")
    assert isinstance(plant, ArmPlant)
    return plant.tree.with_parameters(plant.tree.parameters * np.array([1.0] * 11 + [0.0, 0.0]))


def arm_log(extra: Callable[[Array], Array] | None = None, noise: float = 1e-5, seconds: float = 2.0) -> LogRun:
    return log_of(swinging_arm(), noise=noise, extra=extra, seconds=seconds)


def estimated(*records: LogRun, friction: tuple[str, ...] | None = BASE, span: float = 0.1) -> RecordedEstimate:
    model = arm_model(wrong_tree(swinging_arm(), 0))
    return estimate_records(records, model, Choices(span=span, friction=friction, zeros=False, delay=0.0))
