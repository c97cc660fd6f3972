"""What a search for individual parameters found: the set of bodies that are as good as the best one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from metaid.models import bodies_of
from metaid.plant import MujocoPlant
from metaid.results.snapshot import surviving
from metaid.store import Trial
from metaid.study import COARSEST, Problem


def parameters_table(problem: Problem, trials: list[Trial]) -> pd.DataFrame:
    """One row a parameter of a study with these `trials`, whose factors are of parameters: what `metaid.parameters`
    gives.
    """
    assert problem.body_space is not None
    bodies = problem.body_space.bodies
    low = high = np.full(len(bodies.names), np.nan)
    survivors, equal = surviving(trials), np.empty((0, 0))
    if survivors:
        limit = min(trial.outcome.value for trial in survivors) + problem.resolution
        equal = np.array([trial.factors for trial in survivors if trial.outcome.value <= limit])
        low, high = equal.min(axis=0) * bodies.vector, equal.max(axis=0) * bodies.vector
    plant = problem.open_plant()
    true = np.full(len(low), np.nan)
    if isinstance(plant, MujocoPlant) and plant.settings.truth_known:
        true = bodies_of(plant.chain).vector
    columns = {
        "name": bodies.names,
        "unit": bodies.units,
        "nominal": bodies.vector,
        "low": low,
        "high": high,
        "true": true,
        "bodies": len(equal),
    }
    return pd.DataFrame(columns)


def describe_bodies(shown: dict[str, Any]) -> str:
    """What the ranges in a `summary` of individual parameters mean, in a sentence or two."""
    parameters, lumps = shown["parameters"], shown["lumps"]
    if not parameters[0]["bodies"]:
        return "no body has survived yet"
    spread = max(lump["high"] / lump["low"] - 1.0 for lump in lumps if lump["determined"])
    ratios = {row["name"]: row["high"] / row["low"] for row in parameters}
    narrow = {name: ratio for name, ratio in ratios.items() if ratio - 1.0 <= COARSEST}
    wide = ", ".join(f"{name} by a factor of {ratio:.3g}" for name, ratio in ratios.items() if name not in narrow)
    text = f"{parameters[0]['bodies']} bodies are as good as the best one, and their lumps agree within {spread:.2%}"
    if wide:
        text += f"; but they differ in {wide}: the lumps are identified, these parameters are not"
    return f"{text}. Inertias have no part in these lumps."
