"""Who listens where."""

from __future__ import annotations

import psutil


def listening(process: int) -> set[tuple[str, int]]:
    """Addresses and ports that a process and its children listen at."""
    family = [psutil.Process(process), *psutil.Process(process).children(recursive=True)]
    found = set()
    for one in family:
        try:
            sockets = one.net_connections("inet")
        except psutil.NoSuchProcess:
            continue
        found |= {(at.laddr.ip, at.laddr.port) for at in sockets if at.status == psutil.CONN_LISTEN}
    return found
