"""The friction and springs of joints, and friction of motors that turn with the sum of two joints.

Friction of a motor is any of: viscous q̇, Coulomb s, root s √|q̇| (which bends between rest and fast motion as lubricated
gears do), an offset of the torque, and load s |τ_rigid|; a joint may have a spring q, too. The sliding state s is the
sign of the speed, cut short below a slow speed, or tanh(q̇/v), or, where there is pre-sliding, a state that builds up
over a displacement (Dahl).  Eqs. 66 and 67.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from metaid.models.lumps import Array

COLUMNS = ("viscous", "coulomb", "root", "offset", "load", "spring")  # terms that are linear in what is unknown of them
SHARED = ("viscous", "coulomb", "root")  # by two joints whose motors are coupled


def friction_torque(term: str, coordinates: Array, speeds: Array, sliding: Array, rigid: Array) -> Array:
    """The torque (...) for a unit of one term of friction, in N m or N.

    Args:
        term: one of COLUMNS.
        coordinates: of the joint (...), in rad or m.
        speeds: of the joint (...), in rad/s or m/s.
        sliding: its state of dry friction (...), from −1 to 1.
        rigid: the torque of its bodies (...), in N m or N.
    """
    if term == "viscous":
        return speeds
    if term == "spring":
        return coordinates
    if term == "offset":
        return np.ones_like(speeds)
    if term == "load":
        return np.asarray(sliding * np.abs(rigid), dtype=np.float64)
    return np.asarray(sliding * np.sqrt(np.abs(speeds)) if term == "root" else sliding, dtype=np.float64)


@dataclass(frozen=True)
class Sliding:
    """How the state of dry friction, −1 to 1, follows the motion of the motors: those of each joint, then those of each
    coupled pair (nmotor). Of several robots side by side a row each.

    Attributes:
        presliding: displacement over which dry friction builds up (njoint), in rad or m; 0 where it follows the speed.
        still: joint speed below which dry friction is a share of its whole (njoint), in rad/s or m/s, above 0.
        bent: joint speed v where that share is tanh(q̇ / v) (njoint), in rad/s or m/s; 0 where it is cut short.
        coupled: pairs of joints whose motors are coupled, from 0 on.
    """

    presliding: Array
    still: Array
    bent: Array
    coupled: tuple[tuple[int, int], ...] = ()

    @classmethod
    def at_once(cls, still: Array, coupled: tuple[tuple[int, int], ...] = ()) -> Sliding:
        """That of dry friction which is a share of its whole below these speeds (njoint), and whole beyond them."""
        none = np.zeros(len(still))
        return cls(none, still, none, coupled)

    @property
    def njoint(self) -> int:
        return int(self.still.shape[-1])

    @property
    def nmotor(self) -> int:
        return self.njoint + len(self.coupled)

    @cached_property
    def builds_up(self) -> bool:
        """Whether dry friction of any joint builds up over a displacement."""
        return bool(self.presliding.any())

    @property
    def motors(self) -> tuple[tuple[int, ...], ...]:
        """The joints, from 0 on, that each motor turns with (nmotor)."""
        return (*((joint,) for joint in range(self.njoint)), *self.coupled)

    def of_motors(self, each: Array) -> Array:
        """Sums over the joints (... x njoint) that each motor turns with (... x nmotor)."""
        if not self.coupled:
            return each
        return np.concatenate([each, *(each[..., [one]] + each[..., [other]] for one, other in self.coupled)], axis=-1)

    def of_joints(self, each: Array) -> Array:
        """Torques of the motors (... x nmotor) as the joints have them (... x njoint)."""
        torques = each[..., : self.njoint].copy()
        for motor, joints in enumerate(self.coupled, start=self.njoint):
            torques[..., joints] += each[..., [motor]]
        return torques

    def means(self, each: Array) -> Array:
        """Of each motor (nmotor), that of a pair the mean of its joints' (njoint)."""
        return np.asarray(self.of_motors(each) / [len(joints) for joints in self.motors], dtype=np.float64)

    @cached_property
    def _of_each(self) -> tuple[Array, Array, Array, bool]:
        """`presliding`, `still` and `bent` of the motors (nmotor each), and whether any is bent."""
        presliding, still, bent = map(self.means, (self.presliding, self.still, self.bent))
        return presliding, still, bent, bool(bent.any())

    def at(self, speeds: Array) -> Array:
        """The state (... x nmotor) that follows the speeds of the joints (... x njoint) at once."""
        moving, (_, still, bent, is_bent) = self.of_motors(speeds), self._of_each
        short = np.clip(moving / still, -1.0, 1.0)
        return np.where(bent > 0.0, np.tanh(moving / np.where(bent > 0.0, bent, 1.0)), short) if is_bent else short

    def steady(self, speeds: Array) -> Array:
        """The state (... x nmotor) once the joints have moved on at these speeds (... x njoint)."""
        return np.where(self._of_each[0] > 0.0, np.sign(self.of_motors(speeds)), self.at(speeds))

    def along(self, coordinates: Array, speeds: Array) -> Array:
        """The state (... x nrow x nmotor) along coordinates and speeds of the joints (... x nrow x njoint each), rows
        in the order of time. Where there is pre-sliding it begins at 0.
        """
        states, presliding = self.at(speeds), self._of_each[0]
        if not self.builds_up or not states.shape[-2]:
            return states
        builds_up = presliding > 0.0
        moved, over = np.diff(self.of_motors(coordinates)[..., builds_up], axis=-2), presliding[builds_up]
        state = np.zeros((*states.shape[:-2], len(over)))
        states[..., 0, builds_up] = state
        for row in range(moved.shape[-2]):
            state = _dahl(state, moved[..., row, :], over)
            states[..., row + 1, builds_up] = state
        return states

    def after(self, state: Array, speeds: Array, step: float) -> Array:
        """The state (... x nmotor) after a step, in s, with these speeds of the joints (... x njoint)."""
        if not self.builds_up:
            return self.at(speeds)
        presliding = self._of_each[0]
        after = _dahl(state, step * self.of_motors(speeds), np.where(presliding > 0.0, presliding, 1.0))
        return np.where(presliding > 0.0, after, self.at(speeds))


def _dahl(state: Array, moved: Array, presliding: Array) -> Array:
    """The share of dry friction (... x n) after a displacement δ (... x n) in direction g, in rad or m, of a state
    (... x n) before it and the displacement over which friction builds up (n), above 0:
    s ← g + (s − g) exp(−|δ| / presliding).  Eq. 67.
    """
    goal = np.sign(moved)
    return np.asarray(goal + (state - goal) * np.exp(-np.abs(moved) / presliding), dtype=np.float64)


@dataclass(frozen=True)
class JointFriction:
    """Friction that is known.

    Attributes:
        sliding: how dry friction follows the motion.
        terms: of each motor (... x nmotor each), by COLUMNS; what is not named is 0. Those of hinges are in N m s, N m,
            N m √s, N m and N m/rad, of slides in N and m in place of N m and rad; load is a share. Coupled motors have
            SHARED alone.
        coupled_rotor: inertia of the coupled motors (... x npair), in kg m².
    """

    sliding: Sliding
    terms: Mapping[str, Array]
    coupled_rotor: Array

    @classmethod
    def simple(cls, viscous: Array, coulomb: Array, still: Array) -> JointFriction:
        """Viscous and dry friction (njoint each) alone, no motor coupled."""
        return cls(Sliding.at_once(still), {"viscous": viscous, "coulomb": coulomb}, np.zeros(0))

    @classmethod
    def beside(cls, robots: Sequence[JointFriction], counts: Sequence[int]) -> JointFriction:
        """That of several robots with the same motors, of each so many times one after the other (nrow x nmotor)."""
        slidings = [each.sliding for each in robots]

        def rows(every: Sequence[Array]) -> Array:
            return np.repeat(every, counts, axis=0)

        how = {name: rows([getattr(each, name) for each in slidings]) for name in ("presliding", "still", "bent")}
        terms = {term: rows([each.of(term) for each in robots]) for each in robots for term in each.terms}
        sliding = Sliding(**how, coupled=slidings[0].coupled)
        return cls(sliding, terms, rows([each.coupled_rotor for each in robots]))

    def of(self, term: str) -> Array:
        """A term of each motor (nmotor)."""
        return self.terms.get(term, np.zeros(self.sliding.nmotor))

    def torque(self, q: Array, v: Array, a: Array, rigid: Array, slip: Array) -> Array:
        """What friction, springs and the rotors of coupled motors need (... x njoint), in N m.

        Args:
            q: coordinates of the joints (... x njoint), in rad.
            v: speeds of the joints (... x njoint), in rad/s.
            a: accelerations of the joints (... x njoint), in rad/s².
            rigid: what bodies and the joints' own rotors need at that state (... x njoint), in N m.
            slip: the share of its dry friction that each motor has (... x nmotor).
        """
        sliding = self.sliding
        turned, speeds, loads = (sliding.of_motors(each) for each in (q, v, rigid))
        torques = np.zeros(np.broadcast_shapes(speeds.shape, loads.shape))
        torques[..., sliding.njoint :] = self.coupled_rotor * sliding.of_motors(a)[..., sliding.njoint :]
        for term, values in self.terms.items():
            torques += values * friction_torque(term, turned, speeds, slip, loads)
        return sliding.of_joints(torques)

    @property
    def mass_matrix(self) -> Array:
        """What the rotors of coupled motors add to the mass matrix (... x njoint x njoint), in kg m²."""
        turning = self.sliding.of_motors(np.eye(self.sliding.njoint))[:, self.sliding.njoint :]
        return np.asarray((turning * self.coupled_rotor[..., None, :]) @ turning.T, dtype=np.float64)


@dataclass(frozen=True)
class Spring:
    """A spring in a joint, as an MJCF can hold it: −k (q − q₀), slack at q₀.

    Attributes:
        joint: from 0 on.
        stiffness: in N m/rad, of a slide in N/m.
        slack: the joint coordinate at which it is, in rad or m.
    """

    joint: int
    stiffness: float
    slack: float

    def text(self, is_slide: bool) -> str:
        """Its numbers in words."""
        turn, move = ("m", "N/m") if is_slide else ("rad", "N m/rad")
        return f"{self.stiffness:.6g} {move}, slack at {self.slack:.6g} {turn}"
