"""Pictures, with matplotlib: each `plot_` function draws data on an Axes (a new one if none is given) and returns it.

from metaid import figures, load_findings

found = load_findings("three-link")
figures.plot_convergence(found)
"""

from metaid.figures.episodes import draw_episode, plot_angles, plot_phase
from metaid.figures.gallery import Gallery, Picture
from metaid.figures.landscape import plot_boundary, plot_parallel, plot_sweep
from metaid.figures.lumps import plot_correlation, plot_ranges
from metaid.figures.plants import plant_figure, plot_plant
from metaid.figures.search import plot_convergence, plot_error, plot_factor
from metaid.figures.style import COLOURS, SUFFIXES, save, style
from metaid.figures.tracking import draw_tracking, plot_tracking

__all__ = [
    "COLOURS",
    "SUFFIXES",
    "Gallery",
    "Picture",
    "draw_episode",
    "draw_tracking",
    "plant_figure",
    "plot_angles",
    "plot_boundary",
    "plot_convergence",
    "plot_correlation",
    "plot_error",
    "plot_factor",
    "plot_parallel",
    "plot_phase",
    "plot_plant",
    "plot_ranges",
    "plot_sweep",
    "plot_tracking",
    "save",
    "style",
]
