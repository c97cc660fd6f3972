"""`python -m soak.bench PLANT --set NAME=NUMBER[,NUMBER …]`: a bench behind a socket, until it is killed."""

from __future__ import annotations

import argparse
import socket
import tomllib
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np

from soak.bench import Bench, Imperfections, arm_of_links, arm_of_mjcf

NEVER = 1e9  # s, or rad: the bench waits for whoever drives it


def example_rig() -> Any:
    """The module of `examples/socket_rig.py`, which has what every rig needs and nothing of metaid."""
    path = Path(__file__).resolve().parents[2] / "examples" / "socket_rig.py"
    found = spec_from_file_location("socket_rig", path)
    assert found is not None
    assert found.loader is not None
    module = module_from_spec(found)
    found.loader.exec_module(module)
    return module


def main(arguments: list[str] | None = None) -> None:
    """One connection after another."""
    parser = argparse.ArgumentParser(description="A test bench that shares no code with metaid.", prog="soak.bench")
    parser.add_argument("plant", type=Path, help="plant file with links, or the MJCF of an arm of hinges")
    parser.add_argument("--timestep", type=float, default=0.002, help="s, of a tick")
    parser.add_argument("--listen", default="tcp://127.0.0.1:0", metavar="ADDRESS", help="tcp://… or unix:…")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=NUMBER", help="an imperfection")
    given = parser.parse_args(arguments)
    is_planar = given.plant.suffix == ".toml"
    arm = arm_of_links(tomllib.loads(given.plant.read_text())) if is_planar else arm_of_mjcf(given.plant)
    imperfections = Imperfections.parsed(given.set)
    example, n = example_rig(), len(arm.masses)
    body = Bench(arm, given.timestep, imperfections, is_planar)
    about = {"metaid": example.PROTOCOL, "name": given.plant.stem, "joints": n, "timestep": given.timestep}
    about["gravity"] = float(np.linalg.norm(arm.gravity))
    body.push(*([0.0] * n for _ in body.needs))
    body.advance([0.0] * n)  # compiled before anyone waits for it
    rig = example.Rig(body, about, NEVER, NEVER, False, False)
    listener = example.listen(given.listen)
    while True:
        connection, _ = listener.accept()
        with connection:
            if connection.family != socket.AF_UNIX:
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            example.talk(rig, connection, example.Faults([]))


if __name__ == "__main__":
    main()
