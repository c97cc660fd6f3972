"""Models of known dynamics, as a study would have identified them."""

from __future__ import annotations

import pandas as pd

from metaid.exporting import Dynamics, IdentifiedModel

FULL = ("gravity", "coriolis", "inertia")
ABOUT = dict.fromkeys(("plant", "sampler", "measure", "source", "written", "metaid"), "so")
ABOUT |= {"seed": 0, "trials": 1, "verdict": "found", "reasons": [], "misfit": 0.5}  # type: ignore[dict-item]


def model_of(dynamics: Dynamics, name: str, gravity: float | tuple[float, ...] = 9.81) -> IdentifiedModel:
    """A model that is written, of a study that was not run."""
    columns = ["name", "unit", "nominal", "factor", "identified", "sd", "low", "high", "determined", "value"]
    lumps = pd.DataFrame({column: [] for column in columns}).astype({"determined": bool})
    return IdentifiedModel(name, dict(ABOUT), lumps, None, dynamics, gravity, 0.002)
