"""The twin moves as MuJoCo does, and its derivatives are those of the motion."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from watched import GRAVITY, raised, watched

from metaid.compiled import share_out, sharing
from metaid.estimation import LogUnknowns
from metaid.estimation.twin import PlanarTwin, Shown
from metaid.models import Array

ALL = ("gravity", "coriolis", "damping", "coulomb", "inertia")
SMOOTH = ("gravity", "coriolis", "damping", "inertia")
SHIFT = 1e-5


@pytest.mark.parametrize("stiffness", [0.0, 80.0])
@pytest.mark.parametrize("nlink", [1, 2, 3, 5])
def test_the_twin_of_the_true_chain_moves_as_mujoco_does(nlink: int, stiffness: float) -> None:
    """Angles, speeds and both energies agree to rounding at the end of every window, friction included."""
    seen = watched(nlink, damping=0.02, stiffness=stiffness)
    trial = seen.trial(raised(seen.nominal.lumps, 1.3))
    true = seen.plant.chain.lumps_of(("gravity", "coriolis", "damping"))
    unknowns = LogUnknowns(true, GRAVITY, ("gravity", "coriolis", "damping", "inertia"))
    chain = PlanarTwin(unknowns, np.zeros(len(unknowns.names)))
    motion, (angles, is_shown) = chain.watch(trial, len(trial.ends), energies=True), chain.trace(trial, trial.ends)
    assert is_shown.all()
    assert np.allclose(angles, trial.windows.angles, rtol=1e-9, atol=1e-10)
    for name in ("speeds", "speed_energy", "acceleration_energy"):
        assert np.allclose(getattr(motion, name), getattr(trial.windows, name), rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("stiffness", [0.0, 80.0])
@pytest.mark.parametrize("exact_lengths", [False, True])
@pytest.mark.parametrize("nlink", [1, 2, 3, 6])
def test_derivatives_are_those_of_finite_differences(nlink: int, exact_lengths: bool, stiffness: float) -> None:
    """By every unknown of every kind, for the speeds and both energies."""
    dry = nlink <= 3  # a difference across the corner of dry friction is no derivative, and many joints meet some
    seen = watched(nlink, stiffness=stiffness)
    trial = seen.trial(raised(seen.nominal.lumps, 1.3))
    some = np.linspace(0.01, 0.03, nlink)
    nominal = replace(seen.nominal.lumps, damping=some, coulomb=2.0 * some if dry else None)
    unknowns = LogUnknowns(nominal, GRAVITY, ALL if dry else SMOOTH, seen.nominal.length if exact_lengths else None)
    point = 0.02 * np.random.default_rng(1).standard_normal(len(unknowns.names))

    def motion(at: Array) -> Shown:
        return PlanarTwin(unknowns, at).watch(trial, len(trial.ends), energies=True)

    here = motion(point)
    for column in range(len(point)):
        shift = SHIFT * np.eye(len(point))[column]
        ahead, behind = motion(point + shift), motion(point - shift)
        for name, slopes in (
            ("speeds", here.speed_slopes),
            ("speed_energy", here.speed_energy_slopes),
            ("acceleration_energy", here.acceleration_energy_slopes),
        ):
            difference = (getattr(ahead, name) - getattr(behind, name)) / (2.0 * SHIFT)
            assert np.allclose(slopes[..., column], difference, rtol=1e-4, atol=1e-5 * np.abs(slopes).max())


def test_a_chain_that_no_bodies_make_is_not_followed() -> None:
    """Coriolis lumps so large that the mass matrix is indefinite: no window is reached, and nothing is made up."""
    seen = watched(2)
    trial = seen.trial(seen.nominal.lumps)
    unknowns = LogUnknowns(seen.nominal.lumps, GRAVITY)
    motion = PlanarTwin(unknowns, np.array([0.0, 0.0, 2.0, 0.0, 0.0])).watch(trial, len(trial.ends))
    assert not motion.reached.any()


def test_threads_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """One and two threads give the same motion and derivatives, to the last bit."""
    seen = watched(5)
    trial, unknowns = seen.trial(seen.nominal.lumps), LogUnknowns(seen.nominal.lumps, GRAVITY)
    motions = []
    for threads in (1, 2):
        monkeypatch.setattr(sharing, "threads_at_hand", lambda threads=threads: threads)
        motions.append(PlanarTwin(unknowns, np.zeros(len(unknowns.names))).watch(trial, len(trial.ends)))
    assert np.array_equal(motions[0].speeds, motions[1].speeds)
    assert np.array_equal(motions[0].speed_slopes, motions[1].speed_slopes)


def exhaust(numbers: Iterator[int]) -> None:
    for _ in numbers:
        pass


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a process that begins with nothing inherits nothing")
def test_forked_process_does_not_wait_for_threads_that_it_has_not() -> None:
    """The threads of the twin are the parent's, and stay there."""
    share_out(exhaust, 4, 10**9)
    child = os.fork()
    if child == 0:
        share_out(exhaust, 4, 10**9)
        os._exit(0)
    ended = time.monotonic() + 30.0
    while (done := os.waitpid(child, os.WNOHANG)) == (0, 0) and time.monotonic() < ended:
        time.sleep(0.01)
    if done == (0, 0):
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert done == (child, 0)
