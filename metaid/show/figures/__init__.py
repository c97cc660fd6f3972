"""Pictures, with matplotlib: each `plot_` function draws data on an Axes (a new one if none is given) and returns it.

from metaid import figures, load_findings

found = load_findings("three-link")
figures.plot_convergence(found)
"""

from metaid.show.figures.comparison import comparison_figure, plot_comparison
from metaid.show.figures.episodes import draw_episode, draw_push, plot_angles, plot_phase, plot_speeds
from metaid.show.figures.estimate import plot_covariance, plot_difference, plot_growth, plot_motion, plot_residuals
from metaid.show.figures.gallery import Gallery, Picture
from metaid.show.figures.landscape import plot_boundary, plot_parallel, plot_sweep
from metaid.show.figures.log_gallery import LogGallery
from metaid.show.figures.logs import (
    plot_bodies,
    plot_friction,
    plot_gravity,
    plot_predicted_torque,
    plot_torque_residuals,
)
from metaid.show.figures.lumps import plot_correlation, plot_known, plot_ranges
from metaid.show.figures.plants import plant_figure, plot_plant, sketch
from metaid.show.figures.search import plot_convergence, plot_error, plot_factor
from metaid.show.figures.style import (
    COLOURS,
    COLUMN,
    FALL,
    INK,
    PAGE,
    RANGE,
    SURVIVOR,
    laid_out,
    said_in,
    save,
    style,
    with_titles,
)
from metaid.show.figures.tracking import draw_tracking, plot_tracking

__all__ = [
    "COLOURS",
    "COLUMN",
    "FALL",
    "INK",
    "PAGE",
    "RANGE",
    "SURVIVOR",
    "Gallery",
    "LogGallery",
    "Picture",
    "comparison_figure",
    "draw_episode",
    "draw_push",
    "draw_tracking",
    "laid_out",
    "plant_figure",
    "plot_angles",
    "plot_bodies",
    "plot_boundary",
    "plot_comparison",
    "plot_convergence",
    "plot_correlation",
    "plot_covariance",
    "plot_difference",
    "plot_error",
    "plot_factor",
    "plot_friction",
    "plot_gravity",
    "plot_growth",
    "plot_known",
    "plot_motion",
    "plot_parallel",
    "plot_phase",
    "plot_plant",
    "plot_predicted_torque",
    "plot_ranges",
    "plot_residuals",
    "plot_speeds",
    "plot_sweep",
    "plot_torque_residuals",
    "plot_tracking",
    "said_in",
    "save",
    "sketch",
    "style",
    "with_titles",
]
