"""Where an estimate explains nothing, faults that would explain it are proposed."""

from __future__ import annotations

import re
from typing import Any

import pytest
from watched import GRAVITY, NOISE, raised, watched

from metaid.estimation import LogUnknowns, Readings, fit
from metaid.estimation.noisy import proposed_faults
from metaid.plant import FaultSettings

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("faults", "joints", "declared", "said"),
    [
        ({"delay": 4}, {}, 0.0, 'a delay of 8 ms the misfit falls from .* set .estimate. faults = ."delay".'),
        ({"delay": 4}, {}, 0.004, "a delay of 12 ms"),
        ({"tilt": 0.02}, {}, 0.0, 'a tilt of 20 mrad .* = ."tilt".'),
        ({}, {"damping": 0.02}, 0.0, 'viscous friction of up to 0.02 N m s .* = ."viscous".'),
    ],
)
def test_faults_that_explain_the_misfit_are_proposed(
    faults: dict[str, Any], joints: dict[str, float], declared: float, said: str
) -> None:
    """With their sizes, what is declared already included."""
    seen = watched(2, 1, faults=FaultSettings(angle_noise=NOISE, speed_sensor=False, **faults), longer=2.0, **joints)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    readings = Readings([seen.read_trial(raised(seen.nominal.lumps, each)) for each in (1.2, 1.5)], unknowns)
    estimate = fit(readings, restarts=0)
    assert not estimate.is_explained
    proposal = proposed_faults(readings, estimate, declared)
    assert proposal is not None
    assert proposal.after < 1.3 < proposal.before
    assert re.search(said, proposal.description)


@pytest.mark.parametrize(
    ("faults", "kinds"),
    [({"torque_limit": 1.0}, ("limit",)), ({"torque_noise": 0.5}, None)],
    ids=["cut off", "noisy"],
)
def test_of_one_link_what_explains_the_misfit_is_proposed_and_nothing_else(
    faults: dict[str, Any], kinds: tuple[str, ...] | None
) -> None:
    """Torques that are cut off at half of what is asked are, and no fault is where they are noisy."""
    seen = watched(1, 5, faults=FaultSettings(angle_noise=NOISE, speed_sensor=False, **faults))
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    readings = Readings([seen.read_trial(raised(seen.nominal.lumps, 1.5))], unknowns)
    estimate = fit(readings, restarts=0)
    assert not estimate.is_explained
    proposal = proposed_faults(readings, estimate, 0.0)
    assert (None if proposal is None else proposal.kinds) == kinds
