"""Where a push begins, and how hard it is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from metaid.models import Array


@dataclass(frozen=True, eq=False)
class Start:
    """From where a push begins: the plant at rest at joint `angles` (njoint), in rad, whose link tips are struck with
    horizontal `impulses` (njoint), in N s.
    """

    impulses: Array
    angles: Array

    @classmethod
    def upright(cls, impulses: Array) -> Start:
        """From the upright, with these `impulses` (njoint), in N s."""
        return cls(impulses, np.zeros(len(impulses)))

    def struck(self, noise: Array) -> Start:
        """The same where chance adds this `noise` (njoint) to the impulses, as shares of them."""
        return replace(self, impulses=self.impulses * (1.0 + noise))

    @property
    def is_upright(self) -> bool:
        """Whether every joint begins at the upright."""
        return not self.angles.any()
