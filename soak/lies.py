"""A rig that lies: the example rig of docs/your-rig.md on a thread, behind a real socket, whose answers are changed.

A lie is a function that changes an answer in place, or returns the bytes that are sent instead. `Liar` has what was
answered before, and everything that it was asked.
"""

from __future__ import annotations

import json
import math
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any

import numpy as np

from soak.common import ROOT

Answer = dict[str, Any]
Lie = Callable[["Liar", Answer], bytes | None]

PLANT = {
    "links": [
        {"length": 0.42, "mass": 1.1, "com": 0.19, "inertia": 0.017},
        {"length": 0.35, "mass": 0.8, "com": 0.20, "inertia": 0.0075},
    ]
}
MIDDLE = 0.5  # of a push: most lies begin there


def _example() -> Any:
    found = spec_from_file_location("socket_rig", ROOT / "examples" / "socket_rig.py")
    assert found is not None
    assert found.loader is not None
    module = module_from_spec(found)
    found.loader.exec_module(module)
    return module


example: Any = _example()
Rig: Any = example.Rig
Links: Any = example.Links


class Liar(Rig):  # type: ignore[misc]
    """The example rig with honest noise, that tells a `lie` from the push `lies_from` on, of those since `arm`.

    `angle_noise` in rad and `push_noise` as a share of every impulse are no lies. With `is_continuous` it moves as a
    real rig does.
    """

    def __init__(
        self,
        steps: int,
        angle_noise: float = 0.0,
        push_noise: float = 0.0,
        seed: int = 0,
        is_continuous: bool = False,
    ) -> None:
        about = {"metaid": 1, "name": "liar", "joints": 2, "timestep": 0.002, "gravity": 9.81}
        body = Links(PLANT, not is_continuous)
        super().__init__(body, about, 60.0, math.radians(720.0), real_time=False, verbose=False)
        self.steps = steps
        self.angle_noise = angle_noise
        self.push_noise = push_noise
        self.random = np.random.default_rng(seed)
        self.asked: list[Answer] = []
        self.arm(None, 0)

    def arm(self, lie: Lie | None, lies_from: int) -> None:
        """Counts pushes anew, and tells a `lie` from the push `lies_from` on, counted from 0."""
        self.lie, self.lies_from, self.pushes = lie, lies_from, -1
        self.said: list[Answer] = []  # in this push
        self.recorded: list[list[Answer]] = []  # in those before
        self.asked.clear()

    @property
    def is_lying(self) -> bool:
        """Whether answers are changed now."""
        return self.lie is not None and self.pushes >= self.lies_from

    @property
    def is_late(self) -> bool:
        """Whether the push has come to its middle."""
        return bool(self.tick >= MIDDLE * self.steps)

    def push(self, impulses: list[float]) -> Answer:
        self.pushes += 1
        self.recorded.append(self.said)
        self.said = []
        share = 1.0 + self.push_noise * self.random.standard_normal(len(impulses))
        if self.is_lying and self.lie in PUSHES:
            share = share * PUSHES[self.lie]
        answer: Answer = super().push((np.array(impulses) * share).tolist())
        return answer

    def advance(self) -> None:
        if self.is_lying and self.lie in PASSES:
            for _ in range(PASSES[self.lie] - 1):
                self.body.advance(self.torque)
        if not (self.is_lying and self.lie is slow_motion and self.tick % 2):
            super().advance()
        else:
            self.tick += 1

    def stop(self, why: str) -> None:
        self.torque, self.moving, self.why = [0.0, 0.0], False, why  # without a word on the terminal

    def state(self) -> Answer:
        answer: Answer = super().state()
        noisy = np.array(answer["angles"]) + self.angle_noise * self.random.standard_normal(2)
        answer.update(angles=noisy.tolist(), speeds=list(answer["speeds"]))
        self.said.append(json.loads(json.dumps(answer)))
        return answer

    def reply(self, message: Answer) -> bytes:
        """What is sent in answer to a message."""
        self.asked.append(message)
        answer: Answer = self.answer(message)
        instead = self.lie(self, answer) if self.is_lying and self.lie is not None and "tick" in answer else None
        return (json.dumps(answer).encode() if instead is None else instead) + b"\n"

    def sent_torques(self) -> list[list[float]]:
        """Every torque that it was sent."""
        return [message["torque"] for message in self.asked if message.get("do") == "step"]


@contextmanager
def listening(liar: Liar) -> Iterator[str]:
    """The address where it listens meanwhile, on a thread of its own; one connection after another."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        ends = threading.Event()

        def serve() -> None:
            while not ends.is_set():
                connection, _ = server.accept()
                with connection, connection.makefile("rwb") as lines:
                    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    try:
                        for line in lines:
                            lines.write(liar.reply(json.loads(line)))
                            lines.flush()
                    except OSError:
                        continue

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        address = server.getsockname()
        yield f"tcp://127.0.0.1:{address[1]}"
        ends.set()
        socket.create_connection(address).close()
        thread.join()


def _from(first: float, *keys: str, joint: int | None = None) -> Lie:
    """Readings that stay what they were at this share of a push."""

    def lie(liar: Liar, answer: Answer) -> None:
        old = liar.said[min(round(first * liar.steps), liar.tick)]
        for key in keys:
            if joint is None:
                answer[key] = old[key]
            else:
                answer[key][joint] = old[key][joint]

    return lie


def _put(key: str, value: Any, joint: int | None = 0) -> Lie:
    """An answer of the second half of a push with another `value`: of one joint, or of all."""

    def lie(liar: Liar, answer: Answer) -> None:
        if liar.is_late:
            answer[key] = (
                value if joint is None else [value if i == joint else old for i, old in enumerate(answer[key])]
            )

    return lie


def _scaled(key: str, scale: float, offset: float = 0.0, after: float = 0.0) -> Lie:
    """Readings of all joints on another scale, from this share of a push on."""

    def lie(liar: Liar, answer: Answer) -> None:
        if liar.tick >= after * liar.steps:
            answer[key] = [scale * value + offset for value in answer[key]]

    return lie


def _both(*lies: Lie) -> Lie:
    def lie(liar: Liar, answer: Answer) -> None:
        for each in lies:
            each(liar, answer)

    return lie


def _raw(line: bytes) -> Lie:
    return lambda liar, answer: line if liar.is_late else None


def _once(key: str, add: float) -> Lie:
    """One reading of the first joint is wrong by that much."""

    def lie(liar: Liar, answer: Answer) -> None:
        if liar.tick == round(MIDDLE * liar.steps):
            answer[key][0] += add

    return lie


def swapped(_liar: Liar, answer: Answer) -> None:
    """The joints' cables are swapped."""
    answer.update(angles=answer["angles"][::-1], speeds=answer["speeds"][::-1])


def mirrored(_liar: Liar, answer: Answer) -> None:
    """The second encoder counts backwards."""
    for key in ("angles", "speeds"):
        answer[key][1] *= -1.0


def dead_encoder(liar: Liar, answer: Answer) -> None:
    """The first encoder dies: its angle stays, and a speed made of it is zero."""
    if liar.is_late:
        answer["angles"][0] = liar.said[round(MIDDLE * liar.steps)]["angles"][0]
        answer["speeds"][0] = 0.0


def wrapped(liar: Liar, answer: Answer) -> None:
    """An angle wraps, and the speed made of two readings is wrong in that step."""
    if liar.is_late:
        answer["angles"][0] += 2.0 * math.pi
    if liar.tick == math.ceil(MIDDLE * liar.steps):
        answer["speeds"][0] += 2.0 * math.pi / 0.002


def delayed(liar: Liar, answer: Answer) -> None:
    """The readings are those of ten ticks before."""
    old = liar.said[max(liar.tick - 10, 0)]
    answer.update(angles=old["angles"], speeds=old["speeds"])


def replayed(liar: Liar, answer: Answer) -> None:
    """The readings are those of the same push one trial before, whatever the torque is."""
    old = liar.recorded[-PUSHES_A_TRIAL]
    if len(old) > liar.tick:
        answer.update(angles=old[liar.tick]["angles"], speeds=old[liar.tick]["speeds"])


def repeated(liar: Liar, answer: Answer) -> None:
    """Every answer is given twice."""
    answer.update(liar.said[liar.tick // 2])


def weak_push(liar: Liar, answer: Answer) -> None:
    """Every push is a tenth too weak."""


def strong_push(liar: Liar, answer: Answer) -> None:
    """Every push is a fifth too strong."""


def lame_push(liar: Liar, answer: Answer) -> None:
    """The second link is not pushed."""


def fast_motion(liar: Liar, answer: Answer) -> None:
    """Two timesteps pass in each tick."""


def slow_motion(liar: Liar, answer: Answer) -> None:
    """A timestep passes in every second tick alone."""


PUSHES: dict[Lie | None, list[float]] = {weak_push: [0.9, 0.9], strong_push: [1.2, 1.2], lame_push: [1.0, 0.0]}
PASSES: dict[Lie | None, int] = {fast_motion: 2}
PUSHES_A_TRIAL = 4

LIES: dict[str, Lie] = {
    "all readings freeze in the middle": _from(MIDDLE, "angles", "speeds"),
    "all readings freeze near the end": _from(0.9, "angles", "speeds"),
    "all readings stay those right after the push": _from(0.0, "angles", "speeds"),
    "the angles freeze": _from(MIDDLE, "angles"),
    "the angles of one joint freeze": _from(MIDDLE, "angles", joint=1),
    "the readings of one joint freeze": _from(MIDDLE, "angles", "speeds", joint=0),
    "the speeds stay those right after the push": _from(0.0, "speeds"),
    "all readings are zero": _both(_scaled("angles", 0.0), _scaled("speeds", 0.0)),
    "all readings become zero": _both(_scaled("angles", 0.0, after=MIDDLE), _scaled("speeds", 0.0, after=MIDDLE)),
    "the speeds become zero": _scaled("speeds", 0.0, after=0.01),
    "an encoder dies": dead_encoder,
    "an encoder dies and shows zero": _both(_put("angles", 0.0), _put("speeds", 0.0)),
    "a joint does not answer": _both(_from(0.0, "angles", joint=1), _scaled("speeds", 0.0)),
    "pushes are a tenth too weak": weak_push,
    "pushes are a fifth too strong": strong_push,
    "one link is not pushed": lame_push,
    "the joints are swapped": swapped,
    "an encoder counts backwards": mirrored,
    "angles in degrees": _scaled("angles", 180.0 / math.pi),
    "speeds in degrees": _scaled("speeds", 180.0 / math.pi),
    "angles are off by 0.3 rad": _scaled("angles", 1.0, 0.3),
    "angles jump by 0.1 rad": _scaled("angles", 1.0, 0.1, MIDDLE),
    "an angle wraps": wrapped,
    "one angle is wrong by 0.5 rad": _once("angles", 0.5),
    "one speed is wrong by 10 rad/s": _once("speeds", 10.0),
    "one speed is 1,000,000 rad/s": _once("speeds", 1e6),
    "speeds of 1e300 rad/s": _put("speeds", 1e300),
    "speeds are a third too high after the push": _scaled("speeds", 4.0 / 3.0, after=0.01),
    "angles are a third too small": _scaled("angles", 2.0 / 3.0),
    "an angle is NaN": _put("angles", math.nan),
    "a speed is infinite": _put("speeds", math.inf),
    "an angle is a text": _put("angles", "0.1"),
    "an angle is null": _put("angles", None),
    "an angle is true": _put("angles", True),
    "an angle is a list": _put("angles", [0.1]),
    "an angle has 400 digits": _put("angles", 10**400),
    "a speed has 5,000 digits": _raw(b'{"tick": 1, "angles": [0, 0], "speeds": [0, 1' + b"0" * 5000 + b"]}"),
    "one angle too many": _put("angles", [0.1, 0.2, 0.3], None),
    "no angles": _put("angles", [], None),
    "the tick is 1e400": _raw(b'{"tick": 1e400, "angles": [0.1, 0.2], "speeds": [1, 1]}'),
    "the tick is a text": _put("tick", "75", None),
    "the tick stands still": _put("tick", 10, None),
    "every answer comes twice": repeated,
    "the answer is a deep list": _raw(b"[" * 60_000),
    "the answer is no UTF-8": _raw(b"\xff\xfe{"),
    "readings are ten ticks late": delayed,
    "readings of the trial before": replayed,
    "time runs twice as fast": fast_motion,
    "time runs half as fast": slow_motion,
    "it stops itself at each push": lambda liar, answer: answer.update(stopped="why not"),
}
