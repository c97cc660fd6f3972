"""The filter of the yardstick: Butterworth's, forwards and backwards."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from metaid.recorded.weak_form.smoothed import ORDER, low_pass


@pytest.mark.parametrize(("rows", "cutoff", "period"), [(5000, 3.0, 0.004), (2500, 20.0, 0.0005), (16, 40.0, 0.01)])
def test_filter_is_that_of_scipy(rows: int, cutoff: float, period: float) -> None:
    """To rounding, with the same start at both ends, from drifting rows."""
    drifting = np.cumsum(np.random.default_rng(0).standard_normal((rows, 3)), axis=0)
    theirs = signal.sosfiltfilt(signal.butter(ORDER, 2.0 * cutoff * period, output="sos"), drifting, axis=0)
    np.testing.assert_allclose(low_pass(drifting, cutoff, period), theirs, atol=1e-9 * np.abs(theirs).max())


def test_level_rows_pass_as_they_are() -> None:
    """Also fewer of them than are reflected at an end."""
    np.testing.assert_allclose(low_pass(np.full((5, 2), 3.0), 5.0, 0.01), 3.0, rtol=1e-12)
