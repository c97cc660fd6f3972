"""The paper's tables, figure and sweep, run again beside what it printed."""

from metaid.paper.tables import LIKE, PURE, paper_table, run_fig4, run_sweep, run_table, show_fig4

__all__ = [
    "LIKE",
    "PURE",
    "paper_table",
    "run_fig4",
    "run_sweep",
    "run_table",
    "show_fig4",
]
