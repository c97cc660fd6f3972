"""What a model has not, and that the readings show beside an estimate, hint at, or may hide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from metaid.models import Array

UNSEEN = 3.0  # standard deviations of a force that readings may hide
GEOMETRY = "geometry"
# What each is, its unit, and what to do about it.
FORCES = {
    "spring": (
        "a spring",
        "N m/rad",
        'no law of metaid has one: take it off, or search it: estimate.faults = ["spring"]',
    ),
    "damping": ("viscous friction", "N m s", 'search it: estimate.faults = ["viscous"]'),
    "coulomb": ("dry friction", "N m", 'search it: estimate.faults = ["dry"]'),
    "stiction": (
        "stiction",
        "N m",
        "no law of metaid has dry friction that is larger at rest: push so fast that joints seldom are",
    ),
    "delay": ("torques that come late", "s", 'search it: estimate.faults = ["delay"]'),
    GEOMETRY: (
        "wrong geometry",
        "times 5 mm and 10 mrad",
        "measure where joints are; a chain may leave its lengths to the study: estimate.lengths",
    ),
}


@dataclass(frozen=True)
class Unmodelled:
    """A force that the model has not, or wrong geometry.

    Attributes:
        kind: of FORCES.
        sizes: of each joint (njoint), or of all (1), in the unit of its kind.
        deviations: standard deviations of these.
        left: what share of the sum of the squared residuals it leaves.
        shift: by how much log factors (nunknown) would change.
        left_open: by how much they would with each of independent sizes (nunknown x nsize) that are as large as a
            standard deviation of what the readings leave open.
        is_seen: whether it is there: it lowers the squares by more than noise would, and moves a lump out of its 95 %
            interval, and that by more than TRIFLE.
        is_hinted: whether it may be there: the same where noise would seldom lower the squares so far.
    """

    kind: str
    sizes: Array
    deviations: Array
    left: float
    shift: Array
    left_open: Array
    is_seen: bool
    is_hinted: bool

    @property
    def description(self) -> str:
        """What it is, and where it is largest: `a spring in joint 1, 0.5 N m/rad`."""
        name, unit, _ = FORCES[self.kind]
        largest = int(np.argmax(np.abs(self.sizes)))
        where = f" in joint {largest + 1}" if len(self.sizes) > 1 else ""
        return f"{name}{where}, {self.sizes[largest]:.2g} {unit}"

    @property
    def reach(self) -> Array:
        """By how much unknowns could change (nunknown x nsize), each of them independent, with so little of it that the
        readings do not show it.
        """
        return UNSEEN * self.left_open

    @property
    def is_force(self) -> bool:
        """Whether it is a force, and not geometry."""
        return self.kind != GEOMETRY

    @property
    def name(self) -> str:
        """What it is."""
        return FORCES[self.kind][0]

    @property
    def unseen(self) -> str:
        """How much of it readings may hide: `up to 0.5 N m/rad of it`."""
        return f"up to {UNSEEN * float(self.deviations.max()):.2g} {FORCES[self.kind][1]} of it"

    @property
    def advice(self) -> str:
        """What to do about it."""
        return FORCES[self.kind][2]
