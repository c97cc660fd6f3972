"""The example rig of docs/your-rig.md, as a process of its own behind a socket."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from places import ROOT

from metaid.plant import SocketPlant, SocketSettings

TWO_LINK = ROOT / "plants" / "two-link.toml"


class Server(NamedTuple):
    """A running example: where it listens, and what it has printed so far."""

    address: str
    process: subprocess.Popen[bytes]
    log: Path

    @property
    def stops(self) -> list[str]:
        """Why it took its torque off, each time."""
        return re.findall(r"torque off at tick \d+: (.*)", self.log.read_text())


Serve = Callable[..., Server]


@contextmanager
def serving(folder: Path) -> Iterator[Serve]:
    """What starts the example rig with more arguments, its logs in `folder`; ends it afterwards."""
    started: list[Server] = []

    def start(*arguments: str, plant: Path = TWO_LINK, listen: str = "tcp://127.0.0.1:0") -> Server:
        log = folder / f"rig-{len(started)}.log"
        program = [sys.executable, str(ROOT / "examples" / "socket_rig.py"), str(plant), "--listen", listen]
        with log.open("wb") as output:
            process = subprocess.Popen([*program, *arguments], stdout=output, stderr=output)
        started.append(Server("", process, log))
        until = time.monotonic() + 400.0
        while "listening at" not in log.read_text():
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < until
            time.sleep(0.02)
        return Server(log.read_text().split()[2], process, log)

    try:
        yield start
    finally:
        for server in started:
            server.process.send_signal(signal.SIGCONT)
            server.process.kill()
            server.process.wait()


def rig_at(server: Server | str, **changes: Any) -> SocketPlant:
    """The plant that listens there; patient, since the machine may be busy."""
    address = server if isinstance(server, str) else server.address
    settings = {"joints": 2, "timestep": 0.002, "step_timeout": 60.0, **changes}
    return SocketPlant("rig", SocketSettings(socket=address, **settings))
