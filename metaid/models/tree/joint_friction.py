"""The friction of joints, and of motors that turn with the sum of two joints.

Dry friction is a share s of its whole, −1 to 1: the sign of the speed, cut short below a slow speed, or, where there is
pre-sliding, the state of Dahl's model, which follows the motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models.lumps import Array


@dataclass(frozen=True)
class JointFriction:
    """Of hinges in the units below; of slides in N and m in place of N m and rad.

    Attributes:
        viscous: friction by the speed (njoint), in N m s.
        coulomb: dry friction (njoint), in N m.
        root: dry friction by the root of the speed (njoint), in N m √s.
        offset: torque that is always there (njoint), in N m.
        load: dry friction as a share of the size of the joint's rigid torque (njoint), without unit.
        presliding: displacement over which dry friction builds up (njoint), in rad; 0 where it follows the speed alone.
        still: speed below which dry friction is a share of its whole where there is no pre-sliding (njoint), in rad/s,
            above 0.
        coupled: pairs of joints, from 0 on, each with a motor that turns with the sum of both.
        coupled_rotor: inertia of these motors (ncouple), in kg m².
        coupled_viscous: their friction by the speed (ncouple), in N m s.
        coupled_coulomb: their dry friction (ncouple), in N m.
        coupled_root: their dry friction by the root of the speed (ncouple), in N m √s.
    """

    viscous: Array
    coulomb: Array
    root: Array
    offset: Array
    load: Array
    presliding: Array
    still: Array
    coupled: tuple[tuple[int, int], ...]
    coupled_rotor: Array
    coupled_viscous: Array
    coupled_coulomb: Array
    coupled_root: Array

    @classmethod
    def simple(cls, viscous: Array, coulomb: Array, still: Array) -> JointFriction:
        """Viscous and dry friction (njoint each) alone, no motor coupled."""
        none, of_none = np.zeros(len(viscous)), np.zeros(0)
        return cls(viscous, coulomb, none, none, none, none, still, (), of_none, of_none, of_none, of_none)

    @property
    def njoint(self) -> int:
        return len(self.viscous)

    @property
    def sums(self) -> Array:
        """What each coupled motor turns with: 1 for its two joints, else 0 (ncouple x njoint)."""
        sums = np.zeros((len(self.coupled), self.njoint))
        for couple, joints in enumerate(self.coupled):
            sums[couple, list(joints)] = 1.0
        return sums

    @property
    def coupled_presliding(self) -> Array:
        """That of the coupled motors (ncouple), in rad: the mean of their joints'."""
        return np.asarray(0.5 * self.sums @ self.presliding, dtype=np.float64)

    @property
    def coupled_still(self) -> Array:
        """That of the coupled motors (ncouple), in rad/s: the mean of their joints'."""
        return np.asarray(0.5 * self.sums @ self.still, dtype=np.float64)

    def slip_at(self, v: Array) -> Array:
        """The share of its dry friction (... x njoint) that each joint has by its speed (... x njoint) alone."""
        return np.clip(v / self.still, -1.0, 1.0)

    def coupled_slip_at(self, v: Array) -> Array:
        """The same of the coupled motors (... x ncouple), of the joints' speeds (... x njoint)."""
        return np.clip(v @ self.sums.T / self.coupled_still, -1.0, 1.0)

    def slip_along(self, q: Array, v: Array) -> Array:
        """The share of its dry friction (... x nrow x njoint) that each joint has along a motion: coordinates and
        speeds (... x nrow x njoint), rows in the order of time. Pre-sliding begins at 0.
        """
        return dry_states(q, self.slip_at(v), self.presliding)

    def coupled_slip_along(self, q: Array, v: Array) -> Array:
        """The same of the coupled motors (... x nrow x ncouple)."""
        return dry_states(q @ self.sums.T, self.coupled_slip_at(v), self.coupled_presliding)

    def torque(self, v: Array, a: Array, rigid: Array, slip: Array, slip_coupled: Array) -> Array:
        """What friction and the rotors of coupled motors need (... x njoint), in N m.

        Args:
            v: speeds of the joints (... x njoint), in rad/s.
            a: accelerations of the joints (... x njoint), in rad/s².
            rigid: what bodies and the joints' own rotors need at that state (... x njoint), in N m.
            slip: the share of its dry friction that each joint has (... x njoint).
            slip_coupled: the same of each coupled motor (... x ncouple).
        """
        dry = self.coulomb + self.root * np.sqrt(np.abs(v)) + self.load * np.abs(rigid)
        own = self.viscous * v + self.offset + slip * dry
        together = v @ self.sums.T
        dry_together = self.coupled_coulomb + self.coupled_root * np.sqrt(np.abs(together))
        of_motors = self.coupled_rotor * (a @ self.sums.T) + self.coupled_viscous * together
        return np.asarray(own + (of_motors + slip_coupled * dry_together) @ self.sums, dtype=np.float64)

    @property
    def mass_matrix(self) -> Array:
        """What the rotors of coupled motors add to the mass matrix (njoint x njoint), in kg m²."""
        return np.asarray(self.sums.T @ (self.coupled_rotor[:, None] * self.sums), dtype=np.float64)


def dahl(state: Array, moved: Array, presliding: Array) -> Array:
    """The share of dry friction (... x n) after a displacement δ (... x n) in direction g, in rad or m, of a state
    (... x n) before it and the displacement over which friction builds up (n), above 0:
    s ← g + (s − g) exp(−|δ| / presliding).  Eq. 71.
    """
    goal = np.sign(moved)
    return np.asarray(goal + (state - goal) * np.exp(-np.abs(moved) / presliding), dtype=np.float64)


def dry_states(position: Array, at_speed: Array, presliding: Array) -> Array:
    """The share of dry friction along a motion (... x nrow x n), rows in the order of time: Dahl's state, which begins
    at 0, where there is pre-sliding, else what the speed makes of it.

    Args:
        position: coordinates (... x nrow x n), in rad or m.
        at_speed: the share by the speed alone (... x nrow x n).
        presliding: displacement over which friction builds up (n), in rad or m; 0 where the speed alone counts.
    """
    builds_up = presliding > 0.0
    states = np.array(at_speed, dtype=np.float64)
    if not builds_up.any() or not states.shape[-2]:
        return states
    moved, over = np.diff(position[..., builds_up], axis=-2), presliding[builds_up]
    state = np.zeros((*states.shape[:-2], len(over)))
    states[..., 0, builds_up] = state
    for row in range(moved.shape[-2]):
        state = dahl(state, moved[..., row, :], over)
        states[..., row + 1, builds_up] = state
    return states
