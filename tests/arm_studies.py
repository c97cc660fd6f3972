"""Studies of the arm to learn on, and a DB of them."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from metaid.store import Store
from metaid.study import StudySpec, create_study, load_study, run_study

ARM = "spatial-three-link"


def spec_of(**changes: object) -> StudySpec:
    """The study of the arm to learn on."""
    return load_study(ARM, changes)


def with_noise(spec: StudySpec, size: float) -> StudySpec:
    """The same on sensors with noise of so many rad, and no sensor of speed."""
    faults = spec.plant.faults.model_copy(update={"angle_noise": size, "speed_sensor": False})
    return spec.model_copy(update={"plant": spec.plant.model_copy(update={"faults": faults})})


def make_arm_studies(folder: Path) -> None:
    """A DB in a folder; see the fixture `arms`."""
    exact = spec_of()
    longer = tuple((x, y, 1.01 * z) for x, y, z in exact.nominal.position)
    bent = exact.model_copy(update={"nominal": exact.nominal.model_copy(update={"position": longer})})
    with closing(Store(str(folder / "arms.db"), create=True)) as store:
        for name, spec, trials in (("exact", exact, 4), ("noisy", with_noise(exact, 1e-4), 2), ("bent", bent, 1)):
            study = spec.study.model_copy(update={"trials": trials})
            run_study(store, create_study(store, spec.model_copy(update={"study": study}), name))
