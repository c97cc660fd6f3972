"""Forces that the model has not are found in what an estimate leaves of the readings, though it may explain them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from watched import GRAVITY, NOISE, TIMESTEP, Watched, raised, watched

from metaid.estimation import Estimate, LogUnknowns, Readings, Unmodelled, fit, searched_faults
from metaid.estimation.noisy import unmodelled_forces
from metaid.models import Array
from metaid.plant import FaultSettings

NOISY = FaultSettings(angle_noise=NOISE, speed_sensor=False)
DIFFERING = FaultSettings(angle_noise=NOISE, speed_sensor=False, push_noise=0.02)
LAWS = (1.2, 1.5, 2.0)  # factors of the nominal gravity lumps


def left_of(seen: Watched, kinds: tuple[str, ...] = ("gravity", "coriolis", "inertia")) -> tuple[Estimate, Array]:
    """The estimate from a trial of each of LAWS, and its errors (nunknown)."""
    unknowns = LogUnknowns(seen.nominal.lumps_of(kinds), GRAVITY, kinds)
    estimate = fit(readings_of(seen, unknowns), restarts=0)
    return estimate, estimate.unknowns - unknowns.log_factors(seen.plant.chain.lumps_of(kinds))


def readings_of(seen: Watched, unknowns: LogUnknowns) -> Readings:
    """What the sensors read in a trial of each of LAWS."""
    laws = [raised(seen.nominal.lumps, factor) for factor in LAWS]
    return Readings([seen.read_trial(law) for law in laws], unknowns)


def strongest(seen: Watched) -> Unmodelled | None:
    """What is found in the readings of a trial of each of LAWS."""
    readings = readings_of(seen, LogUnknowns(seen.nominal.lumps, GRAVITY))
    seen = [force for force in unmodelled_forces(readings, fit(readings, restarts=0)) if force.is_seen]
    return min(seen, key=lambda force: force.left, default=None)


def test_spring_that_a_wrong_gravity_lump_makes_up_for_is_found() -> None:
    """One link: the misfit passes for noise while the lump is off by hundreds of its deviations."""
    seen = watched(1, 7, faults=DIFFERING, longer=2.0, springs=(0.2,))
    estimate, error = left_of(seen)
    assert estimate.is_explained
    assert abs(error[0]) > 100.0 * estimate.deviations[0]
    force = strongest(seen)
    assert force is not None
    assert force.kind == "spring"
    assert force.sizes[0] == pytest.approx(0.2, rel=0.3)
    assert abs(error[0] + force.shift[0]) < 0.3 * abs(error[0]), "it would bring the lump back"


def test_spring_that_short_pushes_do_not_show_is_named() -> None:
    """Gravity of one link is right only without it, for the readings may hide as much as there is."""
    seen = watched(1, 1, faults=DIFFERING, springs=(0.2,))
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    readings = readings_of(seen, unknowns)
    spring = next(force for force in unmodelled_forces(readings, fit(readings, restarts=0)) if force.kind == "spring")
    assert not spring.is_seen
    assert 3.0 * spring.deviations[0] > 0.2
    assert np.abs(spring.reach[0]) > np.abs(left_of(seen)[1][0]) > 0.1


def test_friction_and_late_torques_are_found() -> None:
    """Each by its own name, of the size that it has."""
    rubbing = strongest(watched(1, 1, damping=0.005, faults=DIFFERING, longer=2.0))
    assert rubbing is not None
    assert rubbing.kind == "damping"
    assert rubbing.sizes[0] == pytest.approx(0.005, rel=0.2)
    late = strongest(watched(1, 1, faults=FaultSettings(angle_noise=NOISE, delay=2)))
    assert late is not None
    assert late.kind == "delay"
    assert late.sizes[0] == pytest.approx(2 * TIMESTEP, rel=0.2)


@pytest.mark.parametrize("nlink", [1, 2, 3])
@pytest.mark.parametrize("faults", [NOISY, DIFFERING])
def test_clean_chain_shows_no_other_force(nlink: int, faults: FaultSettings) -> None:
    """What noise leaves looks like none."""
    assert all(strongest(watched(nlink, seed, faults=faults)) is None for seed in range(4))


def test_friction_that_is_searched_is_not_looked_for() -> None:
    """It is no force that the model has not."""
    seen = watched(2, 3, damping=0.02, faults=NOISY)
    kinds = ("gravity", "coriolis", "inertia", "damping")
    unknowns = LogUnknowns(replace(seen.nominal.lumps_of(kinds[:3]), damping=np.full(2, 0.01)), GRAVITY, kinds)
    readings = readings_of(seen, unknowns)
    forces = list(unmodelled_forces(readings, fit(readings, restarts=0)))
    assert [force.kind for force in forces] == ["spring", "coulomb", "delay"]
    assert not any(force.is_seen for force in forces)


def test_length_that_is_wrong_is_found_where_it_is_said_to_be_exact() -> None:
    """It is 5 mm off, and what it changes of the lumps is told."""
    seen = watched(2, 3, faults=DIFFERING, longer=2.0)
    lengths = seen.plant.chain.length + np.array([0.005, 0.0])
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY, lengths=lengths)
    readings = readings_of(seen, unknowns)
    estimate = fit(readings, restarts=0)
    wrong = next(each for each in unmodelled_forces(readings, estimate) if each.kind == "geometry")
    error = estimate.unknowns - unknowns.log_factors(seen.plant.chain.lumps)
    assert wrong.is_seen
    assert wrong.sizes == pytest.approx([1.0], rel=0.1), "of 5 mm"
    assert np.abs(error + wrong.shift).max() < 0.3 * np.abs(error).max()
    right = readings_of(seen, LogUnknowns(seen.nominal.lumps, GRAVITY, lengths=seen.plant.chain.length))
    assert not any(force.is_hinted for force in unmodelled_forces(right, fit(right, restarts=0)))


def test_nothing_is_looked_for_where_every_force_is_searched() -> None:
    """There is nothing left that the model could lack."""
    seen = watched(1, 3, faults=NOISY)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    every = searched_faults(("delay", "viscous", "dry", "spring"), unknowns, seen.starts)
    readings = Readings([seen.read_trial(raised(seen.nominal.lumps, 1.5))], unknowns, faults=every)
    assert list(unmodelled_forces(readings, fit(readings, restarts=0))) == []
