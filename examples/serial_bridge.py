#!/usr/bin/env python3
"""A bridge between metaid's socket protocol and a microcontroller on a serial port (docs/microcontroller.md).

It needs Python and pyserial, and nothing of metaid. The board knows counts of encoders and amperes; the bridge turns
these into rad and N m, and has a watchdog and limits of its own. The board is told one line of text at a time, and
answers with one; docs/microcontroller.md has the firmware:

    p -0.2 0.1    upright, then an impulse of each joint; answers with the state of tick 0
    s 1.31 -0.4   amperes from the next tick on; answers with the state of that tick
    x             current off; answers x

A state is `TICK MICROSECONDS COUNTS … COUNTS_PER_S …`, counts and speeds of each joint.

    python examples/serial_bridge.py /dev/ttyACM0 --joints 2 --counts 8192 8192 --amperes 5.2 5.2 --most 6 6
"""

from __future__ import annotations

import argparse
import json
import math
import socket
from collections.abc import Iterator
from typing import Any

import serial

PROTOCOL = 1
IDLE = 60.0  # s without a word, nothing moving
REST_OF_PUSH = 55.0  # s that the board may take to be upright; metaid waits for 60


class Board:
    """The microcontroller behind a serial port; numbers are in its units."""

    def __init__(self, port: str, baud: int, patience: float) -> None:
        self.line = serial.Serial(port, baud, timeout=patience, write_timeout=patience)
        self.patience = patience
        self.say("x")

    def say(self, *words: object, patience: float | None = None) -> list[str]:
        """The words of what a line is answered with.  Raises OSError where nothing comes in time."""
        self.line.timeout = patience or self.patience
        self.line.reset_input_buffer()  # an answer that came too late is none to this
        self.line.write(" ".join(map(str, words)).encode() + b"\n")
        answer = self.line.read_until(b"\n")
        if not answer.endswith(b"\n"):
            raise OSError(f"the board did not answer '{words[0]}' within {self.line.timeout:g} s")
        return answer.decode("ascii", "replace").split()


class Bridge:
    """Answers metaid's messages by what the board says. Of each joint: `counts` per turn, the `zero` that is read
    upright, `amperes` per N m, and the `most` amperes that its motor may have. `limit` (rad): no joint may pass it.
    """

    def __init__(self, board: Board, given: argparse.Namespace) -> None:
        self.board, self.given = board, given
        self.joints: int = given.joints
        self.limit = math.radians(given.limit)
        self.about = {"metaid": PROTOCOL, "joints": given.joints, "timestep": given.timestep, "gravity": given.gravity}
        self.moving = False

    def answer(self, message: dict[str, Any]) -> dict[str, Any]:
        """What is said to a message, after doing what it asks."""
        asked = message.get("do")
        if asked == "hello":
            return self.about
        if asked == "ping":
            return {"pong": True}
        if asked == "push":
            impulses = self.numbers(message, "impulses")
            state = self.state(self.board.say("p", *written(impulses), patience=REST_OF_PUSH))
            self.moving = "stopped" not in state
            return state
        if asked == "step":
            if not self.moving:
                return {"error": "it was not pushed, or has stopped"}
            return self.state(self.board.say("s", *written(self.currents(message))))
        if asked == "stop":
            self.stop()
            return {"stopped": "asked to"}
        return {"error": f"unknown message {asked!r} (allowed: hello, ping, push, step, stop)"}

    def numbers(self, message: dict[str, Any], key: str) -> list[float]:
        """A finite number for each joint: nothing else may reach a motor."""
        values = [float(each) for each in message.get(key, [])]
        if len(values) != self.joints or not all(map(math.isfinite, values)):
            raise ValueError(f"{message['do']} needs {self.joints} finite numbers as '{key}'")
        return values

    def currents(self, message: dict[str, Any]) -> list[float]:
        """Amperes for the torques that are asked for, at most what each motor may have."""
        pairs = zip(self.numbers(message, "torque"), self.given.amperes, self.given.most, strict=True)
        return [max(-most, min(most, torque * amperes)) for torque, amperes, most in pairs]

    def state(self, words: list[str]) -> dict[str, Any]:
        """The answer to a push or a step, of a line of the board's; the torque goes off past the limit."""
        n = self.joints
        if len(words) != 2 + 2 * n:
            raise OSError(f"the board said {' '.join(words)[:80]!r} (allowed: TICK MICROSECONDS, {2 * n} numbers)")
        turns = [2.0 * math.pi / each for each in self.given.counts]
        numbers = [float(each) for each in words]
        angles = [turn * (each - zero) for turn, each, zero in zip(turns, numbers[2:], self.given.zero, strict=False)]
        speeds = [turn * each for turn, each in zip(turns, numbers[2 + n :], strict=True)]
        shown = {"tick": int(words[0]), "angles": angles, "speeds": speeds, "time": 1e-6 * numbers[1]}
        if max(map(abs, angles)) > self.limit:
            self.stop()
            return {**shown, "stopped": f"a joint is past {self.given.limit:g}°"}
        return shown

    def stop(self) -> None:
        """Current off, and said again where the board does not confirm it: its own watchdog is what counts then."""
        self.moving = False
        for _ in range(3):
            try:
                if self.board.say("x") == ["x"]:
                    return
            except OSError as problem:
                print(f"current off: {problem}", flush=True)


def written(numbers: list[float]) -> list[str]:
    """As a board reads them: Arduino's parseFloat takes 1e-05 for 1."""
    return [f"{each:.6f}" for each in numbers]


def talk(bridge: Bridge, connection: socket.socket) -> None:
    """Answers messages until the connection ends, for whatever reason; then the current is off."""
    try:
        for line in lines(bridge, connection):
            try:
                answer = bridge.answer(json.loads(line))
            except (ValueError, TypeError, AttributeError) as problem:
                answer = {"error": f"bad message: {problem}"}
            except OSError as problem:  # of the serial port
                bridge.stop()
                answer = {"error": str(problem)}
            connection.sendall(json.dumps(answer).encode() + b"\n")
    except OSError:
        return
    finally:
        bridge.stop()


def lines(bridge: Bridge, connection: socket.socket) -> Iterator[bytes]:
    """Messages as they come. The watchdog: the current goes off if something moves and none comes in time."""
    received = b""
    while True:
        connection.settimeout(bridge.given.watchdog if bridge.moving else IDLE)
        try:
            part = connection.recv(4096)
        except TimeoutError:
            if not bridge.moving:
                return
            bridge.stop()
            print(f"current off: no command for {bridge.given.watchdog:g} s", flush=True)
            continue
        if not part or len(received) > 1 << 16:
            return
        received += part
        while b"\n" in received:
            line, _, received = received.partition(b"\n")
            yield line


def arguments() -> argparse.Namespace:
    """What is typed, with a number for each joint where there are several."""
    parser = argparse.ArgumentParser(description="A microcontroller on a serial port as a rig of metaid's.")
    parser.add_argument("port", help="as /dev/ttyACM0, or COM3")
    parser.add_argument("--joints", type=int, required=True)
    parser.add_argument("--counts", type=float, nargs="+", required=True, help="of an encoder, per turn of the joint")
    parser.add_argument(
        "--amperes", type=float, nargs="+", required=True, help="that a torque of 1 N m at the joint needs"
    )
    parser.add_argument("--most", type=float, nargs="+", required=True, help="A, that each motor may have")
    parser.add_argument("--zero", type=float, nargs="+", help="counts that are read upright (default: 0)")
    parser.add_argument("--timestep", type=float, default=0.005, help="s, of the board's ticks")
    parser.add_argument("--gravity", type=float, default=9.81, help="m/s²")
    parser.add_argument("--limit", type=float, default=360.0, help="degrees that no joint may pass")
    parser.add_argument("--watchdog", type=float, default=0.1, help="s without a command until the current goes off")
    parser.add_argument("--baud", type=int, default=1_000_000, help="of a board without USB of its own")
    parser.add_argument("--listen", type=int, default=5555, metavar="PORT", help="on this machine; 0: any that is free")
    given = parser.parse_args()
    given.zero = given.zero or [0.0] * given.joints
    for name in ("counts", "amperes", "most", "zero"):
        if len(getattr(given, name)) != given.joints:
            parser.error(f"--{name} needs {given.joints} numbers, one for each joint")
    return given


def main() -> None:
    """One connection after another, for ever: a rig has one body."""
    given = arguments()
    bridge = Bridge(Board(given.port, given.baud, given.watchdog), given)
    limits = ", ".join(f"{most / abs(each):.4g}" for most, each in zip(given.most, given.amperes, strict=True))
    listener = socket.create_server(("127.0.0.1", given.listen))
    print(f"listening at tcp://127.0.0.1:{listener.getsockname()[1]}; torque_limit = [{limits}]", flush=True)
    while True:
        connection, _ = listener.accept()
        with connection:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            talk(bridge, connection)


if __name__ == "__main__":
    main()
