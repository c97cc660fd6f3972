"""Studies with two kinds of kernels of BLAS, as on two kinds of processors: the trial tables are the same to rounding.

OpenBLAS chooses its kernels by the processor. `OPENBLAS_CORETYPE` makes it choose others.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from metaid.files import shipped_names
from metaid.results import trials_frame
from metaid.store import Store
from metaid.study import ARITHMETIC_KEY, arithmetic, create_study, load_study
from soak.common import SoakResult, soaked

KERNELS = "Haswell", "Nehalem"
ROUNDING = 1e-9  # of a factor, or of a value: linear algebra and fits add it up
# Beside the shipped studies: every sampler, more lumps than candidates in a generation, falls, counts, noise.
VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {
    "cmaes, 15 lumps": ("five-link", {"sampler": "cmaes", "trials": 800}),
    "cmaes, 55 lumps": ("ten-link", {"sampler": "cmaes", "trials": 400}),
    "cmaes, falls": (
        "three-link-coast",
        {"search.coordinates": "plain", "search.start": 0.55, "episode.steps": 1000, "trials": 400},
    ),
    "cmaes, counts": ("three-link-coast", {"search.coordinates": "plain", "episode.measure": "count", "trials": 300}),
    "cmaes, noise": ("noisy-three-link", {"sampler": "cmaes", "trials": 400}),
    "cmaes, held back": ("three-link-coast", {"search.low": 0.9, "search.high": 1.1}),
    "tpe": ("five-link", {"sampler": "tpe", "trials": 300}),
    "tpe, noise": ("noisy-three-link", {"sampler": "tpe", "trials": 60}),
    "random": ("five-link", {"sampler": "random", "trials": 100}),
    "optuna-cmaes": ("three-link-coast", {"sampler": "optuna-cmaes", "trials": 300}),
    "output-error, frequency": ("five-link", {"estimate.compare": "frequency", "trials": 8}),
    "output-error, noise": ("noisy-three-link", {"trials": 10, "seed": 7}),
}
RUN = """
import sys
from metaid.store import Store
from metaid.study import run_study
store = Store(sys.argv[1])
for name in store.names():
    run_study(store, name)
"""


def run(scale: float) -> list[SoakResult]:
    """All shipped studies and all variants at scale 1."""
    studies: dict[str, tuple[str, dict[str, Any]]] = {name: (name, {}) for name in shipped_names("studies")} | VARIANTS
    count = max(round(len(studies) * scale), 1)

    def work() -> tuple[int, list[str]]:
        with tempfile.TemporaryDirectory() as folder:
            return compare(Path(folder), dict(list(studies.items())[-count:]))

    return [soaked(f"{' and '.join(KERNELS)} kernels of BLAS: the same table to rounding", count, work)]


def compare(folder: Path, studies: dict[str, tuple[str, dict[str, Any]]]) -> tuple[int, list[str]]:
    """Runs `studies`, each a file and changes by name, with both kinds of kernels; how many, and what differs."""
    stores = []
    for kernels in KERNELS:
        store = Store(str(folder / f"{kernels}.db"), create=True)
        for name, (file, changes) in studies.items():
            create_study(store, load_study(file, changes), name)
        stores.append(store)
    runs = [
        subprocess.Popen([sys.executable, "-c", RUN, store.url], env={**os.environ, "OPENBLAS_CORETYPE": kernels})
        for store, kernels in zip(stores, KERNELS, strict=True)
    ]
    failures = [f"a run ended with {status}" for status in [each.wait() for each in runs] if status != 0]
    with closing(stores[0]), closing(stores[1]):
        if failures:
            return 0, failures
        begun = [store.attribute(next(iter(studies)), ARITHMETIC_KEY) for store in stores]
        if begun[0] == begun[1]:
            return 0, [f"this BLAS has no such kernels: {arithmetic()}"]
        return len(studies), [
            f"{name}: {fault}" for name in studies for fault in _differences(stores[0], stores[1], name)
        ]


def _differences(one: Store, other: Store, name: str) -> list[str]:
    tables = [trials_frame(store, name) for store in (one, other)]
    if len(tables[0]) != len(tables[1]):
        return [f"{len(tables[0])} and {len(tables[1])} trials"]
    if not (tables[0]["state"] == tables[1]["state"]).all():
        return ["other states"]
    for column in tables[0].columns.drop("state"):
        first, second = (table[column].to_numpy(dtype=np.float64) for table in tables)
        if not np.allclose(first, second, rtol=ROUNDING, atol=ROUNDING, equal_nan=True):
            return [f"{column} differs by up to {np.nanmax(np.abs(first - second)):.2g}"]
    return []
