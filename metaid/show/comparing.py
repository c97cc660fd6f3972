"""Several studies beside one another as one self-contained HTML page."""

from __future__ import annotations

from metaid.results import Comparison
from metaid.show.figures import comparison_figure
from metaid.show.figures.style import WIDTHS
from metaid.show.pages import filled_in, page_figure


def render_comparison(found: Comparison) -> str:
    """The page."""
    against = "the truth" if found.knows_truth else "the first study that found it"
    caption = f"What each study found of each lump, with its interval, as a deviation from {against}."
    figure = page_figure("comparison", caption, (comparison_figure(found, width) for width in WIDTHS))
    return filled_in("comparison.html", names=found.names, figure=figure, **found.summary())
