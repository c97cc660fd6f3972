"""A Ray cluster of machines with addresses of their own, of which one is lost in mid-run and another is added: the
trial table is the one of a run that was left alone.

The machines are network namespaces of this one, joined by a bridge in another; making them needs Linux and root. Where
that is not allowed this part is left out, and says so; tests/study/test_workers.py does the like on loopback anywhere.
"""

from __future__ import annotations

import os
import secrets
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from metaid.results import trials_frame
from metaid.store import Store
from metaid.study import create_study, load_study, run_study
from soak.common import METAID, ROOT, SoakResult, soaked
from soak.kills import faults
from soak.workers import at_work

NAME = "cluster"
CHANGES = {"trials": 600, "search.coordinates": "plain", "search.start": 0.8, "episode.steps": 4000}
PORT = 6379
RAY = (sys.executable, "-m", "ray.scripts.scripts")
START = ("env", "RAY_AUTH_MODE=token", *RAY, "start", "--block", "--disable-usage-stats", "--num-cpus=1")
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
ENVIRONMENT["RAY_AUTH_TOKEN"] = secrets.token_hex(32)


def run(scale: float) -> list[SoakResult]:
    """Once, whatever the scale."""
    what = "Ray on two addresses, one machine lost and one added in mid-run: the table of a run left alone"
    try:
        with network(1):
            pass
    except (OSError, subprocess.CalledProcessError):
        return [SoakResult(f"left out, network namespaces are not allowed here: {what}", 0, 0, (), 0.0)]

    def work() -> tuple[int, list[str]]:
        with tempfile.TemporaryDirectory(prefix="metaid") as folder:
            return 1, lose_and_add(Path(folder))

    return [soaked(what, 1, work)]


class Machine:
    """A network namespace with an address, in which commands run."""

    def __init__(self, namespace: str, address: str) -> None:
        self._namespace = namespace
        self.address = address

    def start(self, *command: str) -> subprocess.Popen[bytes]:
        """Starts a command there, with nothing to say."""
        there = ["ip", "netns", "exec", self._namespace, *command]
        return subprocess.Popen(there, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def works(self) -> bool:
        """Whether a Ray actor evaluates there."""
        processes = _ip("netns", "pids", self._namespace).split()
        return any(at_work(int(process)) for process in processes)

    def lose(self) -> None:
        """Ends all that runs there, at once and without a word to anyone."""
        for _ in range(2):  # what was being started at first, the second time
            for process in _ip("netns", "pids", self._namespace).split():
                os.kill(int(process), signal.SIGKILL)


@contextmanager
def network(size: int) -> Iterator[list[Machine]]:
    """So many machines that reach each other, and nothing else.  Raises OSError or CalledProcessError where that is
    not allowed.
    """
    switch, names = f"metaid{os.getpid()}", [f"metaid{os.getpid()}-{i}" for i in range(size)]
    with ExitStack() as made:
        for name in (switch, *names):
            _ip("netns", "add", name)
            made.callback(_ip, "netns", "delete", name)
            _ip("-n", name, "link", "set", "lo", "up")
        _ip("-n", switch, "link", "add", "bridge", "type", "bridge")
        _ip("-n", switch, "link", "set", "bridge", "up")
        machines = [Machine(name, f"10.77.0.{i + 1}") for i, name in enumerate(names)]
        for i, (name, machine) in enumerate(zip(names, machines, strict=True)):
            peer = ("peer", "name", f"port{i}", "netns", switch)
            _ip("-n", name, "link", "add", "ethernet", "type", "veth", *peer)
            _ip("-n", switch, "link", "set", f"port{i}", "master", "bridge", "up")
            _ip("-n", name, "address", "add", f"{machine.address}/24", "dev", "ethernet")
            _ip("-n", name, "link", "set", "ethernet", "up")
            made.callback(machine.lose)
        yield machines


def lose_and_add(folder: Path) -> list[str]:
    """A run on two machines; in its middle the second is lost and a third is added. What went wrong."""
    spec, path = load_study("three-link-coast", CHANGES), folder / "metaid.db"
    for storage in (path, folder / "alone.db"):
        with closing(Store(str(storage), create=True)) as store:
            create_study(store, spec, NAME)
    with closing(Store(str(folder / "alone.db"))) as store:
        run_study(store, NAME)
        whole = trials_frame(store, NAME)
    with network(3) as (head, second, third):
        address = f"{head.address}:{PORT}"
        head.start(
            *(*START, "--head", f"--node-ip-address={head.address}", f"--port={PORT}"),
            *(f"--temp-dir={folder}/ray", "--include-dashboard=false"),
        )
        while head.start("env", "RAY_AUTH_MODE=token", *RAY, "health-check", f"--address={address}").wait() != 0:
            pass
        second.start(*START, f"--address={address}", f"--node-ip-address={second.address}")
        command = ["study", "run", NAME, "--quiet", "--engine", "ray", "--ray-address", address, "--workers", "3"]
        driver = head.start(*METAID, *command, "--storage", str(path))
        wrong = []
        for machine in (second, third):
            while not machine.works() and driver.poll() is None:
                time.sleep(0.05)
            if driver.poll() is not None:
                wrong.append(f"the run ended before {machine.address} had work")
            if machine is second:
                second.lose()
                third.start(*START, f"--address={address}", f"--node-ip-address={third.address}")
        if driver.wait() != 0:
            wrong.append(f"exit status {driver.returncode}")
    return wrong + faults(path, NAME, whole, finished=True)


def _ip(*arguments: str) -> str:
    return subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True).stdout
