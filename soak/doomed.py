"""A metaid command that SIGKILLs itself in the middle of a write to the study DB: between two statements of a
transaction that writes a generation, or just before or after it.

python -m soak.doomed WRITES STATEMENTS study run NAME …
"""

from __future__ import annotations

import os
import signal
import sys
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Engine

from metaid.cli import main


class Doom:
    """Kills this process before statement number `statements` of write transaction number `writes`."""

    def __init__(self, writes: int, statements: int) -> None:
        self._writes = writes
        self._statements = statements
        sa.event.listen(Engine, "before_cursor_execute", self._count)

    def _count(self, _connection: Any, _cursor: Any, statement: str, *_others: Any) -> None:
        if statement.startswith("INSERT INTO trials"):
            self._writes -= 1
        if self._writes <= 0:
            self._statements -= 1
            if self._statements <= 0:
                os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    Doom(int(sys.argv[1]), int(sys.argv[2]))
    main(sys.argv[3:])
