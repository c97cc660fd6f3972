"""What `study check` promises before any trial, against what studies then find: random chains, noise or none.

A promise is broken where a lump is further from the truth than the resolution that was promised. At most one lump in
twenty may be.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.chains import random_chain
from metaid.models import Array
from metaid.plant import FaultSettings, PlantSettings
from metaid.results import lumps_frame, read_snapshot
from metaid.results.lump_tables import best_table
from metaid.store import Store
from metaid.study import Problem, StudySettings, StudySpec, create_study, identifiability, run_study
from soak.common import SoakResult, soaked

STUDIES = 300
BROKEN = 0.05  # of all lumps, at most
TRIALS = {1: 200, 2: 400, 3: 700, 4: 1200}  # of a sampler that minimises
MILLIRADIAN = FaultSettings(angle_noise=1e-3)
BLIND = FaultSettings(angle_noise=1e-3, speed_sensor=False)
DIFFERING = FaultSettings(angle_noise=1e-3, speed_sensor=False, push_noise=0.02)
# Sampler, measure, faults.
KINDS: dict[str, tuple[str, str, FaultSettings]] = {
    "cmaes": ("cmaes", "spectral", FaultSettings()),
    "spectral with exact speeds": ("cmaes", "spectral", MILLIRADIAN),
    "smoothed": ("cmaes", "smoothed", BLIND),
    "smoothed, pushes that differ": ("cmaes", "smoothed", DIFFERING),
    "estimate": ("output-error", "spectral", FaultSettings()),
    "estimate with noise": ("output-error", "smoothed", BLIND),
    "estimate, pushes that differ": ("output-error", "smoothed", DIFFERING),
}


def spec_of(kind: str, nlink: int, seed: int) -> StudySpec:
    """A study of a random chain, as a key of KINDS says."""
    true, nominal = random_chain(nlink, 5000 + seed)
    sampler, measure, faults = KINDS[kind]
    settings: dict[str, Any] = {"plant": "chain", "nominal": "nominal", "sampler": sampler, "seed": seed}
    trials = 6 if sampler == "output-error" else TRIALS[nlink]
    estimate = {"enabled": sampler != "cmaes"}
    episode = {"measure": measure}
    study = StudySettings.model_validate(settings | {"trials": trials, "episode": episode, "estimate": estimate})
    plant = PlantSettings(links=true, faults=faults)
    return StudySpec(name="chain", plant_name="chain", plant=plant, nominal=nominal, study=study)


def errors(spec: StudySpec, folder: Path) -> Array:
    """The errors of a study's determined lumps in units of what was promised (nlump)."""
    promised = identifiability(Problem(spec))
    with closing(Store(str(folder / "metaid.db"), create=True)) as store:
        create_study(store, spec, f"{len(store.names())}")
        name = store.names()[-1]
        run_study(store, name)
        table = (
            lumps_frame(store, name) if spec.study.sampler == "output-error" else best_table(read_snapshot(store, name))
        )
        found = table["error"].to_numpy(dtype=np.float64)
    ratio: Array = np.abs(found) / promised.resolution
    known: Array = ratio[np.isfinite(ratio) & np.array(promised.determined)]
    return known


def run(scale: float) -> list[SoakResult]:
    """STUDIES of them, all kinds and numbers of links in turn."""
    count = max(round(STUDIES * scale), 1)

    def work() -> tuple[int, Sequence[str]]:
        ratios: dict[str, list[float]] = {kind: [] for kind in KINDS}
        with tempfile.TemporaryDirectory() as folder:
            for seed in range(count):
                kind = list(KINDS)[seed % len(KINDS)]
                ratios[kind] += errors(spec_of(kind, 1 + seed // len(KINDS) % 4, seed), Path(folder)).tolist()
        lumps = np.concatenate([np.array(each) for each in ratios.values()])
        for kind, each in ratios.items():
            beyond = np.array(each) > 1.0
            print(f"  {kind}: {beyond.sum()} of {len(each)} lumps beyond what was promised")
        share = float((lumps > 1.0).mean())
        return count, [f"{share:.1%} of {len(lumps)} lumps (allowed: {BROKEN:.0%})"] if share > BROKEN else []

    return [soaked("what study check promises, kept in 95 % of lumps", count, work)]
