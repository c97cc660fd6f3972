"""What all trials together say: where the twin differs from the plant, what goes together, and what each trial adds."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import MaxNLocator

from metaid.models import Array
from metaid.results import StudyEstimate, growth
from metaid.show.figures.lumps import draw_correlation
from metaid.show.figures.style import FALL, SURVIVOR, VALUES, new_axes

LEAST = 1e-16  # of what is drawn on a logarithmic scale, in place of 0


def plot_residuals(found: StudyEstimate, axes: Axes | None = None) -> Axes:
    """Root mean square of the residuals over all trials by push and joint, in units of what noise or rounding
    explains.
    """
    axes = new_axes(axes)
    tables = np.stack(found.estimate.residuals)
    counts = np.maximum((~np.isnan(tables)).sum(axis=0), 1)
    shown: Array = np.maximum(np.sqrt(np.nansum(tables**2, axis=0) / counts), LEAST).T
    image = axes.imshow(shown, norm=LogNorm(), cmap=VALUES, aspect="auto")
    limit = found.experiment.explained_below
    axes.figure.colorbar(image, ax=axes, label=f"rms residual (explained: below {limit:g})")
    for along, count in ((axes.xaxis, shown.shape[1]), (axes.yaxis, shown.shape[0])):
        along.set_ticks(range(count), [str(i + 1) for i in range(count)])
    axes.tick_params(length=0)
    axes.set_xlabel("push")
    axes.set_ylabel("joint")
    return axes


def plot_covariance(found: StudyEstimate, axes: Axes | None = None) -> Axes:
    """Correlation of the lumps by the covariance of the estimate."""
    deviations = found.estimate.deviations
    matrix = found.estimate.covariance / np.outer(deviations, deviations)
    return draw_correlation(matrix, list(found.estimate.names), "correlation by the estimate", new_axes(axes))


def plot_growth(found: StudyEstimate, true: Array | None, axes: Axes | None = None) -> Axes:
    """The deviation of the worst known lump, and the largest error of any, over the number of trials.

    Args:
        found: the estimate.
        true: the true lumps (nunknown), where they are known.
        axes: to draw on; default: a new one.
    """
    axes = new_axes(axes)
    counts, estimates = growth(found)
    deviations = [100.0 * each.deviations.max() for each in estimates]
    axes.plot(counts, deviations, "o-", color=SURVIVOR, markersize=3, label="largest standard deviation")
    if true is not None:
        last = found.estimate.log_factors + np.log(true / found.lumps_of(found.estimate))
        errors = [100.0 * max(np.abs(np.expm1(each.log_factors - last)).max(), LEAST) for each in estimates]
        axes.plot(counts, errors, "x--", color=FALL, markersize=4, label="largest error")
    axes.set_yscale("log")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("trials")
    axes.set_ylabel("of a lump, %")
    axes.grid(True)
    axes.legend(loc="best")
    return axes
