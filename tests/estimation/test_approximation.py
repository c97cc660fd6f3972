"""When an estimate that does not explain what was seen is approximate."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from metaid.estimation import Approximation, HeldOutPushes
from metaid.models import Array


def approximation(fits: Array, torques: Array | None) -> Approximation:
    """Of two numbers, by `fits` (3 x 2) to parts of the pushes that predict the others ten times as well as the nominal
    model does.
    """
    held_out = HeldOutPushes(misfit=2.0, nominal=20.0, unknowns=fits)
    own, none, coarsest = np.full(2, 1e-3), np.zeros(2), np.full(2, 0.1)
    return Approximation(held_out, 2.0, [np.ones((3, 1))], ("joint",), own, none, coarsest, torques, is_possible=True)


APART = np.array([[0.0, 1.0], [1.0, 0.0], [0.5, 0.5]])  # two numbers whose sum alone is known


@pytest.mark.parametrize(("scatter", "holds"), [(1e-3, True), (0.3, False)])
def test_arm_is_approximate_where_parts_agree_on_its_torques_whatever_else_is_open(scatter: float, holds: bool) -> None:
    """Base parameters that move next to nothing may be anything; torques that parts do not agree on are not known."""
    by_part = np.array([1.0 - scatter, 1.0 + scatter, 1.0])
    torques = by_part[:, None, None] * np.random.default_rng(0).standard_normal((5, 1))
    found = approximation(APART, torques)
    assert found.holds is holds
    assert holds or found.why_not.endswith("on 0 of 1 joint torques")


def test_chain_is_approximate_where_parts_agree_on_its_numbers() -> None:
    """On one of two at least."""
    assert approximation(np.array([[0.0, 1.0], [0.001, 0.0], [0.0, 0.5]]), None).holds
    assert approximation(APART, None).why_not.endswith("on 0 of 2 numbers")


def test_what_the_nominal_model_cannot_follow_is_none_in_json_and_said_in_words() -> None:
    """Neither its misfit nor how much less likely it is has a number."""
    held_out = HeldOutPushes(2.0, np.inf, APART, np.array([3.0, np.inf, 4.0]))
    found = replace(approximation(APART, None), held_out=held_out)
    shown = json.loads(json.dumps(found.summary(), allow_nan=False))["held_out"]
    assert shown == {"misfit": 2.0, "nominal_misfit": None, "parts": 3, "log_likelihood_ratio": None}
    assert "the nominal model follows none" in found.predicted
    assert found.predicted.endswith("infinitely many times as likely by those fits")


def test_fit_that_cannot_follow_is_no_better_for_a_nominal_model_that_cannot_either() -> None:
    """Nothing is said of how likely it is."""
    held_out = HeldOutPushes(np.inf, np.inf, APART, np.array([np.inf, -np.inf, 4.0]))
    assert not replace(held_out, misfit=2.0, nominal=2.0).is_better
    assert "likely" not in replace(approximation(APART, None), held_out=held_out).predicted
