"""Waiting for a study DB's server that does not answer, as when it is restarted."""

from __future__ import annotations

import time
from collections.abc import Callable

from metaid.errors import StorageError, UnreachableError

SERVER_PATIENCE = 300.0  # s without an answer after which a server is given up
PAUSE = 1.0  # s between attempts


def keep_trying(work: Callable[[], None], patience: float, on_wait: Callable[[str], None], advice: str) -> None:
    """Does `work`, again and again while the server does not answer.

    Args:
        work: which raises UnreachableError where the server does not answer; it is done once.
        patience: s without an answer after which the server is given up.
        on_wait: called before each pause with what is waited for, in one line.
        advice: how to go on, in the error's message.

    Raises:
        StorageError: when the server has not answered for as long.
    """
    begun: float | None = None
    while True:
        try:
            work()
        except UnreachableError as problem:
            now = time.monotonic()
            begun = now if begun is None else begun
            if now - begun >= patience:
                raise StorageError(f"{problem}; no answer for {patience:g} s; {advice}") from None
            on_wait(f"waiting for the study DB: {problem}")
            time.sleep(min(PAUSE, patience - (now - begun)))
        else:
            return
