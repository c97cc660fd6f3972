"""Friction over speed and gravity torque over angle: what is known of them even where terms and bodies are not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from metaid.models import Array
from metaid.recorded.estimating import RecordedEstimate

SHARES = (0.1, 0.4, 1.0)  # of a joint's fastest speed
POINTS = 61  # of a gravity curve
NOTHING = 1e-6  # of the usual torque: gravity does not load such a joint


@dataclass(frozen=True)
class FrictionCurve:
    """The friction of a `joint` that slides: torques in N m (N) with their standard deviations at speeds in rad/s
    (m/s).
    """

    joint: str
    speed: Array
    torque: Array
    sd: Array


@dataclass(frozen=True)
class GravityCurve:
    """The torque that holds a `joint` against gravity, in N m (N), with its standard deviations, where it alone turns
    through the `angle` in rad (m), and what the nominal bodies need (N each).
    """

    joint: str
    angle: Array
    torque: Array
    sd: Array
    nominal: Array


def gravity_curves(found: RecordedEstimate) -> list[GravityCurve]:
    """The gravity torque of each joint that gravity loads, over the angles that the logs have, the other joints at the
    middle of theirs.
    """
    model = found.model
    angles = np.concatenate([own.coordinates + zeros for own, zeros in zip(found.logs, found.zeros, strict=True)])
    usual = max(float(np.sqrt(np.mean(np.square(own.sent)))) for own in found.logs)
    bodies, covariance = found.values[: model.nbody], found.covariance[: model.nbody, : model.nbody]
    curves = []
    for joint in range(model.njoint):
        poses = np.tile(np.median(angles, axis=0), (POINTS, 1))
        poses[:, joint] = np.linspace(angles[:, joint].min(), angles[:, joint].max(), POINTS)
        rest = np.zeros_like(poses)
        columns = model.bodies(poses, rest, rest)[:, joint]
        torque, sd = _told(columns, bodies, covariance)
        if np.abs(torque).max() > NOTHING * usual:
            nominal = found.scale * (columns @ model.nominal)
            curves.append(GravityCurve(model.joints[joint], poses[:, joint], torque, sd, nominal))
    return curves


def friction_curves(found: RecordedEstimate, shares: Sequence[float] = SHARES) -> list[FrictionCurve]:
    """The friction of each joint at `shares` of the fastest speed that the logs have; what grows with load, at its
    usual load.
    """
    model, n = found.model, found.model.njoint
    usual = _usual_load(found)
    curves = []
    for joint in range(n):
        speeds = found.equations.fastest[joint] * np.array(shares)
        moving = np.zeros((len(speeds), n))
        moving[:, joint] = speeds
        at_rest, rigid = np.zeros_like(moving), np.zeros_like(moving)
        rigid[:, joint] = usual[joint]
        sliding = model.sliding.steady(moving)
        columns = model.friction_columns(at_rest, moving, at_rest, sliding, rigid)[:, joint]
        if ("offset", joint) in model.columns:
            columns[:, model.columns["offset", joint] - model.nbody] = 0.0
        torque, sd = _told(columns, found.values[model.nbody :], found.covariance[model.nbody :, model.nbody :])
        curves.append(FrictionCurve(model.joints[joint], speeds, torque, sd))
    return curves


def _told(columns: Array, values: Array, covariance: Array) -> tuple[Array, Array]:
    """The torques (N) that `columns` (N x n) make of `values` of unknowns (n), and their standard deviations (N)."""
    variance = np.einsum("ij,jk,ik->i", columns, covariance, columns)
    return columns @ values, np.sqrt(np.maximum(variance, 0.0))


def _usual_load(found: RecordedEstimate) -> Array:
    """The mean size of the torque of the bodies in each joint (njoint), in N m or N."""
    bodies = found.values[: found.model.nbody]
    logs = zip(found.logs, found.zeros, strict=True)
    loads = [own.rigid(found.model, bodies, zeros)[own.judged] for own, zeros in logs]
    return np.asarray(np.abs(np.concatenate(loads)).mean(axis=0), dtype=np.float64)
