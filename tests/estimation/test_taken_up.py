"""Faults that an estimate takes up by itself, and what speaks against that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from watched import GRAVITY, NOISE, Watched, raised, watched

from metaid.estimation import Estimate, Readings, SearchedFaults, Unknowns, fit, searched_faults
from metaid.estimation.noisy import take_up
from metaid.estimation.noisy.taken_up import TakenUp
from metaid.plant import FaultSettings

LAWS = (1.2, 1.5)


@pytest.fixture(scope="module")
def late() -> Watched:
    """Two links whose torques come 8 ms late."""
    return watched(2, 1, faults=FaultSettings(angle_noise=NOISE, speed_sensor=False, delay=4), longer=2.0)


def taken_up(seen: Watched, readings: Readings) -> tuple[Estimate, TakenUp | None]:
    """What is taken up, begun from the estimate with a delay that a study has got to."""

    def search(kinds: tuple[str, ...]) -> SearchedFaults:
        return searched_faults(kinds, readings.unknowns.nominal, GRAVITY, seen.starts)

    first = replace(readings, trials=readings.trials[:1], faults=search(("delay",)))
    return take_up(readings, fit(first, restarts=0), search)


def test_fault_that_foretells_the_last_trial_holds(late: Watched) -> None:
    """Its misfit there is that of noise, and the lumps are the true ones."""
    unknowns = Unknowns(late.nominal.lumps)
    trials = [late.read_trial(raised(late.nominal.lumps, law)) for law in LAWS]
    estimate, taken = taken_up(late, Readings(trials, unknowns, GRAVITY))
    error = estimate.log_factors - unknowns.log_factors(late.plant.chain.lumps)
    assert taken is not None
    assert taken.holds
    assert taken.kinds == ("delay",)
    assert 0.5 < taken.foretold < taken.foretold_below
    assert (np.abs(error) < 4.0 * estimate.deviations + 1e-6).all()


def test_no_fault_is_taken_up_that_a_later_trial_refutes(late: Watched) -> None:
    """Where torques of the second trial were cut, nothing explains both."""
    unknowns = Unknowns(late.nominal.lumps)
    trials = [late.read_trial(raised(late.nominal.lumps, law)) for law in LAWS]
    cut = replace(trials[1], torques=1.1 * trials[1].torques)
    estimate, taken = taken_up(late, Readings([trials[0], cut], unknowns, GRAVITY))
    assert taken is None
    assert not estimate.is_explained
    assert estimate.faults is None


@pytest.mark.parametrize(
    ("foretold", "rivals", "said"),
    [
        (1.0, (), "a delay of 8 ms was taken up: without it the misfit is 41, with it 1.1"),
        (4.0, (), "but not pushes that were held out: their misfit is 4 .foretold: below 1.3."),
        (
            1.0,
            ("a tilt of 9 mrad",),
            "several faults explain what was seen: a delay of 8 ms, or a tilt of 9 mrad: name",
        ),
    ],
)
def test_fault_with_a_rival_or_a_wrong_forecast_does_not_hold(
    foretold: float, rivals: tuple[str, ...], said: str
) -> None:
    """It says which."""
    taken = TakenUp(("delay",), ("8 ms",), 41.0, 1.1, foretold, 1.3, rivals)
    assert taken.holds == (said.startswith("a delay"))
    assert np.char.find(taken.description, said.split(".")[0]) >= 0
