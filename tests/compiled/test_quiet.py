"""MuJoCo's timer and warnings are the process's own: taken out while a loop runs, and put back."""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from conftest import random_plant

from metaid.compiled import FaultyLoop, Objective, fastest_step, quiet_mujoco
from metaid.compiled.undocumented import LIBRARY
from metaid.episode import Episode, rich_pushes

NAMES = ("mjcb_time", "mju_user_warning")


def callbacks() -> list[int | None]:
    """What MuJoCo calls now: the addresses of its timer and of its handler of warnings."""
    library = ctypes.CDLL(str(LIBRARY))
    return [ctypes.c_void_p.in_dll(library, name).value for name in NAMES]


@pytest.fixture
def own() -> Iterator[list[float]]:
    """A timer that a user has set, and the calls of it."""
    calls: list[float] = []

    def timer() -> float:
        calls.append(0.0)
        return 0.0

    mujoco.set_mjcb_time(timer)
    yield calls
    mujoco.set_mjcb_time(None)


def test_callbacks_are_those_of_before_after_every_loop(own: list[float]) -> None:
    """The compiled loops, and the episode that is watched step by step: none calls the user's timer, nor keeps ours."""
    plant = random_plant(2)
    before = callbacks()
    episode = Episode(rich_pushes(plant, 2, 4.0, seed=1), 20)
    own.clear()  # MuJoCo has measured how long it took to build the model
    objective = Objective(plant, plant.chain.lumps, episode, "spectral")
    objective.evaluate(np.ones(3))
    batch = objective.share(np.ones((3, 3)), range(3))
    objective.work_on(batch)
    objective.watch(np.ones(3))
    FaultyLoop(plant, episode, fastest_step(plant)).run(plant.chain.lumps)
    assert own == []
    assert callbacks() == before
    mujoco.mj_step(plant.model, plant.data)
    assert own != []


def test_callbacks_are_taken_out_until_the_last_of_several_threads_has_left() -> None:
    """The first to leave does not put back what another still does without."""
    before, inside, leave = callbacks(), threading.Barrier(2, timeout=60), threading.Event()

    def loop() -> None:
        with quiet_mujoco():
            inside.wait()
            leave.wait(60)

    other = threading.Thread(target=loop)
    other.start()
    with quiet_mujoco():
        inside.wait()
        quiet = callbacks()
    assert callbacks() == quiet
    leave.set()
    other.join()
    assert callbacks() == before
    assert all(ours != theirs for ours, theirs in zip(quiet, before, strict=True))


def test_callback_that_somebody_sets_meanwhile_stays() -> None:
    """It is newer than what was there before."""
    before = mujoco.get_mjcb_time()
    with quiet_mujoco():
        mujoco.set_mjcb_time(lambda: 1.0)
        newer = callbacks()[0]
    assert callbacks()[0] == newer
    mujoco.set_mjcb_time(before)


@pytest.fixture
def interrupts() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt, whatever a command that ran before in this process has set."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interrupts")
def test_ctrl_c_in_a_loop_puts_the_callbacks_back() -> None:
    """The interrupt comes while ours are in place."""
    before = callbacks()
    with pytest.raises(KeyboardInterrupt), quiet_mujoco():  # noqa: PT012
        assert callbacks() != before
        signal.raise_signal(signal.SIGINT)
    assert callbacks() == before
