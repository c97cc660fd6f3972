"""Waiting for a study DB's server that does not answer, as when it is restarted."""

from __future__ import annotations

import time
from collections.abc import Callable

from metaid.errors import StorageError, UnreachableError

SERVER_PATIENCE = 300.0  # s
PAUSE = 1.0  # s between tries


def keep_trying(work: Callable[[], None], seconds: float, waiting: Callable[[str], None], advice: str) -> None:
    """Does `work`, again and again while the server does not answer; `waiting` is told why before each pause.

    Raises StorageError, with `advice`, when it has not answered for `seconds`.
    """
    begun: float | None = None
    while True:
        try:
            work()
        except UnreachableError as problem:
            now = time.monotonic()
            begun = now if begun is None else begun
            if now - begun >= seconds:
                raise StorageError(f"{problem}; it was waited for for {seconds:g} s; {advice}") from None
            waiting(f"waiting for the study DB: {problem}")
            time.sleep(min(PAUSE, seconds - (now - begun)))
        else:
            return
