"""The figures of a study as `metaid study plot` and the report have them: one a question, each with a caption."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from metaid.episode import Trajectory
from metaid.errors import StorageError
from metaid.models import Array
from metaid.results import Findings, Plane, Sweep, plane, sweep
from metaid.show.figures.episodes import plot_angles, plot_phase
from metaid.show.figures.estimate import plot_covariance, plot_difference, plot_growth, plot_motion, plot_residuals
from metaid.show.figures.landscape import plot_boundary, plot_parallel, plot_sweep
from metaid.show.figures.lumps import plot_correlation, plot_ranges
from metaid.show.figures.panels import pair_of_panels, pairs_of_panels, panels, share_legend
from metaid.show.figures.search import plot_convergence, plot_error, plot_factor
from metaid.show.figures.style import COLUMN, PAGE, style
from metaid.study.estimates import StudyEstimate

if TYPE_CHECKING:
    from metaid.estimation import Replay

LEAST_HEIGHT = 2.3  # inches: 200 pixels of a phone
PANELS = 12  # lumps at most in a figure of one panel each
FEWEST = 2  # trials a lump, at least, for the correlation of their factors
PUSHES = 6  # pushes at most in a figure of two panels each
SWEPT, GRID = 61, 31  # factors along a line, and along each side of a plane
WIDTHS = {"page": PAGE, "column": COLUMN}  # inches


@dataclass(frozen=True)
class Picture:
    """A figure, the file name that it deserves, and what it shows in a sentence or two."""

    name: str
    caption: str
    figure: Figure


class Gallery:
    """All figures of a study; `over` are the two lumps of the fall boundary (default: gravity of the first two links).

    Raises StorageError where there is no survivor yet, or no such lump.
    """

    def __init__(self, found: Findings, over: tuple[str, str] | None = None) -> None:
        self.found = found
        self.centre = found.best_factors
        self.objective = found.objective()
        self.names = found.names[:PANELS]
        self.over = over or (found.names[0], found.names[min(1, len(found.names) - 1)])
        self._pair = found.index(self.over[0]), found.index(self.over[1])
        if over and over[0] == over[1]:
            raise StorageError(f"a boundary is over two different lumps, not {over[0]} twice")

    def pictures(self, width: str = "page") -> Iterator[Picture]:
        """One after another, for a `width` of "page" or "column". A rig is not moved for a picture: those that need
        more episodes are left out.
        """
        simulated = self.found.problem.is_simulated
        identified = self.found.lumps["identified"].notna().any()
        makers = [self._convergence, self._factors, *([self._ranges] if identified else [])]
        makers += [self._frequency] if simulated else []
        if len(self.found.names) > 1:
            makers += [self._boundary, self._parallel, *([self._correlation] if self._correlates else [])]
        if self.found.estimate is not None:
            makers += [self._motion, self._residuals]
            counted = self.found.estimate.estimate.counts is not None
            makers += [self._covariance, *([] if counted else [self._growth])] if self.found.estimate.explains else []
        for make in [*makers, *([self._episode] if simulated else [])]:
            with style():
                picture = make(WIDTHS[width])
            yield picture

    @property
    def _correlates(self) -> bool:
        """Whether there are trials enough for a correlation of their factors."""
        return len(self.found.closest) > FEWEST * len(self.found.names)

    @property
    def left_out(self) -> list[tuple[str, str]]:
        """What is not drawn, and why."""
        found, said = self.found, []
        if found.true_factors is None:
            said.append(("Errors", "the plant does not tell its true lumps"))
        if not found.lumps["identified"].notna().any():
            said.append(("Ranges of the lumps", f"no lump is identified: the verdict is '{found.verdict.word}'"))
        if not found.problem.is_simulated:
            said.append(("Frequency over the factors, motion of the best", "a rig is not moved for a picture"))
        if len(found.names) == 1:
            said.append(("Fall boundary, parallel lines, correlation", "there is one lump alone"))
        elif not self._correlates:
            said.append(("Correlation of the factors over the best trials", f"{len(found.closest)} trials are too few"))
        if not len(found.falls):
            said.append(("Falls", "no trial fell"))
        if found.estimate is None:
            said.append(("Motion beside the twin's", "no estimate has a twin"))
        elif not found.estimate.explains:
            said.append(("Correlation and growth of the estimate", "it does not explain what was seen"))
        return said

    @cached_property
    def sweeps(self) -> list[Sweep]:
        """The measure along each lump's factor, from its lower to its upper bound."""
        return [sweep(self.objective, self.centre, i, self._between_bounds(i, SWEPT)) for i in range(len(self.names))]

    @cached_property
    def boundary(self) -> Plane | None:
        """The measure over the two lumps, between their bounds; None of a rig."""
        if not self.found.problem.is_simulated:
            return None
        first, second = (self._between_bounds(i, GRID) for i in self._pair)
        return plane(self.objective, self.centre, self._pair, first, second)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The best candidate's motion after the last push."""
        return self.objective.watch(self.centre)[1]

    def _between_bounds(self, lump: int, count: int) -> Array:
        """Evenly spaced factors (count) of a lump, from its lower to its upper bound."""
        return np.linspace(self.found.problem.low[lump], self.found.problem.high[lump], count)

    def _convergence(self, width: float) -> Picture:
        caption = "The measure of every survivor, and the best so far"
        caption += "; falls are marked along the top." if len(self.found.falls) else "."
        if self.found.true_factors is None or np.isnan(self.found.errors(self.found.bests)).all():
            figure = Figure(figsize=(width, 2.6), layout="constrained")
            plot_convergence(self.found, figure.subplots())
            return Picture("convergence", caption, figure)
        figure, (left, right) = pair_of_panels(width, (1, 1))
        plot_convergence(self.found, left)
        plot_error(self.found, right)
        caption += (
            " The other panel has the largest error of a lump of the best candidate, which the search never sees."
        )
        return Picture("convergence", caption, figure)

    def _factors(self, width: float) -> Picture:
        figure, axes = panels(width, len(self.names))
        for lump, panel in zip(self.names, axes, strict=True):
            plot_factor(self.found, lump, panel)
        share_legend(figure, axes)
        return Picture("factors", f"Each lump's factor over the trials.{self._how_many}", figure)

    def _frequency(self, width: float) -> Picture:
        figure, axes = panels(width, len(self.names))
        for swept, panel in zip(self.sweeps, axes, strict=True):
            plot_sweep(self.found, swept, panel)
        share_legend(figure, axes)
        caption = f"The measure against one lump's factor, the other lumps at their best.{self._how_many}"
        return Picture("frequency", caption, figure)

    @property
    def _how_many(self) -> str:
        shown, all_of_them = len(self.names), len(self.found.names)
        return "" if shown == all_of_them else f" The first {shown} of {all_of_them} lumps."

    def _ranges(self, width: float) -> Picture:
        height = max(1.2 + 0.2 * len(self.found.known_lumps), LEAST_HEIGHT)
        figure = Figure(figsize=(width, height), layout="constrained")
        plot_ranges(self.found, figure.subplots())
        caption = "Each lump's range over the trials that the measure cannot tell from the best one."
        if self.found.verdict.source == "estimate":
            caption = f"Each lump's {self.found.interval_name} by the estimate from all trials."
        return Picture("ranges", caption, figure)

    def _boundary(self, width: float) -> Picture:
        figure = Figure(figsize=(width, 3.6), layout="constrained")
        plot_boundary(self.found, *self.over, figure.subplots(), self.boundary)
        share_legend(figure, figure.axes)
        caption = (
            f"Falls and survivors over {self.over[0]} and {self.over[1]}. Shaded: candidates fall there whose other "
            "lumps are the best one's; trials had others, so they may fall or survive elsewhere."
            if self.boundary is not None
            else f"Falls and survivors over {self.over[0]} and {self.over[1]}."
        )
        return Picture("boundary", caption, figure)

    def _parallel(self, width: float) -> Picture:
        figure = Figure(figsize=(width, 3.2), layout="constrained")
        plot_parallel(self.found, figure.subplots())
        share_legend(figure, figure.axes[:1])
        caption = "Trials as lines over the lumps' factors; the colour is the measure, falls are dotted."
        return Picture("parallel", caption, figure)

    def _correlation(self, width: float) -> Picture:
        side = min(width, 4.2 if len(self.found.names) < 20 else 6.5)
        figure = Figure(figsize=(side, 0.9 * side), layout="constrained")
        plot_correlation(self.found, figure.subplots())
        caption = (
            "Correlation of the lumps' factors over the best trials: "
            "near 1 or −1 a combination of two lumps is known better than either."
        )
        return Picture("correlation", caption, figure)

    @cached_property
    def replay(self) -> Replay:
        """A trial as the plant showed it, and as the twin at the estimate does."""
        assert self.found.estimate is not None
        return self.found.estimate.replay()

    def _motion(self, width: float) -> Picture:
        assert self.found.estimate is not None
        npush = len(self.replay.seen)
        how_many = "" if npush <= PUSHES else f" The first {PUSHES} of {npush} pushes."
        titles = {push: f"push {push + 1}" for push in range(min(npush, PUSHES))}
        return motion_picture(self.replay, titles, self.found.estimate.explains, how_many, width)

    def _residuals(self, width: float) -> Picture:
        assert self.found.estimate is not None
        picture = residuals_picture(self.found.estimate, width)
        if self.found.estimate.estimate.counts is None:
            return picture
        caption = "By how much the twin's counts of half periods differ from the plant's, by push and joint."
        return replace(picture, caption=caption)

    def _covariance(self, width: float) -> Picture:
        assert self.found.estimate is not None
        side = min(width, 4.2 if len(self.found.estimate.estimate.names) < 20 else 6.5)
        figure = Figure(figsize=(side, 0.9 * side), layout="constrained")
        plot_covariance(self.found.estimate, figure.subplots())
        caption = (
            "Correlation of the lumps by the covariance of the estimate: "
            "near 1 or −1 a combination of two lumps is known better than either."
        )
        return Picture("estimate-correlation", caption, figure)

    def _growth(self, width: float) -> Picture:
        assert self.found.estimate is not None
        truth = self.found.problem.open_plant().true_lumps()  # the truth meets the result in reports alone
        true = None if truth is None else truth.vector_of(self.found.estimate.kinds)
        figure = Figure(figsize=(width, 2.4), layout="constrained")
        plot_growth(self.found.estimate, true, figure.subplots())
        caption = (
            "How well the estimate from the first trials alone knows the lumps: the largest standard deviation of a "
            "lump and, where the truth is known, the largest error."
        )
        return Picture("estimate-trials", caption, figure)

    def _episode(self, width: float) -> Picture:
        figure, (left, right) = pair_of_panels(width, (3, 2))
        plot_angles(self.trajectory, self.found.problem.timestep, left)
        plot_phase(self.trajectory, right)
        caption = (
            "Joint angles and phase portrait of the best candidate after the last push; exactly compensated, it coasts."
        )
        return Picture("episode", caption, figure)


def motion_picture(shown: Replay, titles: dict[int, str], explains: bool, more: str, width: float) -> Picture:
    """What a plant showed and what the twin at the estimate shows.

    Args:
        shown: a trial.
        titles: of the pushes that are drawn, by their numbers.
        explains: whether the twin shows what was seen.
        more: what else the caption says.
        width: of the figure, in inches.
    """
    figure, axes = pairs_of_panels(width, len(titles))
    for (push, title), (motion, difference) in zip(titles.items(), axes, strict=True):
        plot_motion(shown, push, motion).set_title(title)
        plot_difference(shown, push, difference)
        motion.set_xlabel("")
        for panel in (motion, difference):
            panel.label_outer()
    share_legend(figure, [motion for motion, _ in axes])
    which = "first trial" if explains else "trial that it shows worst"
    caption = (
        f"What the plant showed and what the twin at the estimate shows under the same law, in the {which}; below "
        f"each push the difference.{more}"
    )
    return Picture("estimate-motion", caption, figure)


def residuals_picture(found: StudyEstimate, width: float) -> Picture:
    """Where the twin differs from the plant; `width` in inches."""
    figure = Figure(figsize=(width, 2.4), layout="constrained")
    plot_residuals(found, figure.subplots())
    caption = (
        "By how much the twin's motion differs from what was seen, by push and joint over all trials of the "
        "estimate, in units of what noise or rounding explains."
    )
    return Picture("estimate-residuals", caption, figure)
