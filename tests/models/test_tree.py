"""An arm's inertial parameters."""

from __future__ import annotations

import numpy as np
from random_arm import random_arm

from metaid.models.tree import last_link_turned, rigid_torque


def test_parameters_of_an_arm_give_the_arm_back() -> None:
    """Masses, first moments and moments of inertia about the joint hold all that a body is."""
    tree = random_arm(4, 0)
    again = tree.with_parameters(tree.parameters)
    for name in ("mass", "com", "inertia", "rotor", "damping", "coulomb"):
        assert np.allclose(getattr(again, name), getattr(tree, name), rtol=0, atol=1e-14)
    assert np.allclose(again.parameters, tree.parameters, rtol=0, atol=1e-14)


def test_last_link_that_is_turned_moves_as_one_whose_angle_is_read_too_large() -> None:
    """To first order in the angle: the same torque for any motion."""
    tree, step = random_arm(4, 1, friction=False), 1e-6
    angles, speeds, accelerations = np.random.default_rng(0).normal(size=(3, 20, 4))
    less = angles - step * np.eye(4)[-1]
    turned = tree.parameters + step * last_link_turned(tree, tree.parameters)
    needed = rigid_torque(tree, tree.parameters, angles, speeds, accelerations)
    assert np.allclose(rigid_torque(tree, turned, less, speeds, accelerations), needed, rtol=0, atol=1e-9)
    assert not np.allclose(rigid_torque(tree, tree.parameters, less, speeds, accelerations), needed, rtol=0, atol=1e-7)


def test_torque_of_very_many_states_is_that_of_each() -> None:
    """They are taken some thousand at a time; speeds and accelerations are broadcast to coordinates."""
    tree = random_arm(3, 2)
    speeds, accelerations = np.random.default_rng(0).normal(size=(2, 6_001, 3))
    angles = np.random.default_rng(1).normal(size=(4, 6_001, 3))
    together = rigid_torque(tree, tree.parameters, angles, speeds, accelerations)
    each = [rigid_torque(tree, tree.parameters, own, speeds, accelerations) for own in angles]
    np.testing.assert_allclose(together, each, rtol=0, atol=1e-12)
