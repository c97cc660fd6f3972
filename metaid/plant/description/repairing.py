"""What files of robots have and no robot can have, made what it can: inertias, friction, rotors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from metaid.models import Array
from metaid.plant.description.refusing import LARGEST
from metaid.plant.lean import mujoco

NOTHING = 1e-9  # kg, of a link that weighs nothing: MuJoCo moves none of no mass
SMALL = 1e-3  # m: its radius of gyration
LEAST = 1e-3  # of the sum of the second moments, that a repaired body has along each axis at least
ROUNDING = 1e-9  # of it: a body that is as thin as this can be
FRAME = 1e-6  # of the file's largest inertia: a link that has less stands for a frame
DENSITY = 2700.0  # kg/m³, aluminium: of the ball whose inertia a link gets that has none
_UPPER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # of a full inertia in MuJoCo's order


@dataclass(frozen=True)
class BodyRepair:
    """What was repaired in a body, as a sentence without a full stop, and the names of the joints (empty where they
    have none) by which it hangs on the base.
    """

    text: str
    joints: tuple[str, ...]

    def matters(self, moving: tuple[str, ...]) -> bool:
        """Whether a joint moves the body, of those that are `moving`."""
        return any(not joint or joint in moving for joint in self.joints)


def repair_inertias(spec: mujoco.MjSpec, is_said: Callable[[mujoco.MjsBody], bool]) -> tuple[BodyRepair, ...]:
    """Makes impossible inertias possible, and gives moving bodies some where they have none; what was changed. Only
    bodies whose mass and inertia are said by the file, and do not follow from shapes, are looked at.
    """
    made, base = [], spec.worldbody
    base.explicitinertial, base.mass, base.inertia, base.fullinertia = False, 0.0, np.zeros(3), np.full(6, np.nan)
    bodies = list(spec.bodies)[1:]
    largest = max((float(np.abs(_inertia(body)).max()) for body in bodies), default=0.0)
    least = FRAME * min(largest, 1.0)  # one that is far too large must not silence all others
    for body in bodies:
        if is_said(body):
            text = _possible(body, least) or (_with_some(body) if body.joints else "")
            if text:
                made.append(BodyRepair(text, tuple(_joints(body))))
    return tuple(made)


def repair_joints(model: mujoco.MjModel) -> tuple[BodyRepair, ...]:
    """Makes friction and rotors below 0 none, in a compiled model; what was changed."""
    made = []
    for key in ("armature", "damping", "frictionloss"):
        values = getattr(model, f"dof_{key}")
        for degree in np.flatnonzero(values < 0.0).tolist():
            name = model.joint(int(model.dof_jntid[degree])).name
            text = f"joint '{name}' has {key} {values[degree]:g}, which no joint has: 0 is taken"
            made.append(BodyRepair(text, (name,)))
            values[degree] = 0.0
    return tuple(made)


def possible_inertia(inertia: Array) -> Array:
    """The inertia (3 x 3) of a body that can be, whose second moments are nearest to those of a given one."""
    second = 0.5 * np.trace(inertia) * np.eye(3) - inertia  # Σ = ½ tr(I) 1 − I, not negative of any body
    moments, axes = np.linalg.eigh(second)
    size = np.abs(moments).sum()
    if moments[0] >= ROUNDING * size:
        return inertia
    is_possible = moments[0] >= -ROUNDING * size and moments[0] + moments[1] > ROUNDING * size
    moments = np.maximum(moments, (ROUNDING if is_possible else LEAST) * size)
    nearest: Array = moments.sum() * np.eye(3) - (axes * moments) @ axes.T
    return nearest


def _possible(body: mujoco.MjsBody, least: float) -> str:
    """Mends the inertia of a body where it is impossible; what was done, unless the change is rounding, or below the
    `least` that is worth a word, in kg m².
    """
    inertia = _inertia(body)
    if not inertia.any() or not np.abs(inertia).max() <= LARGEST:
        return ""
    mended = possible_inertia(inertia)
    if mended is inertia:
        return ""
    if np.isnan(body.fullinertia[0]):
        body.inertia = np.diag(mended)
    else:
        body.fullinertia = [mended[place] for place in _UPPER]
    if np.allclose(mended, inertia, rtol=0.0, atol=max(10.0 * ROUNDING * np.abs(inertia).max(), least)):
        return ""
    moments = " ".join(f"{moment:.3g}" for moment in np.linalg.eigvalsh(inertia))
    return f"no body has the inertia of '{body.name}' (principal moments {moments} kg m²): the nearest one is taken"


def _with_some(body: mujoco.MjsBody) -> str:
    """Gives a body that moves, and what is fixed to it, an inertia where they have none; what was done."""
    parts = list(_fixed(body))
    mass = sum(part.mass for part in parts)
    has_some = mass > 0.0 and any(_inertia(part).any() for part in parts)
    if min(part.mass for part in parts) < 0.0 or not mass <= LARGEST or has_some:
        return ""
    if mass > 0.0:
        radius = (3.0 * mass / (4.0 * np.pi * DENSITY)) ** (1.0 / 3.0)
        heaviest = max(parts, key=lambda part: part.mass)
        heaviest.inertia = np.full(3, 0.4 * mass * radius**2)
        return f"'{body.name}' has no inertia: that of a ball of {mass:g} kg is taken"
    if any(len(part.geoms) for part in parts if not part.explicitinertial):
        return ""
    body.explicitinertial, body.mass, body.fullinertia = True, NOTHING, np.full(6, np.nan)
    body.ipos, body.inertia = np.zeros(3), np.full(3, NOTHING * SMALL**2)
    return f"'{body.name}' weighs nothing"


def _inertia(body: mujoco.MjsBody) -> Array:
    """About the centre of mass (3 x 3), in kg m²."""
    if np.isnan(body.fullinertia[0]):
        return np.diag(body.inertia)
    inertia = np.zeros((3, 3))
    for value, (row, column) in zip(body.fullinertia, _UPPER, strict=True):
        inertia[row, column] = inertia[column, row] = value
    return inertia


def _fixed(body: mujoco.MjsBody) -> Iterator[mujoco.MjsBody]:
    """A body, and all that no joint moves against it."""
    yield body
    for child in body.bodies:
        if not child.joints:
            yield from _fixed(child)


def _joints(body: mujoco.MjsBody) -> Iterator[str]:
    """The names of the joints by which a body hangs on the base."""
    while body is not None:
        yield from (joint.name for joint in body.joints)
        body = body.parent
