"""A bench as a process of its own, for as long as it is wanted."""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from soak.bench.__main__ import main

ROOT = Path(__file__).resolve().parents[2]
FORKS = multiprocessing.get_context("forkserver")  # loads nothing again that a test has it load
PATIENCE = 400.0  # s, for a bench that compiles on a busy machine


@contextmanager
def bench(plant: Path, timestep: float = 0.002, **imperfections: float | tuple[float, ...]) -> Iterator[str]:
    """The address of a bench that moves the links of a `plant` file, or an MJCF, with `Imperfections`, ticks of
    `timestep` s.
    """
    arguments = [str(plant.resolve()), "--timestep", repr(timestep)]
    for name, value in _texts(imperfections).items():
        arguments += ["--set", f"{name}={value}"]
    with tempfile.NamedTemporaryFile("r") as said:
        process = FORKS.Process(target=_serve, args=(said.name, arguments), daemon=True)
        process.start()
        try:
            yield _address(process, said)
        finally:
            process.kill()
            process.join()


def _serve(said: str, arguments: list[str]) -> None:
    for number in (1, 2):
        os.dup2(os.open(said, os.O_WRONLY | os.O_APPEND), number)
    main(arguments)


def _texts(given: Mapping[str, float | tuple[float, ...]]) -> dict[str, str]:
    return {
        name: ",".join(map(repr, value)) if isinstance(value, tuple) else repr(value) for name, value in given.items()
    }


def _address(process: Any, said: IO[str]) -> str:
    """Where it listens.  Raises RuntimeError where it has ended."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until and process.is_alive():
        said.seek(0)
        words = said.read().split()
        if words[:2] == ["listening", "at"] and len(words) > 2:
            return words[2]
        time.sleep(0.05)
    said.seek(0)
    raise RuntimeError(f"the bench did not start: {said.read()}")
