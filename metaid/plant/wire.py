"""Messages over a socket: one line of JSON there, one back, each within a time limit."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from metaid.models import Array

LONGEST_LINE = 1 << 16  # bytes of an answer; 64 links need 3,000
FORMS = "tcp://HOST:PORT or unix:PATH"


class WireError(Exception):
    """No connection, no answer in time, or an answer that is not a line of JSON."""


def parse_address(address: str) -> tuple[str, int] | str:
    """Host and port of `tcp://HOST:PORT`, or the path of `unix:PATH`.  Raises ValueError."""
    if address.startswith("unix:") and len(address) > len("unix:"):
        return address.removeprefix("unix:")
    parts = urlsplit(address)
    if parts.scheme != "tcp" or not parts.hostname or not parts.port or parts.path:
        raise ValueError(f"'{address}' is not an address (allowed: {FORMS})")
    return parts.hostname, parts.port


def floats(numbers: Any) -> Array | None:
    """The floats (n) of a JSON array of `numbers`; None where it is none. One that is too large for a float is
    infinite. A text or a truth value is no number.
    """
    if not isinstance(numbers, list) or not all(type(number) in (int, float) for number in numbers):
        return None
    return np.array([_float(number) for number in numbers], dtype=np.float64)


def _float(number: float) -> float:
    try:
        return float(number)
    except OverflowError:
        return np.inf


class Wire:
    """A connection to `address`, made within `timeout` s.  Raises WireError."""

    def __init__(self, address: str, timeout: float) -> None:
        self._received = b""
        target = parse_address(address)
        try:
            self._socket = _connected(target, timeout)
        except OSError as problem:
            raise WireError(f"no connection to {address}: {problem.strerror or problem}") from None

    def ask(self, message: Mapping[str, Any], timeout: float) -> dict[str, Any]:
        """The answer to `message`, both in all within `timeout` s.  Raises WireError; the connection is then of no
        more use, as an answer that comes late would pass for that to the next message.
        """
        until = time.monotonic() + timeout
        try:
            self._socket.settimeout(timeout)
            self._socket.sendall(json.dumps(message).encode() + b"\n")
            while b"\n" not in self._received:
                self._socket.settimeout(max(until - time.monotonic(), 1e-6))
                part = self._socket.recv(4096)
                if not part:
                    raise WireError("the connection was closed")
                self._received += part
                if len(self._received) > LONGEST_LINE:
                    raise WireError(f"an answer of more than {LONGEST_LINE} bytes")
        except TimeoutError:
            raise WireError(f"no answer within {timeout:g} s") from None
        except OSError as problem:
            raise WireError(f"the connection was lost: {problem.strerror or problem}") from None
        line, _, self._received = self._received.partition(b"\n")
        try:
            answer = json.loads(line)
        except (ValueError, RecursionError):
            raise WireError(f"an answer that is not JSON: {line[:60]!r}") from None
        if not isinstance(answer, dict):
            raise WireError(f"an answer that is not a JSON object: {line[:60]!r}")
        return answer

    def close(self) -> None:
        """Ends the connection, from whichever thread. A thread that waits for an answer gets a WireError."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


def _connected(target: tuple[str, int] | str, timeout: float) -> socket.socket:
    if not isinstance(target, str):
        connection = socket.create_connection(target, timeout)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return connection
    connection = socket.socket(socket.AF_UNIX)
    try:
        connection.settimeout(timeout)
        connection.connect(target)
    except OSError:
        connection.close()
        raise
    return connection
