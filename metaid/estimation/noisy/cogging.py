"""How many times a turn cogging repeats, by what a filter leaves."""

from __future__ import annotations

import numpy as np

from metaid.estimation.noisy.innovations import Innovations
from metaid.estimation.noisy.unmodelled import least_squares
from metaid.estimation.trials import ReadTrial
from metaid.models import Array

FEWEST, MOST = 3, 40  # times a turn; of fewer gravity, a tilt and a spring have as much


def teeth_shown(led: Innovations, point: Array) -> int:
    """How many times a turn the torque repeats, in each joint with an amplitude and a phase of its own, that leaves
    least of the innovations beside unknowns that may change with it; 0 where the twin cannot follow.  Eq. 42.

    Args:
        led: of all trials, with gains.
        point: the unknowns, with what concerns a push alone behind them.
    """
    columns = [_columns(trial) for trial in led.trials]
    residuals = led.residuals_with(point, columns)
    if residuals is None:
        return 0
    count, each = len(led.spreads), 2 * led.unknowns.njoint
    prior = np.diag(np.append(1.0 / led.spreads, np.zeros(len(columns[0]))))[:count]
    slopes = np.vstack([residuals.slopes, prior])
    values = np.append(residuals.values, point[:count] / led.spreads)

    def left(teeth: int) -> float:
        first = count + (teeth - FEWEST) * each
        return least_squares(np.column_stack([slopes[:, :count], slopes[:, first : first + each]]), values)[0]

    return min(range(FEWEST, MOST + 1), key=left)


def _columns(trial: ReadTrial) -> Array:
    """Torques of 1 N m in each joint, as the cosine and as the sine of so many times its angle (ncolumn x npush x nstep
    x njoint).
    """
    middle = 0.5 * (trial.readings[:, 1:] + trial.readings[:, :-1])
    joints = np.eye(middle.shape[2])[:, None, None]
    waves = (wave(teeth * middle) for teeth in range(FEWEST, MOST + 1) for wave in (np.cos, np.sin))
    return np.concatenate([each * joints for each in waves])
