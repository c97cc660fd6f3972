"""Several studies beside one another as one self-contained HTML page."""

from __future__ import annotations

from metaid.results import Comparison
from metaid.show.figures import comparison_figure
from metaid.show.pages import PageFigure, filled_in, inline_svg


def render_comparison(found: Comparison) -> str:
    """The page."""
    wide, narrow = (inline_svg(comparison_figure(found, width), f"{width}-") for width in ("page", "column"))
    caption = "What each study found of each lump, with its interval"
    caption += (
        ", as a deviation from the truth."
        if found.knows_truth
        else ", as a deviation from the first study that found it."
    )
    figure = PageFigure("comparison", caption, wide, narrow)
    return filled_in("comparison.html", names=found.names, figure=figure, **found.summary())
