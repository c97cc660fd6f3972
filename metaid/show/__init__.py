"""What people look at: figures, the report, the dashboard, the viewer and films.

Each is loaded when it is first used: they need libraries of their own, some of which are optional (`metaid[all]`).
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metaid.show.companions import delete_companion
    from metaid.show.comparing import render_comparison
    from metaid.show.dashboard import make_dashboard, serve
    from metaid.show.log_report import render_log
    from metaid.show.report import render
    from metaid.show.scene import open_viewer
    from metaid.show.stages import ArmStage, ChainStage
    from metaid.show.video import SUFFIXES, film

_MODULE_OF = {
    "ArmStage": "stages",
    "ChainStage": "stages",
    "SUFFIXES": "video",
    "delete_companion": "companions",
    "film": "video",
    "make_dashboard": "dashboard",
    "open_viewer": "scene",
    "render": "report",
    "render_comparison": "comparing",
    "render_log": "log_report",
    "serve": "dashboard",
}


def __getattr__(name: str) -> Any:
    if name in _MODULE_OF:
        return getattr(import_module(f"metaid.show.{_MODULE_OF[name]}"), name)
    raise AttributeError(f"module 'metaid.show' has no attribute '{name}'")
