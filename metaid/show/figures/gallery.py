"""The figures of a study as `metaid study plot` and the report have them: one a question, each with a caption."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from metaid.episode import States
from metaid.errors import StorageError
from metaid.models import Array
from metaid.show.figures.episodes import plot_angles, plot_phase
from metaid.show.figures.estimate import plot_covariance, plot_difference, plot_growth, plot_motion, plot_residuals
from metaid.show.figures.landscape import plot_boundary, plot_parallel, plot_sweep
from metaid.show.figures.lumps import plot_correlation, plot_known, plot_ranges
from metaid.show.figures.panels import pair_of_panels, pairs_of_panels, panels, share_legend, square
from metaid.show.figures.search import plot_convergence, plot_error, plot_factor
from metaid.show.figures.style import WIDTHS, style
from metaid.show.figures.tracking import plot_tracking

if TYPE_CHECKING:
    from metaid.estimation import Replay
    from metaid.results import Findings, Plane, Sweep
    from metaid.study.estimates import StudyEstimate

LEAST_HEIGHT = 2.3  # inches: 200 pixels of a phone
PANELS = 12  # lumps at most in a figure of one panel each
FEWEST = 2  # trials at least for a line over them; and a lump for the correlation of their factors
PUSHES = 6  # pushes at most in a figure of two panels each
LINE = 0.14  # inches, of a base parameter
SWEPT, GRID = 61, 36  # factors along a line, and along each side of a plane


@dataclass(frozen=True)
class Picture:
    """A figure, the file name that it deserves, and what it shows in a sentence or two."""

    name: str
    caption: str
    figure: Figure


Drawn = tuple[Figure, str]  # a figure and its caption
Maker = Callable[[float], Drawn]  # draws one so many inches wide


class Pictures(ABC):
    """The figures that there are of what was found."""

    @property
    @abstractmethod
    def makers(self) -> dict[str, Maker]:
        """What makes each of them, by its name."""

    def pictures(self, width: str = "page") -> Iterator[Picture]:
        """One after another, for a `width` of "page" or "column"."""
        for name in self.makers:
            yield self.picture(name, width)

    def picture(self, name: str, width: str = "page") -> Picture:
        """The one of that `name`, for a `width` of "page" or "column"."""
        with style():
            figure, caption = self.makers[name](WIDTHS[width])
        return Picture(name, caption, figure)


class Gallery(Pictures):
    """All figures of a study; `over` are the two lumps of the fall boundary (default: gravity of the first two links).

    Raises StorageError where there is nothing to draw yet, no such lump, or no fall boundary.
    """

    def __init__(self, found: Findings, over: tuple[str, str] | None = None) -> None:
        self.found = found
        self.names = found.names[:PANELS]
        if found.estimate is None:
            _ = self.centre  # refuses a study that has nothing to draw
        if over is not None and not found.problem.draws_episodes:
            raise StorageError(
                f"study '{found.name}' has no fall boundary to draw (its figures: {', '.join(self.makers)})"
            )
        self.over = over or (found.names[0], found.names[min(1, len(found.names) - 1)])
        self._pair = found.index(self.over[0]), found.index(self.over[1])
        if over and over[0] == over[1]:
            raise StorageError(f"a boundary is over two different lumps, not {over[0]} twice")

    @property
    def centre(self) -> Array:
        """The best candidate (nlump).  Raises StorageError where there is none yet."""
        return self.found.best_factors

    @cached_property
    def objective(self) -> Any:
        """What evaluates candidates."""
        return self.found.problem.make_objective()

    @cached_property
    def makers(self) -> dict[str, Maker]:
        """What makes each figure that there is, by its name. A rig is not moved for a picture: those that need more
        episodes are left out.
        """
        found, estimate, problem = self.found, self.found.estimate, self.found.problem
        survived, several = not found.survivors.empty, len(found.names) > 1
        explains, episodes = estimate is not None and estimate.explains, survived and problem.draws_episodes
        known, prior = found.lumps["identified"].notna().any(), found.sought.deviations is not None
        makers = [
            ("convergence", self._is_line, self._convergence),
            ("factors", self._is_line, self._factors),
            ("ranges", known and survived and not prior, self._ranges),
            ("tracking", found.verdict.has_result and problem.spec.is_simulated, self._tracking),
            ("known", found.verdict.has_result and prior, self._known),
            ("frequency", episodes, self._frequency),
            ("boundary", survived and several and not prior, self._boundary),
            ("parallel", self._is_line and several, self._parallel),
            ("correlation", several and self._correlates, self._correlation),
            ("estimate-motion", estimate is not None and not problem.robot.slides.all(), self._motion),
            ("estimate-residuals", estimate is not None, self._residuals),
            ("estimate-correlation", explains, self._covariance),
            ("estimate-trials", explains and estimate is not None and estimate.estimate.counts is None, self._growth),
            ("episode", episodes, self._episode),
        ]
        return {name: make for name, is_drawn, make in makers if is_drawn}

    @property
    def _is_line(self) -> bool:
        """Whether there are trials enough for a line over them."""
        return len(self.found.survivors) >= FEWEST

    @property
    def _correlates(self) -> bool:
        """Whether there are trials enough for a correlation of their factors."""
        return len(self.found.closest) > FEWEST * len(self.found.names)

    @property
    def left_out(self) -> list[tuple[str, str]]:
        """What is not drawn, and why."""
        found, problem, verdict = self.found, self.found.problem, self.found.verdict
        prior, said = found.sought.deviations is not None, []
        if not self._is_line:
            said.append(("How the trials went", f"there are {len(found.survivors)} that did not fall"))
        if found.true_factors is None:
            said.append(("Errors", f"the plant does not tell its true {found.sought.noun}s"))
        if not found.lumps["identified"].notna().any() or (prior and not verdict.has_result):
            what = f"How well {found.sought.noun}s are known" if prior else "Ranges of the lumps"
            said.append((what, f"no {found.sought.noun} is identified: the verdict is '{verdict.word}'"))
        if not problem.spec.is_simulated:
            said.append(
                ("Frequency over the factors, motion of the best, tracking", "a rig is not moved for a picture")
            )
        elif not verdict.has_result:
            said.append(("Tracking", f"the verdict is '{verdict.word}'"))
        if len(found.names) == 1:
            said.append(("Fall boundary, parallel lines, correlation", f"there is one {found.sought.noun} alone"))
        elif not self._correlates:
            said.append(("Correlation of the factors over the best trials", f"{len(found.closest)} trials are too few"))
        if not len(found.falls):
            said.append(("Falls", "no trial fell"))
        if found.estimate is None:
            said.append(("Motion beside the twin's", "no estimate has a twin"))
        elif not found.estimate.explains:
            said.append(("Correlation and growth of the estimate", "it does not explain what was seen"))
        if found.estimate is not None and problem.robot.slides.any():
            said.append(("The motion of slides", "it has another unit"))
        return said

    @cached_property
    def sweeps(self) -> list[Sweep]:
        """The measure along each lump's factor, from its lower to its upper bound."""
        from metaid.results import sweep

        return [sweep(self.objective, self.centre, i, self._between_bounds(i, SWEPT)) for i in range(len(self.names))]

    @cached_property
    def boundary(self) -> Plane | None:
        """Where candidates fall over the two lumps, between their bounds; None of a rig."""
        from metaid.results import plane

        if not self.found.problem.draws_episodes:
            return None
        first, second = (self._between_bounds(i, GRID) for i in self._pair)
        return plane(self.objective, self.centre, self._pair, first, second)

    @cached_property
    def trajectory(self) -> States:
        """The best candidate's motion after the last push."""
        trajectory: States = self.objective.watch(self.centre)[1]
        return trajectory

    def _between_bounds(self, lump: int, count: int) -> Array:
        """Evenly spaced factors (count) of a lump, from its lower to its upper bound."""
        return np.linspace(self.found.problem.low[lump], self.found.problem.high[lump], count)

    def _convergence(self, width: float) -> Drawn:
        caption = "The measure of every survivor, and the best so far"
        caption += "; falls are marked along the top." if len(self.found.falls) else "."
        if not self.found.error_curves(self.found.bests[-1:]):
            figure = Figure(figsize=(width, 2.6), layout="constrained")
            plot_convergence(self.found, figure.subplots())
            return figure, caption
        figure, (left, right) = pair_of_panels(width, (1, 1))
        plot_convergence(self.found, left)
        plot_error(self.found, right)
        if self.found.nominal_error is None:
            other = "the largest error of a lump of the best candidate, which the search never sees"
        else:
            share_legend(figure, [left, right])
            other = "how wrong the arm of the best trial is on states that no trial has seen, which no search sees"
        return figure, f"{caption} The other panel has {other}."

    def _factors(self, width: float) -> Drawn:
        figure, axes = panels(width, len(self.names))
        for lump, panel in zip(self.names, axes, strict=True):
            plot_factor(self.found, lump, panel)
        share_legend(figure, axes)
        what = f"{self.found.sought.noun}, as {self.found.sought.axis}"
        return figure, f"Each {what}, over the trials.{self._how_many}"

    def _frequency(self, width: float) -> Drawn:
        figure, axes = panels(width, len(self.names))
        for swept, panel in zip(self.sweeps, axes, strict=True):
            plot_sweep(self.found, swept, panel)
        share_legend(figure, axes)
        return figure, f"The measure against one lump's factor, the other lumps at their best.{self._how_many}"

    @property
    def _how_many(self) -> str:
        shown, all_of_them = len(self.names), len(self.found.names)
        return "" if shown == all_of_them else f" The first {shown} of {all_of_them}."

    def _ranges(self, width: float) -> Drawn:
        height = max(1.2 + 0.2 * len(self.found.known_lumps), LEAST_HEIGHT)
        figure = Figure(figsize=(width, height), layout="constrained")
        plot_ranges(self.found, figure.subplots())
        if self.found.verdict.source == "estimate":
            return figure, f"Each lump's {self.found.interval_name} by the estimate from all trials."
        return figure, "Each lump's range over the trials that the measure cannot tell from the best one."

    def _known(self, width: float) -> Drawn:
        figure = Figure(figsize=(width, 1.0 + LINE * len(self.found.lumps)), layout="constrained")
        share_legend(figure, [plot_known(self.found, figure.subplots())])
        return figure, "How well each base parameter is known, as a share of how wrong it may have been beforehand."

    def _tracking(self, width: float) -> Drawn:
        assert self.found.validation is not None
        figure = Figure(figsize=(width, 2.6), layout="constrained")
        share_legend(figure, [plot_tracking(self.found.validation, figure.subplots())])
        return figure, "Computed torque along smooth sinusoids with each model, the feedback the same."

    def _boundary(self, width: float) -> Drawn:
        figure = Figure(figsize=(width, 3.6), layout="constrained")
        plot_boundary(self.found, *self.over, figure.subplots(), self.boundary)
        share_legend(figure, figure.axes)
        return figure, (
            f"Falls and survivors over {self.over[0]} and {self.over[1]}. Shaded: candidates fall there whose other "
            "lumps are the best one's; trials had others, so they may fall or survive elsewhere."
            if self.boundary is not None
            else f"Falls and survivors over {self.over[0]} and {self.over[1]}."
        )

    def _parallel(self, width: float) -> Drawn:
        figure = Figure(figsize=(width, 3.2), layout="constrained")
        plot_parallel(self.found, figure.subplots())
        share_legend(figure, figure.axes[:1])
        return figure, "Trials as lines over the lumps' factors; the colour is the measure, falls are dotted."

    def _correlation(self, width: float) -> Drawn:
        figure = square(width, len(self.found.names))
        plot_correlation(self.found, figure.subplots())
        return figure, (
            "Correlation of the lumps' factors over the best trials: "
            "near 1 or −1 a combination of two lumps is known better than either."
        )

    @property
    def estimate(self) -> StudyEstimate:
        """What all trials say, where there is a figure of that."""
        assert self.found.estimate is not None
        return self.found.estimate

    @cached_property
    def replay(self) -> Replay:
        """A trial as the plant showed it, and as the twin at the estimate does; of its hinges alone."""
        whole, hinges = self.estimate.replay(), ~self.found.problem.robot.slides
        parts = {part: getattr(whole, part)[..., hinges] for part in ("seen", "simulated", "noise")}
        return replace(whole, **parts, joints=tuple(np.array(whole.joints)[hinges].tolist()))

    def _motion(self, width: float) -> Drawn:
        titles = self.found.problem.robot.push_titles
        pushes = np.unique(np.linspace(0, len(titles) - 1, PUSHES).round().astype(int)).tolist()
        figure, axes = pairs_of_panels(width, len(pushes))
        for push, (motion, difference) in zip(pushes, axes, strict=True):
            plot_motion(self.replay, push, motion).set_title(titles[push])
            plot_difference(self.replay, push, difference)
            motion.set_xlabel("")
            for panel in (motion, difference):
                panel.label_outer()
        share_legend(figure, [motion for motion, _ in axes])
        which = "first trial" if self.estimate.explains else "trial that it shows worst"
        caption = (
            f"What the plant showed and what the twin at the estimate shows under the same law, in the {which}; below "
            "each push the difference."
        )
        more = "" if len(pushes) == len(titles) else f" {len(pushes)} of {len(titles)} pushes."
        return figure, caption + more

    def _residuals(self, width: float) -> Drawn:
        figure = Figure(figsize=(width, 2.4), layout="constrained")
        plot_residuals(self.estimate, figure.subplots())
        if self.estimate.estimate.counts is not None:
            return figure, "By how much the twin's counts of half periods differ from the plant's, by push and joint."
        return figure, (
            "By how much the twin's motion differs from what was seen, by push and joint over all trials of the "
            "estimate, scaled by what noise or rounding explains."
        )

    def _covariance(self, width: float) -> Drawn:
        figure = square(width, len(self.estimate.estimate.names))
        plot_covariance(self.estimate, figure.subplots())
        noun = self.found.sought.noun
        return figure, (
            f"Correlation of the {noun}s by the covariance of the estimate: "
            f"near 1 or −1 a combination of two {noun}s is known better than either."
        )

    def _growth(self, width: float) -> Drawn:
        robot = self.found.problem.robot
        true = robot.true_values(robot.estimated)  # the truth meets the result in reports alone
        figure = Figure(figsize=(width, 2.4), layout="constrained")
        plot_growth(self.estimate, None if np.isnan(true).any() else true, figure.subplots())
        return figure, (
            f"How well the estimate from the first trials alone knows the {self.found.sought.noun}s: the largest "
            "standard deviation and, where the truth is known, the largest error."
        )

    def _episode(self, width: float) -> Drawn:
        figure, (left, right) = pair_of_panels(width, (3, 2))
        plot_angles(self.trajectory, self.found.problem.timestep, left)
        plot_phase(self.trajectory, right)
        return figure, (
            "Joint angles and phase portrait of the best candidate after the last push; exactly compensated, it coasts."
        )
