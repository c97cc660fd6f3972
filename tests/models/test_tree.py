"""An arm's inertial parameters."""

from __future__ import annotations

import numpy as np
from random_arm import random_arm


def test_parameters_of_an_arm_give_the_arm_back() -> None:
    """Masses, first moments and moments of inertia about the joint hold all that a body is."""
    tree = random_arm(4, 0)
    again = tree.with_parameters(tree.parameters)
    for name in ("mass", "com", "inertia", "rotor", "damping", "coulomb"):
        assert np.allclose(getattr(again, name), getattr(tree, name), rtol=0, atol=1e-14)
    assert np.allclose(again.parameters, tree.parameters, rtol=0, atol=1e-14)
