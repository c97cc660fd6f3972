#!/usr/bin/env python3
"""A rig behind a socket: what someone with hardware has to write, worked out (docs/your-rig.md).

It needs Python and numpy, and nothing of metaid: the protocol is all that the two share. `Links` stands where the
hardware would, a pendulum simulated by its equations of motion; `Rig` is what every rig needs: ticks, a watchdog, a
limit of its own, and the torque off whenever something is wrong. `--body mujoco` has metaid's own plant stepped
instead, to compare with it digit for digit; `--fault` loses messages and connections on purpose.

    python examples/socket_rig.py plants/two-link.toml --listen tcp://127.0.0.1:5555 --real-time
"""

from __future__ import annotations

import argparse
import json
import socket
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np

PROTOCOL = 1
ASKED = "asked to"  # why the torque is off after every push that went well
STEPS = 10  # of what is simulated, in a tick: a real machine moves continuously
IDLE = 60.0  # s without a word, nothing moving: whoever is connected has gone, and somebody else may be waiting


class Body(Protocol):
    """The hardware. Angles of joints from the upright in rad, speeds in rad/s, torques in N m. `needs`: what a push has
    a number of for each joint.
    """

    needs: tuple[str, ...]

    def push(self, *asked: list[float]) -> None:
        """Of a pendulum: brings the links to rest upright, and strikes their tips with impulses in N s. Of an arm:
        brings it to a pose, in rad, and to speeds, in rad/s.
        """

    def states(self) -> tuple[list[float], list[float]]:
        """Reads the encoders: joint angles and speeds."""

    def advance(self, torque: list[float]) -> None:
        """Holds a torque for one tick. Hardware would set it and return at once."""


class Links:
    """A planar chain by its equations of motion (docs/method.md, Eq. 4). It moves continuously, by STEPS Runge-Kutta
    steps in a tick; or `stepped`, by one of semi-implicit Euler.
    """

    needs = ("impulses",)

    def __init__(self, plant: dict[str, Any], stepped: bool) -> None:
        links, self.stepped = plant["links"], stepped
        self.length, mass = (np.array([float(link[key]) for link in links]) for key in ("length", "mass"))
        com = np.array([float(link.get("com", link["length"] / 2)) for link in links])
        rod = mass * self.length**2 / 12
        inertia = np.array([float(link.get("inertia", own)) for link, own in zip(links, rod, strict=True)])
        outboard = mass.sum() - np.cumsum(mass)
        first_moment = mass * com + self.length * outboard
        coupling = np.triu(np.outer(self.length, first_moment), 1)
        self.coupling = coupling + coupling.T
        self.diagonal = np.diag(inertia + mass * com**2 + self.length**2 * outboard)
        self.weight = float(plant.get("gravity", 9.81)) * first_moment
        self.timestep = float(plant.get("timestep", 0.002))
        self.angles = self.speeds = np.zeros(len(links))  # absolute

    def push(self, impulses: list[float]) -> None:
        momentum = self.length * np.cumsum(impulses[::-1])[::-1]
        self.angles = np.zeros(len(impulses))
        self.speeds = np.linalg.solve(self.coupling + self.diagonal, momentum)

    def states(self) -> tuple[list[float], list[float]]:
        return np.diff(self.angles, prepend=0.0).tolist(), np.diff(self.speeds, prepend=0.0).tolist()

    def advance(self, torque: list[float]) -> None:
        state = np.array([self.angles, self.speeds])
        if self.stepped:
            speeds = self.speeds + self.timestep * self.rates(state, torque)[1]
            self.angles, self.speeds = self.angles + self.timestep * speeds, speeds
            return
        step = self.timestep / STEPS
        for _ in range(STEPS):
            first = self.rates(state, torque)
            second = self.rates(state + 0.5 * step * first, torque)
            third = self.rates(state + 0.5 * step * second, torque)
            last = self.rates(state + step * third, torque)
            state = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + last)
        self.angles, self.speeds = state

    def rates(self, state: Any, torque: list[float]) -> Any:
        """How absolute angles and speeds (2 x nlink) change."""
        angles, speeds = state
        between = angles[:, None] - angles[None, :]
        force = np.array(torque) - np.append(torque[1:], 0.0)  # on absolute angles
        force += self.weight * np.sin(angles) - (self.coupling * np.sin(between)) @ speeds**2
        return np.array([speeds, np.linalg.solve(self.coupling * np.cos(between) + self.diagonal, force)])


class Arm:
    """An arm by MuJoCo, from an MJCF whose joints are all moved; a position controller is taken for granted."""

    needs = ("pose", "speeds")

    def __init__(self, path: Path, timestep: float) -> None:
        import mujoco

        self.mujoco, self.model = mujoco, mujoco.MjModel.from_xml_path(str(path))
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self.model.opt.timestep = timestep / STEPS
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.data = mujoco.MjData(self.model)

    def push(self, pose: list[float], speeds: list[float]) -> None:
        self.mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = pose, speeds

    def states(self) -> tuple[list[float], list[float]]:
        return self.data.qpos.tolist(), self.data.qvel.tolist()

    def advance(self, torque: list[float]) -> None:
        self.data.qfrc_applied[:] = torque
        self.mujoco.mj_step(self.model, self.data, STEPS)


class Simulator:
    """metaid's own simulated plant, from a plant file."""

    needs = ("impulses",)

    def __init__(self, path: Path) -> None:
        from metaid.plant import Start, load_chain

        self.plant = load_chain(str(path))
        self.upright = Start.upright

    def push(self, impulses: list[float]) -> None:
        self.plant.push(self.upright(np.array(impulses)))

    def states(self) -> tuple[list[float], list[float]]:
        angles, speeds = self.plant.states()
        return angles.tolist(), speeds.tolist()

    def advance(self, torque: list[float]) -> None:
        self.plant.apply_torque(np.array(torque))
        self.plant.step()


class Rig:
    """A body with ticks and reasons to stop. `limit` (rad): an angle that no joint may pass, whatever is asked. It says
    why it took the torque off, and if it is `verbose` also that it was asked to.
    """

    def __init__(
        self, body: Body, about: dict[str, Any], watchdog: float, limit: float, real_time: bool, verbose: bool
    ) -> None:
        self.body = body
        self.about = about
        self.watchdog = watchdog
        self.limit = limit
        self.real_time = real_time
        self.verbose = verbose
        self.moving = False
        self.tick = 0
        self.why = "it was not pushed"
        self.pushed_at = 0.0
        self.torque = [0.0] * about["joints"]

    def answer(self, message: dict[str, Any]) -> dict[str, Any]:
        """What is said to a message, after doing what it asks."""
        asked = message.get("do")
        if asked == "hello":
            return self.about
        if asked == "ping":
            return {"pong": True}
        if asked == "push":
            return self.push(*(self.numbers(message, key) for key in self.body.needs))
        if asked == "step":
            return self.step(self.numbers(message, "torque"))
        if asked == "stop":
            self.stop(ASKED)
            return {"stopped": ASKED}
        return {"error": f"unknown message {asked!r} (allowed: hello, ping, push, step, stop)"}

    def numbers(self, message: dict[str, Any], key: str) -> list[float]:
        """A finite number for each joint. Checked here: a torque that is not one must not reach a motor."""
        values = np.array(message.get(key), dtype=np.float64)
        if values.shape != (self.about["joints"],) or not np.isfinite(values).all():
            raise ValueError(f"{message['do']} needs {self.about['joints']} finite numbers as '{key}'")
        return [float(value) for value in values]

    def push(self, *asked: list[float]) -> dict[str, Any]:
        """To where it begins, and a push; ticks are counted from it."""
        self.torque = [0.0] * self.about["joints"]
        self.body.push(*asked)
        self.moving, self.tick, self.pushed_at = True, 0, time.monotonic()
        return self.state()

    def step(self, torque: list[float]) -> dict[str, Any]:
        """Holds the torque until the next tick. A tick that has gone by meanwhile had the torque before it."""
        if not self.moving:
            return {"error": f"stopped: {self.why}"}
        if self.real_time:
            if time.monotonic() > self.next_tick + self.watchdog:
                self.stop(f"no command for {self.watchdog:g} s")
                return {"error": f"stopped: {self.why}"}
            while time.monotonic() > self.next_tick and self.moving:
                self.advance()
        self.torque = torque
        self.advance()
        if self.real_time:
            time.sleep(max(self.pushed_at + self.tick * self.about["timestep"] - time.monotonic(), 0.0))
        return self.state()

    @property
    def next_tick(self) -> float:
        """When it is due, by the monotonic clock."""
        return self.pushed_at + (self.tick + 1) * float(self.about["timestep"])

    def advance(self) -> None:
        """One tick, and the limit."""
        self.body.advance(self.torque)
        self.tick += 1
        if not np.all(np.abs(np.cumsum(self.body.states()[0])) <= self.limit):
            self.stop(f"a link is past {np.degrees(self.limit):g}°")

    def state(self) -> dict[str, Any]:
        """What a push or a step is answered with."""
        angles, speeds = self.body.states()
        shown = {"tick": self.tick, "angles": angles, "speeds": speeds}
        if (time := getattr(self.body, "told_time", None)) is not None:
            shown["time"] = time  # s since the push, of a body whose ticks do not keep time
        return shown if self.moving else {**shown, "stopped": self.why}

    def stop(self, why: str) -> None:
        """Torque off, at once, whatever else happens."""
        self.torque = [0.0] * self.about["joints"]
        moved, self.moving, self.why = self.moving, False, why
        if moved and (self.verbose or why != ASKED):
            print(f"torque off at tick {self.tick}: {why}", flush=True)


class Faults:
    """What goes wrong on purpose: `--fault KIND@N` at the Nth step since the start.

    `drop` closes the connection, `silence` loses the answer, `late` has a tick go by before the torque comes, and
    `die` ends the process.
    """

    KINDS = ("drop", "silence", "late", "die")

    def __init__(self, given: list[str]) -> None:
        self.steps = 0
        self.at = {}
        for text in given:
            kind, _, step = text.partition("@")
            if kind not in self.KINDS or not step.isdigit():
                raise SystemExit(f"--fault {text}: not of the form KIND@N (kinds: {', '.join(self.KINDS)})")
            self.at[int(step)] = kind

    def next(self, message: dict[str, Any]) -> str | None:
        """The fault that this message meets, if any."""
        self.steps += message.get("do") == "step"
        return self.at.pop(self.steps, None) if message.get("do") == "step" else None


def talk(rig: Rig, connection: socket.socket, faults: Faults) -> None:
    """Answers messages until the connection ends, for whatever reason; then the torque is off."""
    try:
        for line in lines(rig, connection):
            try:
                message = json.loads(line)
                fault = faults.next(message)
                if fault == "die":
                    raise SystemExit("died on purpose")
                if fault == "drop":
                    return
                if fault == "late":
                    rig.advance()
                answer = rig.answer(message)
            except (ValueError, TypeError, AttributeError) as problem:
                fault, answer = None, {"error": f"bad message: {problem}"}
            if fault != "silence":
                connection.sendall(json.dumps(answer).encode() + b"\n")
    except OSError:
        return
    finally:
        rig.stop("the connection ended")


def lines(rig: Rig, connection: socket.socket) -> Iterator[bytes]:
    """Messages as they come. The watchdog: the torque goes off if something moves and none comes in time."""
    received = b""
    while True:
        connection.settimeout(rig.watchdog if rig.moving else IDLE)
        try:
            part = connection.recv(4096)
        except TimeoutError:
            if not rig.moving:
                return
            rig.stop(f"no command for {rig.watchdog:g} s")
            continue
        if not part or len(received) > 1 << 16:
            return
        received += part
        while b"\n" in received:
            line, _, received = received.partition(b"\n")
            yield line


def listen(address: str) -> socket.socket:
    """A socket at tcp://HOST:PORT (port 0: any free one) or unix:PATH; says where."""
    if address.startswith("unix:"):
        listener = socket.socket(socket.AF_UNIX)
        path = Path(address.removeprefix("unix:"))
        if path.is_socket():
            path.unlink()  # left over from the last time
        listener.bind(str(path))
        print(f"listening at {address}", flush=True)
    else:
        host, _, port = address.removeprefix("tcp://").rpartition(":")
        listener = socket.create_server((host, int(port)))
        print(f"listening at tcp://{host}:{listener.getsockname()[1]}", flush=True)
    listener.listen()
    return listener


def main() -> None:
    """One connection after another, for ever: a rig has one body."""
    parser = argparse.ArgumentParser(description="A pendulum behind a socket.")
    parser.add_argument("plant", type=Path, help="plant file with the links to simulate, or the MJCF of an arm")
    parser.add_argument("--timestep", type=float, default=0.002, help="s, of an arm")
    parser.add_argument("--listen", default="tcp://127.0.0.1:5555", metavar="ADDRESS", help="tcp://… or unix:…")
    parser.add_argument("--body", choices=["links", "mujoco"], default="links", help="what is simulated, and how")
    parser.add_argument("--stepped", action="store_true", help="links move by one step of Euler's in a tick")
    parser.add_argument("--real-time", action="store_true", help="a tick takes its time (default: as fast as asked)")
    parser.add_argument("--watchdog", type=float, default=0.2, help="s without a command until the torque goes off")
    parser.add_argument("--verbose", action="store_true", help="say each time that the driver stops it, too")
    parser.add_argument("--limit", type=float, default=720.0, help="degrees that no link may pass")
    parser.add_argument(
        "--fault", action="append", default=[], metavar="KIND@N", help="drop, silence, late or die at step N"
    )
    given = parser.parse_args()
    about = {"metaid": PROTOCOL, "name": given.plant.stem}
    if given.plant.suffix == ".xml":
        arm = Arm(given.plant, given.timestep)
        body: Body = arm
        gravity = float(np.linalg.norm(arm.model.opt.gravity))
        about |= {"joints": arm.model.nv, "timestep": given.timestep, "gravity": gravity}
    else:
        plant = tomllib.loads(given.plant.read_text(encoding="utf-8"))
        body = Links(plant, given.stepped) if given.body == "links" else Simulator(given.plant)
        timestep, gravity = float(plant.get("timestep", 0.002)), float(plant.get("gravity", 9.81))
        about |= {"joints": len(plant["links"]), "timestep": timestep, "gravity": gravity}
    rig = Rig(body, about, given.watchdog, np.radians(given.limit), given.real_time, given.verbose)
    faults = Faults(given.fault)
    listener = listen(given.listen)
    while True:
        connection, _ = listener.accept()
        with connection:
            if connection.family != socket.AF_UNIX:
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            talk(rig, connection, faults)


if __name__ == "__main__":
    main()
