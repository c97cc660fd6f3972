"""A plant behind a socket: a rig, or any other process, that speaks the protocol of docs/rig-protocol.md.

A step is one message and one answer, which is awaited for a limited time. Whatever goes wrong closes the connection
and raises LostPlant. The rig takes its torque off when the connection is closed. The episode can be run again, over a
new connection. A reading that is no finite number raises ImplausiblePlant, and so does a torque that would be none.
"""

from __future__ import annotations

import time
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from metaid.errors import AbsentPlant, ImplausiblePlant, LostPlant, PlantError
from metaid.files import Settings
from metaid.models import Array
from metaid.plant.start import ArmStart, Start
from metaid.plant.wire import Wire, WireError, floats, parse_address

PROTOCOL = 1
LONGEST_TICK = 3.0  # timesteps, by the time that a plant tells

Seconds = Annotated[float, Field(gt=0, le=3600)]


class SocketSettings(Settings):
    """A plant file with a `socket`: where it listens; its number of `joints`, `gravity` in m/s² and `timestep` in s,
    which must be what it says itself; its `motion`, "continuous" or, if it is simulated by one step of Euler's in each
    timestep, "stepped"; how long, in s, to wait for a connection and for the answer to a step (`step_timeout`), and for
    it to have been brought upright and pushed (`push_timeout`)."""

    description: str = ""
    socket: str
    joints: Annotated[int, Field(ge=1, le=64)]
    gravity: Annotated[float, Field(gt=0, le=1e3)] = 9.81
    timestep: Annotated[float, Field(gt=0, le=0.1)] = 0.002
    motion: Literal["continuous", "stepped"] = "continuous"
    step_timeout: Seconds = 0.5
    push_timeout: Seconds = 60.0

    why_no_chain: ClassVar[str] = (
        "a plant behind a socket has no links to simulate or draw (allowed: plant show, and in a study)"
    )
    files: ClassVar[tuple[str, ...]] = ()

    @field_validator("socket")
    @classmethod
    def _is_address(cls, socket: str) -> str:
        parse_address(socket)
        return socket


class SocketPlant:
    """The plant that listens where `settings` say; it is called when first needed.

    Raises AbsentPlant where it cannot be reached, LostPlant where it then does not answer in time or not as agreed,
    ImplausiblePlant where it answers with what is no finite number, PlantError where it is another plant than the
    settings say.
    """

    def __init__(self, name: str, settings: SocketSettings) -> None:
        self.name, self.settings = name, settings
        self.njoint, self.timestep, self.gravity = settings.joints, settings.timestep, settings.gravity
        self._wire: Wire | None = None
        self._closed = False
        self._torque = np.zeros(settings.joints)
        self._state = np.zeros(settings.joints), np.zeros(settings.joints)
        self._tick = 0
        self._times: list[float] = []

    @property
    def times(self) -> Array | None:
        """Of the readings since the push (nreading), in s, as the plant tells them; None where it does not."""
        return np.array(self._times) if len(self._times) == self._tick + 1 else None

    def push(self, start: Start | ArmStart) -> None:
        """Raises PlantError where the protocol has no word for such a start, too."""
        try:
            asked = start.asked
        except PlantError as problem:
            raise PlantError(f"plant {self.name} at {self.settings.socket}: {problem}") from None
        self._tick, self._times = 0, []
        self.apply_torque(np.zeros(self.njoint))
        self._take(self._ask({"do": "push", **asked}, self.settings.push_timeout))

    def states(self) -> tuple[Array, Array]:
        return self._state

    def apply_torque(self, torque: Array) -> None:
        self._torque = torque

    def step(self) -> None:
        """Raises ImplausiblePlant where the torque is not finite: it is not sent."""
        self._tick += 1
        if not np.isfinite(self._torque).all():
            raise self._implausible(f"the law asks for a torque of {self._torque.tolist()} N m: it is not sent")
        self._take(self._ask({"do": "step", "torque": self._torque.tolist()}, self.settings.step_timeout))

    def stop(self) -> None:
        """Where the plant does not confirm it, the connection is closed, which says the same."""
        if self._wire is not None:
            try:
                self._ask({"do": "stop"}, self.settings.step_timeout)
            except LostPlant:
                return

    def close(self) -> None:
        """Lets go of the plant for good; another thread that waits for it gets LostPlant."""
        self._closed = True
        self._hang_up()

    def round_trips(self, count: int) -> Array:
        """How long `count` messages and their answers took (count), in s: the timestep must hold one, and the law."""
        taken = []
        for _ in range(count):
            started = time.perf_counter()
            self._ask({"do": "ping"}, self.settings.step_timeout)
            taken.append(time.perf_counter() - started)
        return np.array(taken)

    def _ask(self, message: dict[str, Any], timeout: float) -> dict[str, Any]:
        wire = self._wire or self._connect()
        try:
            answer = wire.ask(message, timeout)
        except WireError as problem:
            raise self._lost(f"{message['do']}: {problem}") from None
        if "error" in answer:
            raise self._lost(f"{message['do']}: it says: {str(answer['error'])[:200]}")
        return answer

    def _connect(self) -> Wire:
        """A connection to the plant that the settings mean."""
        try:
            wire, hello = self._greeted()
        except WireError as problem:
            raise AbsentPlant(f"plant {self.name} at {self.settings.socket}: {problem}") from None
        said = {"metaid": PROTOCOL, **{key: getattr(self.settings, key) for key in ("joints", "timestep", "gravity")}}
        for key, expected in said.items():
            if hello.get(key) != expected:
                wire.close()
                said_there = str(hello.get(key))[:60]
                raise PlantError(
                    f"plant {self.name}: what listens at {self.settings.socket} says {key} = {said_there}, "
                    f"the plant file {expected}: they must agree"
                )
        self._wire = wire
        return wire

    def _greeted(self) -> tuple[Wire, dict[str, Any]]:
        """A connection to whatever listens there, and what it says of itself."""
        if self._closed:
            raise WireError("it was let go")
        wire = Wire(self.settings.socket, self.settings.step_timeout)
        try:
            return wire, wire.ask({"do": "hello", "metaid": PROTOCOL}, self.settings.step_timeout)
        except WireError as problem:
            wire.close()
            raise WireError(f"hello: {problem}") from None

    def _take(self, answer: dict[str, Any]) -> None:
        """Keeps the state in an `answer`; of a plant that has stopped itself no angle is known, which is a fall."""
        angles, speeds, tick = floats(answer.get("angles")), floats(answer.get("speeds")), floats([answer.get("tick")])
        if angles is None or speeds is None or tick is None:
            raise self._lost(f"tick {self._tick}: its answer has no tick, angles and speeds that are numbers")
        if len(angles) != self.njoint or len(speeds) != self.njoint:
            sizes = f"{len(angles)} angles and {len(speeds)} speeds"
            raise self._lost(f"tick {self._tick}: it answers with {sizes} of {self.njoint} joints")
        if tick[0] != self._tick:
            late = f"a torque came later than its timestep of {self.timestep:g} s allows"
            why = late if tick[0] > self._tick else "its time does not go on"
            raise self._lost(f"it is at tick {tick[0]:.17g} after {self._tick} steps: {why}")
        for name, readings in (("angle", angles), ("speed", speeds)):
            for joint in np.flatnonzero(~np.isfinite(readings))[:1]:
                raise self._implausible(f"tick {self._tick}: the {name} of joint {joint + 1} is {readings[joint]}")
        if "stopped" in answer and self._tick == 0:
            raise self._lost(f"push: it stopped itself before any torque: {str(answer['stopped'])[:200]}")
        if "time" in answer:
            self._tell(answer["time"])
        self._state = (np.full(self.njoint, np.nan),) * 2 if "stopped" in answer else (angles, speeds)

    def _tell(self, said: Any) -> None:
        """Keeps the time of a reading, which must go on from tick to tick about as the timestep says."""
        time = floats([said])
        if time is None or not np.isfinite(time[0]):
            raise self._lost(f"tick {self._tick}: its time is {str(said)[:60]} (allowed: a number of s, or none)")
        if self._times and not 0.0 < time[0] - self._times[-1] < LONGEST_TICK * self.timestep:
            went = time[0] - self._times[-1]
            raise self._lost(
                f"tick {self._tick}: it took {went:.3g} s by the time that it tells "
                f"(allowed: above 0, and below {LONGEST_TICK:g} timesteps)"
            )
        self._times.append(float(time[0]))

    def _lost(self, why: str) -> LostPlant:
        self._hang_up()
        return LostPlant(f"plant {self.name} at {self.settings.socket}: {why}")

    def _implausible(self, why: str) -> ImplausiblePlant:
        self._hang_up()
        return ImplausiblePlant(f"plant {self.name} at {self.settings.socket}: {why} (allowed: finite numbers)")

    def _hang_up(self) -> None:
        wire, self._wire = self._wire, None
        if wire is not None:
            wire.close()
