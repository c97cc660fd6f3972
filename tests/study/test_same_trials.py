"""The trial table depends on the study and its seed alone, on every plant: nothing is left of one push for the next."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import matching_spec, random_links, what_is_known
from forked import Command

from metaid import results
from metaid.compiled import CompiledLoop, FaultyLoop, fastest_step
from metaid.episode import Episode, rich_pushes
from metaid.errors import StorageError
from metaid.files import shipped_names
from metaid.plant import FaultSettings, MujocoPlant, PlantSettings, chain_of, load_plant
from metaid.store import Store
from metaid.study import ARITHMETIC_KEY, StudySpec, arithmetic, create_study, load_study, run_study

pytestmark = pytest.mark.slow

EVERY_FAULT = FaultSettings(
    angle_noise=1e-3,
    speed_noise=0.02,
    encoder_step=1e-3,
    control_every=2,
    delay=1,
    torque_limit=20.0,
    torque_noise=0.02,
    push_noise=0.02,
    tilt=0.01,
)
RUBBING = tuple(link.model_copy(update={"frictionloss": 0.05, "damping": 0.01}) for link in random_links(3, 1))
SHIPPED = (load_plant(name) for name in shipped_names("plants"))
PLANTS = {plant.name: plant.settings for plant in SHIPPED if isinstance(plant, MujocoPlant)} | {
    "dry friction": PlantSettings(links=RUBBING),
    "dry friction and every fault": PlantSettings(links=RUBBING, faults=EVERY_FAULT),
}
TRIALS = 18
RUN_AND_DIE = """
import os, signal
from metaid.store.database import Store
from metaid.study.run import run_study
def die(progress):
    if progress.trials >= {trials}:
        os.kill(os.getpid(), signal.SIGKILL)
run_study(Store({url!r}), "killed", watch=die)
"""
RUN_WITH_OTHER_KERNELS = """
import sys
from metaid.store.database import Store
from metaid.study.run import run_study
store = Store(sys.argv[1])
run_study(store, "other")
run_study(store, "begun", trials=13)
"""


def spec_of(plant: PlantSettings, sampler: str) -> StudySpec:
    """A short study of that plant, with a nominal model whose masses are wrong, of all its kinds of lumps.

    With dry friction in the law MuJoCo's solver has most to do near the truth.
    """
    spec = load_study("three-link-coast", {"sampler": sampler, "trials": TRIALS, "estimate.enabled": False})
    search = spec.study.search.model_copy(update={"lumps": chain_of(plant.links).kinds})
    study = spec.study.model_copy(update={"search": search})
    nominal = tuple(
        link.model_copy(update={"mass": link.mass * (1.2 - 0.05 * i)}) for i, link in enumerate(plant.links)
    )
    return spec.model_copy(update={"plant": plant, "nominal": nominal, "study": study})


@pytest.mark.parametrize("plant", ["two-link", "ten-link", "dry friction and every fault"])
def test_trials_are_the_same_for_any_number_of_workers_and_any_stops(plant: str, tmp_path: Path) -> None:
    """One and three workers, and a run stopped in mid-generation and resumed with others."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    runs: dict[str, Any] = {"1": [(TRIALS, 1)], "3": [(TRIALS, 3)]}
    runs["stopped"] = [(5, 3), (11, 1), (TRIALS, 2)]
    for name, parts in runs.items():
        create_study(store, spec_of(PLANTS[plant], "tpe"), name)
        for trials, workers in parts:
            run_study(store, name, trials, workers=workers)
    tables = [results.trials_frame(store, name) for name in runs]
    store.close()
    assert len(tables[0]) > TRIALS // 2
    for table in tables[1:]:
        assert table.equals(tables[0])


def kill_after(trials: int, folder: Path, store: Store) -> None:
    """Runs the study `killed` in a process that SIGKILLs itself once there are so many trials; what it says is in a
    `folder`.
    """
    process = Command(folder, first=RUN_AND_DIE.format(url=store.url, trials=trials))
    assert process.wait() == -signal.SIGKILL, process.err


def test_trials_are_the_same_if_the_run_is_killed(tmp_path: Path) -> None:
    """SIGKILL after a generation, then resumed, on a plant with every fault."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    for name in ("whole", "killed"):
        create_study(store, spec_of(PLANTS["dry friction and every fault"], "cmaes"), name)
    run_study(store, "whole", workers=2)
    kill_after(12, tmp_path, store)
    assert 0 < store.count("killed") < TRIALS
    run_study(store, "killed", workers=1)
    assert results.trials_frame(store, "killed").equals(results.trials_frame(store, "whole"))


@pytest.mark.parametrize("plant", PLANTS)
def test_record_of_a_candidate_is_the_same_after_any_other(plant: str) -> None:
    """To the last bit, on a plant that is new and on one that has run wild, pushes in any order."""
    settings = PLANTS[plant]
    loops = []
    for _ in range(2):
        made = MujocoPlant("plant", settings)
        episode = Episode(rich_pushes(made, 2, 3.0, seed=1), 60)
        loop = FaultyLoop if settings.faults.named else CompiledLoop
        loops.append(loop(made, episode, fastest_step(made)))
    lumps = made.chain.lumps_of(made.chain.kinds)
    candidate = lumps.scaled(np.full(len(lumps.vector), 1.05))
    fresh = loops[0].run(candidate)
    for factor in (-9.0, 0.3, 1.1):
        loops[1].run(lumps.scaled(np.full(len(lumps.vector), factor)))
    later = loops[1].run(candidate)
    assert later.acceleration_energy.tobytes() == fresh.acceleration_energy.tobytes()
    assert later.speed_energy.tobytes() == fresh.speed_energy.tobytes()


@pytest.mark.parametrize("noisy", [False, True], ids=["ideal", "noisy"])
def test_estimate_is_the_same_for_any_number_of_workers_and_if_the_run_is_killed(noisy: bool, tmp_path: Path) -> None:
    """One and three workers, and SIGKILL after the third of four trials: the trials with what they showed, the lumps
    and their intervals, to the last bit.
    """
    store, spec = Store(str(tmp_path / "metaid.db"), create=True), matching_spec(noisy)
    for name, workers in (("one", 1), ("three", 3), ("killed", 2)):
        create_study(store, spec, name)
        if name == "killed":
            kill_after(3, tmp_path, store)
            assert 0 < store.count("killed") < 4  # the last trials may not have been written yet
        run_study(store, name, workers=workers)
    shown = [what_is_known(store, name) for name in ("one", "three", "killed")]
    assert store.count("one") == 4
    assert all(each == shown[0] for each in shown[1:])


def run_with_other_kernels(store: Store) -> None:
    """Runs the study "other", and the first 13 trials of "begun", with kernels of BLAS for an older processor."""
    here = arithmetic()
    older = "Nehalem" if "Nehalem" not in here else "Haswell"
    environment = {**os.environ, "OPENBLAS_CORETYPE": older}
    code = [sys.executable, "-c", RUN_WITH_OTHER_KERNELS, store.url]
    subprocess.run(code, check=True, env=environment)
    if store.attribute("other", ARITHMETIC_KEY) == here:
        pytest.skip("this BLAS has no kernels to choose from")


def test_trials_are_the_same_to_rounding_with_another_blas(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """On a plant with every fault, whose noise hangs on no last bit; a study begun there goes on here, and says so."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    for name in ("here", "other", "begun"):
        create_study(store, spec_of(PLANTS["dry friction and every fault"], "cmaes"), name)
    run_with_other_kernels(store)
    run_study(store, "here")
    assert not caplog.messages
    run_study(store, "begun")
    (warning,) = caplog.messages
    assert "begun with other arithmetic" in warning
    here, *others = (results.trials_frame(store, name) for name in ("here", "other", "begun"))
    for other in others:
        assert (here["state"] == other["state"]).all()
        numbers = here.columns.drop("state")
        assert np.allclose(here[numbers], other[numbers], rtol=1e-9, atol=1e-9)


def test_trials_of_other_arithmetic_that_do_not_follow_are_refused_with_the_reason(tmp_path: Path) -> None:
    """One line that says what they were begun with."""
    store = Store(str(tmp_path / "metaid.db"), create=True)
    create_study(store, spec_of(PLANTS["two-link"], "cmaes"), "study")
    run_study(store, "study", trials=12)
    store.set_attribute("study", ARITHMETIC_KEY, "abacus, openblas 1.0 Wood")
    with sqlite3.connect(tmp_path / "metaid.db") as connection:
        connection.execute("UPDATE trial_params SET param_value = param_value + 0.001")
    with pytest.raises(StorageError, match=r"begun with other arithmetic \(abacus, openblas 1.0 Wood; this is"):
        run_study(store, "study")
