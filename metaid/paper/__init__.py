"""What is the paper's own: its search, its whole counts matched (`counting/`), its tables, figure and sweep, run again
beside what it printed. All but the search loads numba, once it is asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from metaid.paper.dinoip import MOST_STEPS_UP, Dinoip, DinoipOptions

if TYPE_CHECKING:
    from metaid.paper.tables import LIKE, PURE, paper_table, run_fig4, run_sweep, run_table, show_fig4

__all__ = [
    "LIKE",
    "MOST_STEPS_UP",
    "PURE",
    "Dinoip",
    "DinoipOptions",
    "paper_table",
    "run_fig4",
    "run_sweep",
    "run_table",
    "show_fig4",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module("metaid.paper.tables"), name)
    raise AttributeError(f"module 'metaid.paper' has no attribute '{name}'")
