"""Logs that repeat one motion, as logs of excited arms often do."""

from __future__ import annotations

import numpy as np
import pytest
from random_arm import wrong_tree
from swinging import log_of, swinging_arm

from metaid.models import Array
from metaid.recorded import Choices, LogRun, arm_model, estimate_records, judge_records

pytestmark = pytest.mark.slow

PERIOD = 4.0  # s
PLAIN = Choices(span=0.1, delay=0.0, friction=("viscous", "coulomb"), zeros=False)


def unknown(speeds: Array) -> Array:
    """Friction of no known kind, in N m, by speeds in rad/s."""
    return 0.5 * np.sin(3.0 * speeds)


def log(seconds: float, seed: int = 3, period: float | None = PERIOD) -> LogRun:
    return log_of(swinging_arm(), 0.0, 1e-5, unknown, seconds, seed, period)


@pytest.mark.parametrize("seconds", [(3.0 * PERIOD,), (2.0 * PERIOD, PERIOD), (PERIOD,) * 3])
def test_motion_that_recurs_is_left_out_wherever_it_does(seconds: tuple[float, ...]) -> None:
    """Within a log, and in others of the same motion, each third of the period at once."""
    records = [log(each) for each in seconds]
    found = estimate_records(records, arm_model(wrong_tree(swinging_arm(), 1)), PLAIN)
    folds = found.chosen.yardstick.folds
    assert [fold.third for fold in folds] == [0, 1, 2]
    times = np.arange(0.3, PERIOD - 0.3, 0.01)
    parts = [
        np.array([fold.rows(number, begin + times) for fold in folds])
        for number, each in enumerate(seconds)
        for begin in np.arange(0.0, each, PERIOD)
    ]
    assert np.mean([part == parts[0] for part in parts]) > 0.98
    np.testing.assert_allclose([part.mean(axis=1) for part in parts], 1.0 / 3.0, atol=0.1)
    reasons = judge_records(found).reasons
    assert "that were left out wherever their motion recurs are predicted to" in reasons[0]


def test_error_that_is_said_of_a_motion_that_recurs_is_no_smaller_than_beside_another_motion() -> None:
    """A fit to one motion predicts its repetition whatever the model lacks, and no other motion."""
    model = arm_model(wrong_tree(swinging_arm(), 1))
    alone, beside = (estimate_records([log(3.0 * PERIOD), *more], model, PLAIN) for more in ((), (log(12.0, 5, None),)))
    assert alone.held_out.relative > beside.held_out.relative > 0.02


def test_motion_that_never_recurs_is_parted_in_time() -> None:
    """Thirds of each of two logs, and whole logs of three."""
    model = arm_model(wrong_tree(swinging_arm(), 1))
    for count, by, logs in ((2, "blocks", [(0,)] * 3 + [(1,)] * 3), (3, "logs", [(0,), (1,), (2,)])):
        records = [log(3.0, seed, None) for seed in range(3, 3 + count)]
        yardstick = estimate_records(records, model, PLAIN).chosen.yardstick
        assert (yardstick.by, [fold.logs for fold in yardstick.folds]) == (by, logs)
