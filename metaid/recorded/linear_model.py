"""What is unknown of a recorded plant, and the torque for a unit of each: the rigid bodies and their friction.

A planar chain is known by its lumps, an arm by its base parameters. Friction of joint j is any of: viscous q̇, Coulomb
sign(q̇), root sign(q̇) √|q̇| (which bends between rest and fast motion as lubricated gears do), an offset of the torque,
and the inertia of the rotor q̈. Two joints whose motors are coupled share all but the offset.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from metaid.models import IDEAL, Array, Chain, lump_names, lump_unit
from metaid.models.tree import PARAMETERS, Belief, Tree, torque_regressor

FRICTION = ("viscous", "coulomb", "root", "offset")  # what is unknown of a joint unless its user says otherwise
TERMS = (*FRICTION, "rotor")
SPREAD = 0.3  # standard deviation of a nominal lump, as a share of it
RIGID = len(PARAMETERS) - 2  # of an arm's parameters those that are no friction
_NAMES = {"viscous": "damping"}  # where the name of a parameter is not that of its term
_UNITS = {"viscous": "N m s", "coulomb": "N m", "root": "N m √s", "offset": "N m", "rotor": "kg m²"}
_ON_SLIDES = {"viscous": "N s/m", "coulomb": "N", "root": "N √(s/m)", "offset": "N", "rotor": "kg"}
Bodies = Callable[[Array, Array, Array], Array]


@dataclass(frozen=True)
class LinearModel:
    """A plant whose torque is linear in what is unknown of it.

    Attributes:
        names: of the unknowns (nparam), those of the bodies first.
        units: of them (nparam).
        expressions: what each is made of (nparam), empty where it is a parameter by itself.
        nominal: what is believed of the bodies (nbody).
        covariance: of that belief (nbody x nbody).
        bodies: the torque (... x njoint x nbody) for a unit of each of the bodies' unknowns, of joint coordinates,
            speeds and accelerations (... x njoint each).
        joints: the names of the joints (njoint).
        slides: which joints (njoint) are slides.
        friction: the terms of every joint, in the order of TERMS.
        coupled: pairs of joints whose motors are coupled, from 0 on.
        still: joint speed below which dry friction is a share of its whole (njoint), in rad/s or m/s.
        source: the chain with its gravity in m/s², or the belief in the arm.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    expressions: tuple[str, ...]
    nominal: Array
    covariance: Array
    bodies: Bodies
    joints: tuple[str, ...]
    slides: NDArray[np.bool_]
    friction: tuple[str, ...]
    coupled: tuple[tuple[int, int], ...]
    still: Array
    source: tuple[Chain, float] | Belief

    @property
    def njoint(self) -> int:
        return len(self.joints)

    @property
    def nbody(self) -> int:
        return len(self.nominal)

    @property
    def is_chain(self) -> bool:
        return not isinstance(self.source, Belief)

    def regressor(self, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
        """The torque (... x njoint x nparam) for a unit of each unknown, of joint coordinates, speeds and accelerations
        (... x njoint each).
        """
        parts = [self.bodies(coordinates, speeds, accelerations)]
        for term in self.friction:
            of_joint = friction_torque(term, speeds, accelerations, self.still)
            columns = np.zeros((*of_joint.shape, self.njoint))
            joints = np.arange(self.njoint)
            columns[..., joints, joints] = of_joint
            parts.append(columns[..., self._separate(term)])
        for first, second in self.coupled:
            parts += [
                self._coupling(term, first, second, speeds, accelerations) for term in self.friction if term != "offset"
            ]
            if "rotor" not in self.friction:
                parts.append(self._coupling("rotor", first, second, speeds, accelerations))
        return np.concatenate(parts, axis=-1)

    def with_still(self, still: Array) -> LinearModel:
        """The same with other speeds (njoint) below which dry friction is a share of its whole."""
        return replace(self, still=still)

    def _separate(self, term: str) -> NDArray[np.intp]:
        """The joints that have a term of their own: the rotor of a chain's first joint cannot be told from its link."""
        return np.arange(1 if term == "rotor" else 0, self.njoint)

    def _coupling(self, term: str, first: int, second: int, speeds: Array, accelerations: Array) -> Array:
        """The column (... x njoint x 1) of a motor that turns with the sum of two joints."""
        column = np.zeros((*speeds.shape, 1))
        if term in ("viscous", "rotor"):  # what it adds to each joint by itself, that joint's own term has
            moved = speeds if term == "viscous" else accelerations
            column[..., first, 0], column[..., second, 0] = moved[..., second], moved[..., first]
        else:
            together = speeds[..., [first]] + speeds[..., [second]]
            shared = friction_torque(term, together, together, self.still[[second]])
            column[..., first, :] = column[..., second, :] = shared
        return column


def friction_torque(term: str, speeds: Array, accelerations: Array, still: Array) -> Array:
    """The torque (... x njoint) for a unit of one term of friction.

    Args:
        term: one of TERMS.
        speeds: of the joints (... x njoint), in rad/s or m/s.
        accelerations: of the joints (... x njoint), in rad/s² or m/s².
        still: joint speed below which dry friction is a share of its whole (njoint), in rad/s or m/s.
    """
    if term == "viscous":
        return speeds
    if term == "rotor":
        return accelerations
    if term == "offset":
        return np.ones_like(speeds)
    sign = np.clip(speeds / still, -1.0, 1.0)
    return np.asarray(sign * np.sqrt(np.abs(speeds)) if term == "root" else sign, dtype=np.float64)


def chain_model(
    chain: Chain, gravity: float, friction: tuple[str, ...] = FRICTION, coupled: tuple[tuple[int, int], ...] = ()
) -> LinearModel:
    """That of a planar chain, its lumps unknown.

    Args:
        chain: the nominal one.
        gravity: in m/s².
        friction: the terms of every joint.
        coupled: pairs of joints, from 0 on, whose motors are coupled.
    """
    n, kinds = chain.nlink, (*IDEAL, "inertia")
    names = lump_names(n, kinds)
    nominal = chain.lumps_of(kinds).vector
    return _with_friction(
        names,
        [lump_unit(name) for name in names],
        [""] * len(names),
        nominal,
        np.diag((SPREAD * nominal) ** 2),
        lambda angles, speeds, accelerations: lump_regressor(angles, speeds, accelerations, gravity),
        [f"{i + 1}" for i in range(n)],
        np.zeros(n, dtype=np.bool_),
        friction,
        coupled,
        (chain, gravity),
    )


def lump_regressor(angles: Array, speeds: Array, accelerations: Array, gravity: float) -> Array:
    """The joint torque (... x njoint x nlump) for a unit of each gravity, Coriolis and inertia lump.  Eqs. 4 and 6.

    Args:
        angles: of the joints (... x njoint), in rad.
        speeds: of the joints (... x njoint), in rad/s.
        accelerations: of the joints (... x njoint), in rad/s².
        gravity: in m/s².
    """
    n = angles.shape[-1]
    angles, speeds, accelerations = (np.cumsum(each, axis=-1) for each in (angles, speeds, accelerations))
    first, second = np.triu_indices(n, 1)
    links, pairs = np.arange(n), np.arange(len(first))
    force = np.zeros((*angles.shape, 2 * n + len(first)))
    force[..., links, links] = -gravity * np.sin(angles)
    difference = angles[..., first] - angles[..., second]
    sine, cosine = np.sin(difference), np.cos(difference)
    force[..., first, n + pairs] = cosine * accelerations[..., second] + sine * speeds[..., second] ** 2
    force[..., second, n + pairs] = cosine * accelerations[..., first] - sine * speeds[..., first] ** 2
    force[..., links, n + len(first) + links] = accelerations
    return np.asarray(np.cumsum(force[..., ::-1, :], axis=-2)[..., ::-1, :], dtype=np.float64)  # Eq. 6


def arm_model(
    tree: Tree, friction: tuple[str, ...] = FRICTION, coupled: tuple[tuple[int, int], ...] = ()
) -> LinearModel:
    """That of an arm, its base parameters unknown, rotors among them.

    Args:
        tree: the nominal arm.
        friction: the terms of every joint; a rotor need not be named.
        coupled: pairs of joints, from 0 on, whose motors are coupled.
    """
    belief = Belief(tree)
    kept = belief.base.columns % len(PARAMETERS) < RIGID
    columns = belief.base.columns[kept]

    def bodies(coordinates: Array, speeds: Array, accelerations: Array) -> Array:
        every = torque_regressor(tree, coordinates, speeds, accelerations)
        return every.reshape(*every.shape[:-2], -1)[..., columns]

    def chosen(texts: tuple[str, ...]) -> list[str]:
        return [text for text, is_kept in zip(texts, kept, strict=True) if is_kept]

    return _with_friction(
        chosen(belief.base.names),
        chosen(belief.base.units),
        chosen(belief.base.expressions),
        belief.values[kept],
        belief.covariance[np.ix_(kept, kept)],
        bodies,
        list(tree.names),
        tree.slides,
        tuple(term for term in friction if term != "rotor"),
        coupled,
        belief,
    )


def _with_friction(
    names: list[str],
    units: list[str],
    expressions: list[str],
    nominal: Array,
    covariance: Array,
    bodies: Bodies,
    joints: list[str],
    slides: NDArray[np.bool_],
    friction: tuple[str, ...],
    coupled: tuple[tuple[int, int], ...],
    source: tuple[Chain, float] | Belief,
) -> LinearModel:
    """The model of bodies with these names, units and so on, and of the friction of their joints."""
    n, between = len(joints), "" if isinstance(source, Belief) else "_"
    friction = tuple(term for term in TERMS if term in friction)
    for term in friction:
        first = 1 if term == "rotor" else 0
        names = names + [f"{_NAMES.get(term, term)}{between}{joint + 1}" for joint in range(first, n)]
        units = units + [(_ON_SLIDES if slides[joint] else _UNITS)[term] for joint in range(first, n)]
    for one, other in coupled:
        terms = [term for term in friction if term != "offset"] + ["rotor"] * ("rotor" not in friction)
        names = names + [f"{_NAMES.get(term, term)}{between}{one + 1}_{other + 1}" for term in terms]
        units = units + [_UNITS[term] for term in terms]
    return LinearModel(
        names=tuple(names),
        units=tuple(units),
        expressions=(*expressions, *[""] * (len(names) - len(expressions))),
        nominal=nominal,
        covariance=covariance,
        bodies=bodies,
        joints=tuple(joints),
        slides=slides,
        friction=friction,
        coupled=coupled,
        still=np.full(n, 0.01),
        source=source,
    )
