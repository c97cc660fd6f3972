"""metaid identifies the dynamics of multi-link pendulums and arms from nothing but how they oscillate.

    import metaid

    metaid.run("three-link")  # creates and runs the shipped study in metaid.db; a frame of the lumps
    metaid.trials("three-link")  # every trial, as a tidy frame

Everything is imported when first used: `import metaid` itself is instant.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metaid.api import (
        bodies,
        compare,
        evaluate,
        load_findings,
        lumps,
        model,
        objective,
        perturb,
        run,
        studies,
        study,
        summary,
        trials,
        validate,
    )
    from metaid.episode import Outcome
    from metaid.errors import EpisodeError, MetaidError, PlantError, RecordError, RenderError, StorageError, StudyError
    from metaid.excitation import excite
    from metaid.plant import Plant, load_plant
    from metaid.recorded import estimate
    from metaid.show import figures
    from metaid.study import NominalMetricSampler, load_study

__version__ = "0.2.0"

_HOME = {
    "metaid.api": (
        "bodies",
        "compare",
        "evaluate",
        "load_findings",
        "lumps",
        "model",
        "objective",
        "perturb",
        "run",
        "studies",
        "summary",
        "trials",
        "validate",
    ),
    "metaid.errors": (
        "EpisodeError",
        "MetaidError",
        "PlantError",
        "RecordError",
        "RenderError",
        "StorageError",
        "StudyError",
    ),
    "metaid.episode": ("Outcome",),
    "metaid.excitation": ("excite",),
    "metaid.plant": ("Plant", "load_plant"),
    "metaid.recorded": ("estimate",),
    "metaid.study": ("NominalMetricSampler", "load_study"),
}
_MODULES = {"figures": "metaid.show.figures", "study": "metaid.study"}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "EpisodeError",
    "MetaidError",
    "NominalMetricSampler",
    "Outcome",
    "Plant",
    "PlantError",
    "RecordError",
    "RenderError",
    "StorageError",
    "StudyError",
    "bodies",
    "compare",
    "estimate",
    "evaluate",
    "excite",
    "figures",
    "load_findings",
    "load_plant",
    "load_study",
    "lumps",
    "model",
    "objective",
    "perturb",
    "run",
    "studies",
    "study",
    "summary",
    "trials",
    "validate",
]


class CallableStudy(ModuleType):
    """The package `metaid.study`, which is called, too: `metaid.study(NAME)` is the study of that name."""

    def __call__(self, name: Any, storage: str | None = None) -> Any:
        """The study of that name in the DB, or an Optuna study that `metaid.objective` was optimized in."""
        return import_module("metaid.api").study(name, storage)


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(_MODULES[name])
    if name in _MODULE_OF:
        return getattr(import_module(_MODULE_OF[name]), name)
    raise AttributeError(f"module 'metaid' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
