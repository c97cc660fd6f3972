"""What is unknown of a recorded robot, and the torque for a unit of each: rigid bodies with their rotors, and friction.

A planar chain is known by its lumps and rotors, an arm by its base parameters. Friction of a joint is any terms of Eq.
66, which single joints may be without. Two joints whose motors are coupled share all but offset, load and spring.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from metaid.models import COARSEST, Array, Chain
from metaid.models.tree import (
    COLUMNS,
    PARAMETERS,
    SHARED,
    ArmPrior,
    Dynamics,
    JointFriction,
    Sliding,
    Tree,
    friction_torque,
    is_pendulum,
    turning,
)
from metaid.recorded.reading.readings import TURN

TERMS, BASE = (*COLUMNS, "hysteresis", "bent"), ("viscous", "coulomb")
ROTOR = PARAMETERS.index("rotor")
RIGID = len(PARAMETERS) - 2  # of an arm's parameters those that are no friction
_UNITS = {  # of hinges, and of slides
    "viscous": ("N m s", "N s/m"),
    "coulomb": ("N m", "N"),
    "root": ("N m √s", "N √(s/m)"),
    "offset": ("N m", "N"),
    "load": ("", ""),
    "spring": ("N m/rad", "N/m"),
    "rotor": ("kg m²", "kg"),
}
How = Literal["presliding", "bent"]  # of `Sliding`: how dry friction follows the motion
TURNED, SLIGHT = 0.5, 1e-3  # rad or m; of the largest torque
LEAST_TURN, LEAST_SLIDE = 0.02, 0.002  # rad, m: within less a joint does not slide, it bends and creeps
POSES = 64  # in which bodies are weighed
HELD = 0.02  # of how far the joint turns that turns farthest, or a turn: one that turns by less is held, and gives way


@dataclass(frozen=True)
class LinearModel:
    """A robot whose torque is linear in what is unknown of it.

    Attributes:
        names: of the unknowns (nparam), those of the bodies and their rotors first.
        units: of them (nparam).
        expressions: what each is made of (nparam), empty where it is a parameter by itself.
        nominal: values of the bodies' unknowns beforehand (nbody).
        covariance: of these (nbody x nbody).
        bodies: the torque (... x njoint x nbody) for a unit of each of the bodies' unknowns, of joint coordinates,
            speeds and accelerations (... x njoint each).
        rigid: the torque (... x njoint) of bodies with such values (nbody, or ... x nbody), of the same, where speeds
            and accelerations are broadcast to coordinates: at much less cost.
        dynamics: what makes of coordinates and speeds (nstate x njoint each) the mass matrix (nstate x njoint x njoint)
            and the torque without accelerations (nstate x njoint), of such bodies (nbody, or nstate x nbody).
        joints: the names of the joints (njoint).
        slides: which joints (njoint) are slides.
        sliding: how dry friction follows the motion, and which joints are coupled.
        untrusted: which joints (njoint) move, but nothing is fitted to their torques.
        passive: which joints (njoint) have no motor, so that their torque is known to be 0.
        tree: the nominal robot, whose joints may have other names.
        prior: of an arm; None of a chain.
        chain: the nominal one; None of an arm.
        rubbing: terms of friction, each with a joint that has it, from 0 on.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    expressions: tuple[str, ...]
    nominal: Array
    covariance: Array
    bodies: Callable[[Array, Array, Array], Array]
    rigid: Callable[[Array, Array, Array, Array], Array]
    dynamics: Callable[[Array], Dynamics]
    joints: tuple[str, ...]
    slides: NDArray[np.bool_]
    sliding: Sliding
    untrusted: NDArray[np.bool_]
    passive: NDArray[np.bool_]
    tree: Tree
    prior: ArmPrior | None = None
    chain: Chain | None = None
    rubbing: frozenset[tuple[str, int]] = frozenset()

    @property
    def njoint(self) -> int:
        return len(self.joints)

    @property
    def nbody(self) -> int:
        return len(self.nominal)

    @property
    def is_chain(self) -> bool:
        return self.chain is not None

    @property
    def places(self) -> dict[str, int]:
        """Where each joint is, from 0 on, by its name or its number from 1 on."""
        names = [*self.joints, *(str(joint + 1) for joint in range(self.njoint))]
        return {name: names.index(name) % self.njoint for name in names}

    def named(self, which: NDArray[np.bool_]) -> list[str]:
        """The names of some joints (njoint)."""
        return [name for name, is_one in zip(self.joints, which, strict=True) if is_one]

    @property
    def is_free(self) -> bool:
        """Whether no joint has a torque that says how heavy the bodies are."""
        return bool((self.passive | self.untrusted).all())

    @cached_property
    def is_pendulum(self) -> bool:
        """Whether it turns about parallel horizontal axes, as a chain does and an arm may."""
        return self.is_chain or is_pendulum(self.tree)

    @cached_property
    def turning(self) -> Array:
        """By which coordinates (njoint x njoint) each joint's link turns against the base: its own, and those of hinges
        with parallel axes right before it.
        """
        return turning(self.tree)

    @cached_property
    def placed(self) -> NDArray[np.bool_]:
        """Which joints (njoint) have a zero that the torque of the bodies depends on, as of no turret that stands
        upright.
        """
        q, v, a = np.random.default_rng(0).uniform(-1.0, 1.0, (3, self.njoint))
        usual, *others = self.rigid(self.nominal, np.vstack([q, q + TURNED * np.eye(self.njoint)]), v, a)
        return np.asarray((np.abs(others - usual) > SLIGHT * np.abs(usual).max()).any(axis=1))

    @cached_property
    def weight(self) -> Array:
        """By which the bodies' unknowns (nbody) are multiplied and summed, so that nominal ones make 1: what all bodies
        weigh together, by the torques that hold the nominal ones in many poses.
        """
        poses = np.random.default_rng(0).uniform(-np.pi, np.pi, (POSES, self.njoint))
        columns = self.bodies(poses, np.zeros_like(poses), np.zeros_like(poses))
        weight = np.einsum("njp,nj->p", columns, columns @ self.nominal)
        whole = weight @ self.nominal or 1.0  # 0 where gravity does nothing
        return np.asarray(weight / whole, dtype=np.float64)

    @cached_property
    def friction(self) -> tuple[str, ...]:
        """The terms of friction that any joint has, in the order of COLUMNS."""
        return tuple(term for term in COLUMNS if self.having(term))

    @property
    def terms(self) -> tuple[str, ...]:
        """The terms of friction, how dry friction follows the motion among them, in the order of TERMS."""
        states = {"hysteresis": self.sliding.builds_up, "bent": self.sliding.bent.any()}
        return (*self.friction, *(term for term, is_there in states.items() if is_there))

    def regressor(self, coordinates: Array, speeds: Array, accelerations: Array) -> Array:
        """The torque (... x njoint x nparam) for a unit of each unknown, of joint coordinates, speeds and accelerations
        (... x njoint each), where dry friction follows the sign of the speeds and no load adds to it.
        """
        bodies = self.bodies(coordinates, speeds, accelerations)
        nothing = np.zeros(speeds.shape)
        friction = self.friction_columns(coordinates, speeds, accelerations, self.sliding.at(speeds), nothing)
        return np.concatenate([bodies, friction], axis=-1)

    def friction_columns(
        self, coordinates: Array, speeds: Array, accelerations: Array, sliding: Array, rigid: Array
    ) -> Array:
        """The torque (... x njoint x nfriction) for a unit of each unknown of friction, and of coupled rotors.

        Args:
            coordinates: of the joints (... x njoint), in rad or m.
            speeds: of the joints (... x njoint), in rad/s or m/s.
            accelerations: of the joints (... x njoint), in rad/s² or m/s².
            sliding: the state of dry friction of each motor (... x nmotor).
            rigid: the torque of the bodies (... x njoint), in N m or N.
        """
        motion = coordinates, speeds, accelerations, rigid
        turned, turning, faster, loads = map(self.sliding.of_motors, motion)
        columns = np.zeros((*speeds.shape, len(self.columns)))
        torques = {term: friction_torque(term, turned, turning, sliding, loads) for term in self.friction}
        torques["rotor"] = faster
        for (term, motor), unknown in self.columns.items():
            for joint in self.sliding.motors[motor]:
                columns[..., joint, unknown - self.nbody] = torques[term][..., motor]
        return columns

    def friction_at(self, values: Array) -> JointFriction:
        """The friction of robots with these unknowns (... x nparam)."""
        terms = {term: np.zeros((*values.shape[:-1], self.sliding.nmotor)) for term in (*self.friction, "rotor")}
        for (term, motor), unknown in self.columns.items():
            terms[term][..., motor] = values[..., unknown]
        rotor = terms.pop("rotor")
        return JointFriction(self.sliding, terms, rotor[..., self.njoint :])

    def with_still(self, still: Array) -> LinearModel:
        """The same with other speeds (njoint) below which dry friction is a share of its whole."""
        return replace(self, sliding=replace(self.sliding, still=still))

    @property
    def endless(self) -> NDArray[np.bool_]:
        """Which joints (njoint) have no range: those of a chain, and of an arm where its file says none."""
        return np.asarray(~np.isfinite(self.tree.high - self.tree.low))

    @property
    def least_reach(self) -> Array:
        """How far each joint (njoint) goes from end to end at least, in rad or m, where it slides."""
        return np.where(self.slides, LEAST_SLIDE, LEAST_TURN)

    def held(self, reach: Array) -> NDArray[np.bool_]:
        """Which joints (njoint) are held, that go so far from end to end (njoint), in rad or m."""
        farthest = min(np.where(self.slides, 0.0, reach).max(), TURN)
        return np.asarray(reach < np.maximum(self.least_reach, np.where(self.slides, 0.0, HELD * farthest)))

    def whole(self, torques: Array, bodies: Array, columns: Callable[[], Array]) -> Array:
        """The squares that errors of torques are shares of (... x njoint): those of the torques, and in a joint without
        a motor of the terms that cancel, summed.

        Args:
            torques: that acted (... x njoint), in N m or N.
            bodies: the unknowns of the bodies (nbody).
            columns: makes the torque for a unit of each (... x njoint x nbody or more), where a joint has no motor.
        """
        squares = torques**2
        if self.passive.any():
            squares = np.where(self.passive, ((columns()[..., : self.nbody] * bodies) ** 2).sum(axis=-1), squares)
        return self.trusted_alone(squares)

    def determined(self, values: Array, deviations: Array, scale: float = 1.0) -> NDArray[np.bool_]:
        """Which unknowns (nparam) are known to a tenth: of what they are, or of an arm what they may have been wrong by
        beforehand.

        Args:
            values: of the unknowns (nparam).
            deviations: of these, standard deviations (nparam).
            scale: of the nominal bodies.
        """
        whole = np.abs(values)
        if not self.is_chain:
            beforehand = scale * np.sqrt(np.diag(self.covariance))
            whole[: self.nbody] = np.maximum(whole[: self.nbody], beforehand)
        return np.asarray(deviations <= COARSEST * whole, dtype=np.bool_)

    def trusted_alone(self, torques: Array) -> Array:
        """Torques, or squares of them (... x njoint), 0 where they are not trusted."""
        return np.where(self.untrusted, 0.0, torques)

    def with_friction(self, terms: tuple[str, ...]) -> LinearModel:
        """The same with these terms of friction in every joint, and dry friction that is there at once."""
        every = frozenset(product({*terms} & {*COLUMNS}, range(self.njoint)))
        at_once = Sliding.at_once(self.sliding.still, self.sliding.coupled)
        return replace(self, sliding=at_once).with_rubbing(every)

    def with_springs(self, joints: NDArray[np.bool_]) -> LinearModel:
        """The same with springs in some `joints` (njoint), too, that are slack somewhere."""
        return self.with_term("spring", joints).with_term("offset", joints) if joints.any() else self

    @cached_property
    def plain(self) -> LinearModel:
        """The same with what a simulator has alone: viscous and Coulomb friction in every joint, and its springs."""
        return self.with_friction(BASE).with_springs(~self.lacking("spring"))

    def with_term(self, term: str, joints: NDArray[np.bool_]) -> LinearModel:
        """The same with a term of friction in some `joints` (njoint), too."""
        return self.with_rubbing(self.rubbing | {(term, joint) for joint in np.flatnonzero(joints).tolist()})

    def with_sliding(self, how: How, size: Array | float, joints: NDArray[np.bool_] | bool = True) -> LinearModel:
        """The same with dry friction that builds up over displacements, in rad or m, or bends at speeds, in rad/s or
        m/s, of such a `size` in some `joints` (njoint each).
        """
        every = np.where(joints, size, getattr(self.sliding, how))
        return replace(self, sliding=replace(self.sliding, **{how: every}))  # type: ignore[arg-type]

    def with_coupled(self, coupled: tuple[tuple[int, int], ...]) -> LinearModel:
        """The same with these pairs of joints, from 0 on, whose motors are coupled."""
        return replace(self, sliding=replace(self.sliding, coupled=coupled)).with_rubbing(self.rubbing)

    def with_rubbing(self, rubbing: frozenset[tuple[str, int]]) -> LinearModel:
        """The same with these terms of friction of joints, from 0 on, and those that coupled joints share."""
        nbody, between = self.nbody, "_" if self.is_chain else ""
        other = replace(self, rubbing=rubbing)
        names, units = list(self.names[:nbody]), list(self.units[:nbody])
        for term, motor in other.columns:
            joints = "_".join(str(joint + 1) for joint in self.sliding.motors[motor])
            names.append(f"{'damping' if term == 'viscous' else term}{between}{joints}")
            units.append(_UNITS[term][motor < self.njoint and bool(self.slides[motor])])
        expressions = (*self.expressions[:nbody], *[""] * len(other.columns))
        return replace(other, names=tuple(names), units=tuple(units), expressions=expressions)

    def lacking(self, term: str) -> NDArray[np.bool_]:
        """Which joints (njoint) have no such `term` of friction."""
        return ~np.isin(np.arange(self.njoint), self.having(term))

    def having(self, term: str) -> list[int]:
        """The joints, from 0 on, that have a `term` of friction."""
        return [joint for joint in range(self.njoint) if (term, joint) in self.rubbing]

    @cached_property
    def columns(self) -> dict[tuple[str, int], int]:
        """Which of the unknowns is that of each term of friction, or of the rotor of a coupled pair, of each motor,
        from 0 on, that has it: those of joints by term, then those of each pair.
        """
        shared = [*(term for term in self.friction if term in SHARED), "rotor"]
        own = [(term, joint) for term in self.friction for joint in self.having(term)]
        own += [(term, motor) for motor in range(self.njoint, self.sliding.nmotor) for term in shared]
        return {each: self.nbody + number for number, each in enumerate(own)}
