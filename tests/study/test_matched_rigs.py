"""What all trials on a rig say: its readings are matched with their noise, as they were measured when the study was
created.
"""

from __future__ import annotations

import re
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from places import ROOT

from metaid import results
from metaid.episode import SensorReadings
from metaid.plant import PlantSettings, chain_of
from metaid.store import Store
from metaid.study import create_study, load_study, problem_of, run_study, stepping
from soak.lies import PLANT, Liar
from soak.rigs import NOISE, STEPS, created

pytestmark = pytest.mark.slow

KINDS = ("gravity", "coriolis", "inertia")
TRUTH = chain_of(PlantSettings.model_validate(PLANT).links).lumps_of(KINDS).vector_of(KINDS)
DOCUMENT = ROOT / "docs" / "your-rig.md"


def within(lumps: pd.DataFrame) -> bool:
    """Whether every interval holds the truth."""
    return bool(((lumps["low"] <= TRUTH) & (lumps["high"] >= TRUTH)).all())


def matched(liar: Liar, seed: int = 0, motion: str = "stepped", **changes: Any) -> tuple[pd.DataFrame, dict[str, Any]]:
    """The lumps by the estimate from the trials on a rig, and the summary of the study."""
    with created(liar, seed, motion), closing(Store("matched.db", create=True)) as store:
        settings = {"sampler": "output-error", "trials": 2, "seed": seed, "search.low": 0.5, "search.high": 2.0}
        create_study(store, load_study("study.toml", {**settings, **changes}), "study")
        run_study(store, "study")
        return results.estimate_frame(results.read_snapshot(store, "study")), results.summary(store, "study")


def test_trials_of_cmaes_on_the_example_rig_hold_the_truth() -> None:
    """Its best trial was 5 % off after 60 trials, with a range of zero width. The estimate from such trials is not."""
    lumps, _ = matched(Liar(STEPS), sampler="cmaes", trials=5)
    assert within(lumps)


@pytest.mark.parametrize("motion", ["stepped", "continuous"])
def test_lumps_of_a_noisy_rig_are_found_with_intervals_that_mean_something(motion: str) -> None:
    """1 mrad of noise, pushes that differ by 2 %: two trials, lumps within half a percent, and the errors are of the
    size of their standard deviations.
    """
    lumps, shown = matched(Liar(STEPS, **NOISE["noisy"], seed=1, is_continuous=motion == "continuous"), 1, motion)
    errors = lumps["identified"].to_numpy() / TRUTH - 1.0
    assert shown["estimate"]["explains"]
    assert 0.5 < shown["misfit"] < 2.0
    assert np.abs(errors).max() < 5e-3
    assert np.abs(errors / (lumps["sd"] / lumps["identified"]).to_numpy()).max() < 3.0


def test_rig_that_moves_continuously_is_not_to_be_taken_for_one_that_moves_in_steps() -> None:
    """Where no fault is searched that may stand for it, the gravity lumps would be wrong by twenty standard deviations,
    or not be found.
    """
    liar = Liar(STEPS, **NOISE["noisy"], seed=1, is_continuous=True)
    lumps, shown = matched(liar, 1, "stepped", **{"estimate.faults": []})
    wrong = np.abs(lumps["identified"].to_numpy() / TRUTH - 1.0)[:2]
    assert not shown["estimate"]["explains"] or wrong.min() > 4e-3


def test_rig_without_noise_is_taken_to_have_a_tenth_of_a_milliradian() -> None:
    """So the misfit of one that moves continuously, which no twin follows to the last digit, is still meaningful."""
    lumps, shown = matched(Liar(STEPS, is_continuous=True), 0, "continuous")
    assert shown["misfit"] < 1.0
    assert np.abs(lumps["identified"].to_numpy() / TRUTH - 1.0).max() < 5e-4


@pytest.mark.parametrize(("timestep", "most"), [(0.002, 1e-3), (0.016, 0.1)])
def test_steps_of_the_twin_of_any_rig_that_is_accepted_err_by_a_tenth_of_its_noise(
    tmp_path: Path, timestep: float, most: float
) -> None:
    """By halving them, on the nominal model; the second is the longest timestep that these links are given."""
    for block in re.findall(r"^```toml\n(.*?)^```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE):
        text = block.replace("timestep = 0.002", f"timestep = {timestep}")
        (tmp_path / block.partition("\n")[0].removeprefix("# ")).write_text(text)
    found = stepping(problem_of(load_study(tmp_path / "find-rig.toml")))
    assert found is not None
    assert 0.0 < found.error < most
    assert found.is_precise


@pytest.mark.parametrize("step", [0.0, 1e-3, 0.01])
def test_resolution_of_an_encoder_is_seen_in_its_readings(step: float) -> None:
    """Not where a joint coasts evenly, whose readings change by the same all the time."""
    times = np.arange(100)[:, None]
    angles = np.stack([0.47 * np.sin(0.01 * times + [[0.0, 0.3]]), 0.003 * times * [[1.0, -2.0]]])
    read = np.round(angles / step) * step if step else angles
    found = SensorReadings(np.array([100, 100]), read).encoder_steps
    assert found == pytest.approx([step, step], rel=1e-6)
