"""What all trials together say: where the twin differs from the plant, what goes together, and what each trial adds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import MaxNLocator

from metaid.models import DEVIATIONS, Array
from metaid.show.figures.lumps import LEAST, draw_correlation
from metaid.show.figures.style import COLOURS, FALL, INK, SURVIVOR, VALUES, every, new_axes, size_of, verbatim

if TYPE_CHECKING:
    from metaid.estimation import Replay
    from metaid.study.estimates import StudyEstimate

NUMBERS = 4.0  # of pushes or joints beside one another, an inch of the figure
LEAST_DIFFERENCE = 1e-3  # mrad: of less only rounding would be seen
CROWDED = 20  # marks of a line; more of them are small


def plot_motion(shown: Replay, push: int, axes: Axes | None = None) -> Axes:
    """Joint angles, in degrees, over the time since a `push`, from 0 on, in s: dots are the plant's, lines the twin's.
    A trial that can be `shown` is `found.estimate.replay()` of findings.
    """
    axes = new_axes(axes)
    for joint, (seen, simulated) in enumerate(zip(shown.seen[push].T, shown.simulated[push].T, strict=True)):
        colour = COLOURS[joint % len(COLOURS)]
        axes.plot(shown.times, np.degrees(seen), ".", color=colour, markersize=_mark(seen))
        axes.plot(shown.times, np.degrees(simulated), color=colour, label=verbatim(shown.joints[joint]))
    axes.plot([], [], ".", color=INK, label="plant")
    axes.plot([], [], "-", color=INK, label="twin")
    axes.set_ylabel("angle, °")
    return _over_time(shown, axes)


def plot_difference(shown: Replay, push: int, axes: Axes | None = None) -> Axes:
    """The twin's joint angles less the plant's, in mrad, over the time since a `push`, from 0 on, in s, of a trial as
    `plot_motion` has it; between the dotted lines lie 95 % of what noise makes of them, where there is some.
    """
    axes = new_axes(axes)
    for joint, difference in enumerate((shown.simulated[push] - shown.seen[push]).T):
        colour = COLOURS[joint % len(COLOURS)]
        axes.plot(shown.times, 1e3 * difference, ".", color=colour, markersize=_mark(difference))
    for side in (-DEVIATIONS, DEVIATIONS):
        if (reach := side * 1e3 * shown.noise.max()) != 0.0:
            axes.axhline(reach, color=INK, linewidth=0.7, linestyle=":")
    reach = max(map(abs, axes.get_ylim()))
    if reach < LEAST_DIFFERENCE:
        axes.set_ylim(-LEAST_DIFFERENCE, LEAST_DIFFERENCE)
    axes.set_ylabel("twin − plant,\nmrad")
    return _over_time(shown, axes)


def _mark(values: Array) -> float:
    """The size of a mark where so many of the `values` are drawn."""
    return 2.0 if np.count_nonzero(~np.isnan(values)) > CROWDED else 4.0


def _over_time(shown: Replay, axes: Axes) -> Axes:
    axes.set(xlim=(0.0, 1.02 * shown.times[-1]), xlabel="time, s")
    axes.grid(True)
    return axes


def plot_residuals(found: StudyEstimate, axes: Axes | None = None) -> Axes:
    """Root mean square of the residuals over all trials by push and joint, scaled by what noise or rounding
    explains.
    """
    axes = new_axes(axes)
    tables = np.stack(found.estimate.residuals)
    counts = np.maximum((~np.isnan(tables)).sum(axis=0), 1)
    shown: Array = np.maximum(np.sqrt(np.nansum(tables**2, axis=0) / counts), LEAST).T
    image = axes.imshow(shown, norm=LogNorm(), cmap=VALUES, aspect="auto")
    limit = found.estimate.explained_below
    axes.figure.colorbar(image, ax=axes, label=f"rms residual (explained: below {limit:.3g})")
    width, height = size_of(axes)
    for along, count, room in ((axes.xaxis, shown.shape[1], width), (axes.yaxis, shown.shape[0], height)):
        named = every(count, NUMBERS * room)
        along.set_ticks(named, [str(i + 1) for i in named])
    axes.tick_params(length=0)
    axes.set(xlabel="push", ylabel="joint")
    return axes


def plot_covariance(found: StudyEstimate, axes: Axes | None = None) -> Axes:
    """Correlation of the unknowns by the covariance of the estimate."""
    covariance = found.covariance
    deviations = np.sqrt(np.diag(covariance))
    matrix = covariance / np.outer(deviations, deviations)
    return draw_correlation(matrix, list(found.estimate.names), "correlation by the estimate", new_axes(axes))


def plot_growth(found: StudyEstimate, true: Array | None, axes: Axes | None = None) -> Axes:
    """The deviation of the worst known lump and, where the `true` lumps (nlump) or base parameters are known, the
    largest error of any, over the number of trials.
    """
    axes = new_axes(axes)
    counts, estimates = found.growth
    deviations, errors = zip(*(each.shares(true) for each in estimates), strict=True)
    largest = [100.0 * each.max() for each in deviations]
    axes.plot(counts, largest, "o-", color=SURVIVOR, markersize=3, label="standard deviation")
    if true is not None:
        largest = [100.0 * max(each.max(), LEAST) for each in errors]
        axes.plot(counts, largest, "x--", color=FALL, markersize=4, label="error")
    axes.set_yscale("log")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set(xlabel="trials", ylabel=f"largest of {found.estimate.share_of}, %")
    axes.grid(True)
    axes.legend(loc="best")
    return axes
