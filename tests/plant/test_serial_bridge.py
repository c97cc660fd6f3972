"""The example that makes a rig of a microcontroller on a serial port, through a pseudo-terminal."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import closing

import numpy as np
import pytest
from places import ROOT
from rig import rig_at

from metaid.errors import LostPlant
from metaid.plant import SocketPlant, Start

COUNTS, ZERO, AMPERES, MOST, TIMESTEP = 4096, 100, 2.0, 3.0, 0.005
SPEED = 1000.0  # counts/s of a joint for an impulse of 1 N s


class Board(threading.Thread):
    """A microcontroller of two joints that coast, at the other end of a pseudo-terminal: what it was told, and the
    amperes in its motors. It says nothing to steps while it is `silent`.
    """

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.end, self.other = os.openpty()
        tty.setraw(self.other)
        self.port = os.ttyname(self.other)
        self.told: list[str] = []
        self.amperes = [0.0, 0.0]
        self.silent = False
        self.tick, self.speeds = 0, [0.0, 0.0]

    def run(self) -> None:
        heard = b""
        while True:
            try:
                heard += os.read(self.end, 1024)
            except OSError:
                return
            *whole, heard = heard.split(b"\n")
            for line in whole:
                self.told.append(line.decode())
                if answer := self.answer(*line.decode().split()):
                    os.write(self.end, answer.encode() + b"\n")

    def close(self) -> None:
        """Hangs up, and waits for the thread: else it reads on, what the next board is told behind the same number."""
        os.close(self.other)
        self.join(60.0)
        os.close(self.end)

    def answer(self, word: str, *numbers: str) -> str:
        """As the firmware of docs/microcontroller.md."""
        self.amperes = [float(each) for each in numbers] if word == "s" else [0.0, 0.0]
        if word == "x":
            return "x"
        if word == "p":
            self.tick, self.speeds = 0, [SPEED * float(each) for each in numbers]
        else:
            self.tick += 1
        counts = [round(ZERO + each * self.tick * TIMESTEP) for each in self.speeds]
        state = [self.tick, round(1e6 * self.tick * TIMESTEP), *counts, *map(round, self.speeds)]
        return "" if self.silent and word == "s" else " ".join(map(str, state))


def until(happens: Callable[[], bool]) -> bool:
    """Whether something happens within a minute."""
    ends = time.monotonic() + 60.0
    while not happens() and time.monotonic() < ends:
        time.sleep(0.01)
    return happens()


@pytest.fixture
def board() -> Iterator[Board]:
    board = Board()
    board.start()
    yield board
    board.close()


@pytest.fixture
def bridged(board: Board) -> Iterator[Callable[..., SocketPlant]]:
    """What starts the bridge to the board with more arguments, and calls it as metaid does."""
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: str) -> SocketPlant:
        alike = {"--counts": COUNTS, "--amperes": AMPERES, "--most": MOST, "--zero": ZERO}
        each = [str(part) for name, value in alike.items() for part in (name, value, value)]
        program = [sys.executable, str(ROOT / "examples" / "serial_bridge.py"), board.port, "--joints", "2", *each]
        bridge = subprocess.Popen([*program, "--listen", "0", *arguments], stdout=subprocess.PIPE, text=True)
        started.append(bridge)
        assert bridge.stdout is not None
        said = bridge.stdout.readline()
        assert "torque_limit = [1.5, 1.5]" in said
        return rig_at(said.split()[2].rstrip(";"), timestep=TIMESTEP)

    yield start
    for bridge in started:
        with bridge:
            bridge.kill()


def test_board_is_a_rig_in_rad_and_newton_metres(board: Board, bridged: Callable[..., SocketPlant]) -> None:
    """Counts become angles and speeds of the joints, torques amperes, and no motor gets more than it may have."""
    with closing(bridged("--watchdog", "60")) as rig:
        rig.push(Start.upright(np.array([0.5, -0.25])))
        assert rig.states()[0] == pytest.approx([0.0, 0.0])
        assert rig.states()[1] == pytest.approx([math.tau * 500 / COUNTS, -math.tau * 250 / COUNTS])
        rig.apply_torque(np.array([0.6, -9.0]))
        rig.step()
        assert board.amperes == [1.2, -3.0]
        rig.apply_torque(np.array([1e-5, 0.0]))
        rig.step()
        assert board.told[-1] == "s 0.000020 0.000000"  # Arduino's parseFloat takes 2e-05 for 2
        assert rig.states()[0] == pytest.approx([math.tau * 5 / COUNTS, -math.tau * 2 / COUNTS])
        assert rig.times == pytest.approx([0.0, 0.005, 0.01])
    assert until(lambda: board.amperes == [0.0, 0.0])
    assert board.told[-1] == "x"


def test_current_goes_off_where_nobody_commands(board: Board, bridged: Callable[..., SocketPlant]) -> None:
    """The watchdog of the bridge; the next step finds that the rig has stopped."""
    with closing(bridged("--watchdog", "0.05")) as rig:
        rig.push(Start.upright(np.array([0.1, 0.0])))
        assert until(lambda: board.told[-1] == "x")
        with pytest.raises(LostPlant, match="has stopped"):
            rig.step()


def test_board_that_says_nothing_costs_the_episode(board: Board, bridged: Callable[..., SocketPlant]) -> None:
    """The bridge says why, and takes the current off."""
    with closing(bridged("--watchdog", "0.2")) as rig:
        rig.push(Start.upright(np.array([0.1, 0.0])))
        board.silent = True
        with pytest.raises(LostPlant, match="did not answer 's'"):
            rig.step()
    assert board.told[-1] == "x"


def test_joint_past_its_limit_stops_the_rig(board: Board, bridged: Callable[..., SocketPlant]) -> None:
    """Whatever the study allows: metaid sees a fall."""
    with closing(bridged("--watchdog", "60", "--limit", "2")) as rig:
        rig.push(Start.upright(np.array([5.0, 0.0])))
        rig.step()
        assert np.isnan(rig.states()[0]).all()
    assert board.told[-1] == "x"
