"""The figures of a study of an arm, each with a caption, and those that there are none of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from metaid.results.arms import ArmFindings
from metaid.show.figures.gallery import PUSHES, WIDTHS, Picture, motion_picture, residuals_picture
from metaid.show.figures.lumps import plot_known
from metaid.show.figures.panels import pair_of_panels, share_legend
from metaid.show.figures.search import plot_convergence, plot_model_error
from metaid.show.figures.style import style
from metaid.show.figures.tracking import plot_tracking

FEWEST = 2  # trials that survived, for a line over them
LINE = 0.14  # inches, of a base parameter


class ArmGallery:
    """All figures of a study of an arm."""

    NAMES = "convergence", "known", "tracking", "estimate-motion", "estimate-residuals"

    def __init__(self, found: ArmFindings) -> None:
        self.found = found

    def pictures(self, width: str = "page") -> Iterator[Picture]:
        """One after another, for a `width` of "page" or "column"."""
        makers = [self._convergence] if len(self.found.survivors) >= FEWEST else []
        if self.found.verdict.has_result:
            makers += [self._known, self._tracking]
        if self.found.estimate is not None:
            makers += [*([self._motion] if self._hinges.any() else []), self._residuals]
        for make in makers:
            with style():
                picture = make(WIDTHS[width])
            yield picture

    @property
    def left_out(self) -> list[tuple[str, str]]:
        """What is not drawn, and why."""
        nothing, slides = self.found.estimate is None, ~self._hinges
        why = f"the verdict is '{self.found.verdict.word}'"
        return [
            *([] if self.found.verdict.has_result else [("Base parameters, coasting and tracking", why)]),
            *([("Motion beside the twin's", "no estimate has a twin")] if nothing else []),
            *([("The motion of slides", "it has another unit")] if slides.any() and not nothing else []),
            ("The shapes of the arm", "the DB has its joints and links alone"),
        ]

    @property
    def _hinges(self) -> NDArray[np.bool_]:
        """Which joints are hinges (njoint)."""
        return ~self.found.problem.nominal.slides

    def _convergence(self, width: float) -> Picture:
        figure, (left, right) = pair_of_panels(width, (1, 1))
        plot_convergence(self.found, left)
        plot_model_error(self.found, right)
        share_legend(figure, [left, right])
        caption = (
            "The measure of every trial in which no push fell, and the best so far; falls are marked along the top. "
            "Beside it how wrong the arm of the best trial is on states that no trial has seen, which no search sees."
        )
        return Picture("convergence", caption, figure)

    def _known(self, width: float) -> Picture:
        figure = Figure(figsize=(width, 1.0 + LINE * len(self.found.lumps)), layout="constrained")
        share_legend(figure, [plot_known(self.found, figure.subplots())])
        caption = "How well each base parameter is known, as a share of how wrong it may have been beforehand."
        return Picture("known", caption, figure)

    def _tracking(self, width: float) -> Picture:
        assert self.found.validation is not None
        figure = Figure(figsize=(width, 2.6), layout="constrained")
        share_legend(figure, [plot_tracking(self.found.validation, figure.subplots())])
        caption = "Computed torque along smooth sinusoids with each model, the feedback the same."
        return Picture("tracking", caption, figure)

    def _motion(self, width: float) -> Picture:
        assert self.found.estimate is not None
        whole, hinges = self.found.estimate.replay(), self._hinges
        shown = replace(
            whole,
            **{part: getattr(whole, part)[..., hinges] for part in ("seen", "simulated", "noise")},
            joints=tuple(np.array(whole.joints)[hinges].tolist()),
        )
        stiffness = self.found.problem.episode.stiffness
        pushes = np.unique(np.linspace(0, len(stiffness) - 1, PUSHES).round().astype(int)).tolist()
        titles = {push: f"push {push + 1}: {'springs' if stiffness[push] else 'coast'}" for push in pushes}
        how_many = "" if len(pushes) == len(stiffness) else f" {len(pushes)} of {len(stiffness)} pushes."
        return motion_picture(shown, titles, self.found.estimate.explains, how_many, width)

    def _residuals(self, width: float) -> Picture:
        assert self.found.estimate is not None
        return residuals_picture(self.found.estimate, width)
