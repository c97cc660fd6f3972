"""Terms of friction of geared joints: each is taken up where it predicts what was left out, and none besides."""

from __future__ import annotations

import numpy as np
import pytest
from swinging import BASE, DRY, arm_log, estimated, swinging_arm

from metaid.models import Array
from metaid.recorded import LogRun, arm_model
from metaid.recorded.weak_form.smoothed import smoothed

pytestmark = pytest.mark.slow


def test_friction_that_bends_drives_no_joint_that_is_faster_than_in_the_log() -> None:
    """Of friction that falls before the fastest speed, the curve handed over grows up to twice that speed."""
    free = arm_log(noise=0.0)
    fastest = np.abs(np.gradient(free.angles, free.times, axis=0)).max(axis=0)

    def friction(speeds: Array) -> Array:
        share = np.abs(speeds) / fastest
        return 3.0 * DRY * np.sign(speeds) * (np.sqrt(share) - 0.6 * share)

    found = estimated(arm_log(friction), friction=("viscous", "coulomb", "root"))
    viscous, root = (
        np.array([found.values[found.model.columns[term, joint]] for joint in range(3)]) for term in ("viscous", "root")
    )
    assert (viscous + 0.5 * root / np.sqrt(2.0 * found.equations.fastest) >= 0.0).all()


def built_up(record: LogRun) -> Array:
    """The state of dry friction (nrow x 3) that builds up over 20 mrad."""
    state, states = np.zeros(3), np.zeros_like(record.angles)
    for row, step in enumerate(np.diff(record.angles, axis=0)):
        state = np.sign(step) + (state - np.sign(step)) * np.exp(-np.abs(step) / 0.02)
        states[row + 1] = state
    return states


def test_hysteresis_is_taken_up_where_it_predicts_what_was_left_out() -> None:
    """Dry friction that builds up over 20 mrad is no sign of the speed, and none is taken up of an arm without it."""
    record = arm_log(noise=0.0)
    found = estimated(record.with_torques(record.torques + DRY * built_up(record)), friction=None)
    plain = estimated(arm_log(lambda speeds: DRY * np.sign(speeds), noise=0.0), friction=None)
    assert "hysteresis" in found.model.terms
    assert 0.005 < found.model.sliding.presliding[0] < 0.06
    assert plain.model.sliding.presliding[0] < 0.002


@pytest.mark.parametrize("bent", [0.05, 0.0005])
def test_speed_below_which_dry_friction_bends_is_taken_up_where_it_predicts_what_was_left_out(bent: float) -> None:
    """As drives with soft gears and other simulators have it, and none where it is next to none, or without noise next
    to none: a jump between two nodes of a window is as good as one that is so wide.
    """
    plain = arm_log(noise=0.0)
    usual = np.sqrt((np.gradient(plain.angles, plain.period, axis=0) ** 2).mean(axis=0))
    noise = 0.0 if bent > 0.01 else 1e-3  # rad
    record = arm_log(lambda each: DRY * np.tanh(each / (bent * usual)), noise=noise)
    found, sharp, asked = (estimated(record, friction=each) for each in (None, BASE, (*BASE, "bent")))
    taken_up = found.model.sliding.bent / usual
    assert ("bent" in found.model.terms, asked.model.terms) == (bent > 0.01, (*BASE, "bent"))
    if bent > 0.01:
        np.testing.assert_allclose(taken_up, bent, rtol=0.6)
        np.testing.assert_allclose(asked.model.sliding.bent / usual, bent, rtol=0.6)
        assert found.held_out.relative < 0.5 * sharp.held_out.relative
    else:
        assert not taken_up.any()
        exact = estimated(arm_log(lambda each: DRY * np.tanh(each / (bent * usual)), noise=0.0), friction=None)
        assert (exact.model.sliding.bent / usual < 0.021).all()


def test_friction_that_bends_is_followed_beside_friction_that_builds_up() -> None:
    """In one joint the speed at which it bends is another, and in the next a state builds up along the same log."""
    log, model = smoothed(arm_log(noise=0.0)), arm_model(swinging_arm())
    model = model.with_sliding("presliding", np.array([0.01, 0.0, 0.0]))
    sharp, bent = (log.states(model.with_sliding("bent", np.array([0.0, speed, 0.0]))) for speed in (0.01, 1.0))
    assert (np.abs(bent[:, 1]) <= np.abs(sharp[:, 1])).all()
    assert np.abs(bent - sharp).max(axis=0)[1] > 0.5
    np.testing.assert_array_equal(bent[:, [0, 2]], sharp[:, [0, 2]])


def test_what_stood_for_hysteresis_is_left_out_once_that_is_taken_up() -> None:
    """A root and a load, which explain some of it, and none of what was left out beside it."""
    record = arm_log(noise=0.0, seconds=3.0)
    found = estimated(record.with_torques(record.torques + DRY * built_up(record)), friction=None)
    assert found.model.terms == (*BASE, "hysteresis")
    assert {what.partition(" of ")[0] for what, _ in found.chosen.tried} >= {"without root", "without load"}


def test_hysteresis_is_taken_up_for_the_joint_that_carries_least() -> None:
    """Of the arm's torque it is next to nothing beside what no model explains, of the last joint's it is a quarter."""
    record = arm_log(noise=0.0, seconds=4.0)
    usual = np.sqrt((record.torques**2).mean(axis=0))
    unexplained = 0.1 * usual * np.sin(np.outer(record.times, (5.5, 7.7, 0.0)))
    dry = 0.24 * usual * (0.0, 0.0, 1.0) * built_up(record)
    found = estimated(record.with_torques(record.torques + unexplained + dry), friction=None)
    assert "hysteresis" in found.model.terms
    assert all(error > 0.97 for what, error in found.chosen.tried if what.startswith("hysteresis"))


def test_term_is_taken_up_in_the_one_joint_that_it_helps() -> None:
    """A constant torque of the last joint is no reason for one of the others, whose torques drift."""
    record = arm_log(lambda speeds: DRY * np.sign(speeds))
    usual = np.sqrt((record.torques**2).mean(axis=0))
    drift = 0.3 * usual * np.outer(record.times / record.times[-1] - 0.5, (1.0, 1.0, 0.0))
    found = estimated(record.with_torques(record.torques + drift + (0.0, 0.0, 0.4)), friction=None)
    named = dict(zip(found.model.names, found.values, strict=True))
    assert named["offset3"] == pytest.approx(0.4, abs=0.02)
    assert not {"offset1", "offset2"} & named.keys()
