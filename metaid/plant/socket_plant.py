"""A plant behind a socket: a rig, or any other process, that speaks the protocol of docs/your-rig.md.

A step is one message and one answer, which is awaited for a limited time. Whatever goes wrong closes the connection
and raises LostPlant. The rig takes its torque off when the connection is closed. The episode can be run again, over a
new connection.
"""

from __future__ import annotations

import time
from typing import Annotated, Any

import numpy as np
from pydantic import Field, field_validator

from metaid.errors import AbsentPlant, LostPlant, PlantError
from metaid.files import Settings
from metaid.models import Array, Lumps
from metaid.plant.start import Start
from metaid.plant.wire import Wire, WireError, parse_address

PROTOCOL = 1

Seconds = Annotated[float, Field(gt=0, le=3600)]


class SocketSettings(Settings):
    """A plant file with a `socket`: where it listens; its number of `joints`, `gravity` in m/s² and `timestep` in s,
    which must be what it says itself; how long, in s, to wait for a connection and for the answer to a step
    (`step_timeout`), and for it to have been brought upright and pushed (`push_timeout`)."""

    description: str = ""
    socket: str
    joints: Annotated[int, Field(ge=1, le=64)]
    gravity: Annotated[float, Field(gt=0, le=1e3)] = 9.81
    timestep: Annotated[float, Field(gt=0, le=0.1)] = 0.002
    step_timeout: Seconds = 0.5
    push_timeout: Seconds = 60.0

    @field_validator("socket")
    @classmethod
    def _is_address(cls, socket: str) -> str:
        parse_address(socket)
        return socket


class SocketPlant:
    """The plant that listens where `settings` say; it is called when first needed.

    Raises AbsentPlant where it cannot be reached, LostPlant where it then does not answer in time or not as agreed,
    PlantError where it is another plant than the settings say.
    """

    def __init__(self, name: str, settings: SocketSettings) -> None:
        self.name = name
        self.settings = settings
        self._wire: Wire | None = None
        self._closed = False
        self._torque = np.zeros(settings.joints)
        self._state = np.zeros(settings.joints), np.zeros(settings.joints)
        self._tick = 0

    @property
    def njoint(self) -> int:
        return self.settings.joints

    @property
    def timestep(self) -> float:
        return self.settings.timestep

    @property
    def gravity(self) -> float:
        return self.settings.gravity

    def push(self, start: Start) -> None:
        """Raises PlantError where it is to begin elsewhere than upright, too: the protocol has no word for that."""
        if not start.is_upright:
            raise PlantError(
                f"plant {self.name} at {self.settings.socket}: a push is to begin at joint angles "
                f"{start.angles.tolist()} rad (allowed: 0 rad for every joint; a rig is pushed from the upright)"
            )
        self._tick = 0
        self.apply_torque(np.zeros(self.njoint))
        self._take(self._ask({"do": "push", "impulses": start.impulses.tolist()}, self.settings.push_timeout))

    def states(self) -> tuple[Array, Array]:
        return self._state

    def apply_torque(self, torque: Array) -> None:
        self._torque = torque

    def step(self) -> None:
        self._tick += 1
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

    def true_lumps(self) -> Lumps | None:
        return None

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
                raise PlantError(
                    f"plant {self.name}: what listens at {self.settings.socket} says {key} = {hello.get(key)}, "
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
        try:
            angles, speeds = (np.array(answer[key], dtype=np.float64) for key in ("angles", "speeds"))
            tick = int(answer["tick"])
        except (KeyError, TypeError, ValueError):
            raise self._lost("its answer has no tick, angles and speeds") from None
        if angles.shape != (self.njoint,) or speeds.shape != (self.njoint,):
            raise self._lost(f"it answers with {angles.size} angles and {speeds.size} speeds of {self.njoint} joints")
        if tick != self._tick:
            raise self._lost(
                f"it is at tick {tick} after {self._tick} steps: "
                f"a torque came later than its timestep of {self.timestep:g} s allows"
            )
        self._state = (np.full(self.njoint, np.nan),) * 2 if "stopped" in answer else (angles, speeds)

    def _lost(self, why: str) -> LostPlant:
        self._hang_up()
        return LostPlant(f"plant {self.name} at {self.settings.socket}: {why}")

    def _hang_up(self) -> None:
        wire, self._wire = self._wire, None
        if wire is not None:
            wire.close()
