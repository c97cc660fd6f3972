"""metaid identifies the dynamics of multi-link pendulums and robot arms, from logs or from pushes.

Ten calls do most:

    estimate(logs, nominal)   what logs of a robot say: paths or frames; `.model.write("robot.xml")`
    excite(nominal)           the motion to record of a robot
    load_plant(plant)         a robot or pendulum: a shipped name, a plant file, MJCF, URDF, or a dict
    perturb(plant)            one push of it, without a study
    run(study)                makes a study in metaid.db and runs it; a frame of what it found
    lumps(name)               that frame again; `trials(name)` has every trial
    study(name).estimate      what all its trials say
    model(name)               the identified model: torque(q, v), mass_matrix(q), write(path)
    validate(name)            it, the nominal and the true one on new pushes
    objective(study)          a study as a function for Optuna's own `optimize`

`help(metaid.run)` has the details and an example of each. What is wrong is said by a `MetaidError`, in one line.
Everything is imported when first used: `import metaid` itself is instant.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metaid.api import (
        bodies,
        check,
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
    from metaid.recorded import Payload, estimate
    from metaid.show import figures
    from metaid.study import NominalMetricSampler, load_study

__version__ = "0.2.0"

_MODULES = {"figures": "metaid.show.figures", "study": "metaid.study"}
_HOME = {  # of what is neither an error nor from `metaid.api`
    "NominalMetricSampler": "metaid.study",
    "Outcome": "metaid.episode",
    "Payload": "metaid.recorded",
    "Plant": "metaid.plant",
    "estimate": "metaid.recorded",
    "excite": "metaid.excitation",
    "load_plant": "metaid.plant",
    "load_study": "metaid.study",
}

__all__ = [
    "EpisodeError",
    "MetaidError",
    "NominalMetricSampler",
    "Outcome",
    "Payload",
    "Plant",
    "PlantError",
    "RecordError",
    "RenderError",
    "StorageError",
    "StudyError",
    "bodies",
    "check",
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
    if name not in __all__:
        raise AttributeError(f"module 'metaid' has no attribute '{name}'")
    home = "metaid.errors" if name.endswith("Error") else _HOME.get(name, "metaid.api")
    return getattr(import_module(home), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
