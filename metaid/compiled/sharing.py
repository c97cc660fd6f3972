"""What compiled loops share among threads: they release the GIL, so that pushes or candidates run side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache

THREADED = 200_000  # multiplications; threads do not pay for less


def share_out(run: Callable[[Iterator[int]], None], count: int, multiplications: int) -> None:
    """Runs the numbers up to `count` on several threads, if that many multiplications are worth it: each takes the next
    once it is through with one, for some take far longer than others. What is run may share out in its turn.
    """
    numbers = iter(range(count))  # whose next one is taken by one thread alone
    threads = min(threads_at_hand(), count) if multiplications > THREADED else 1
    waiting = [_pool().submit(run, numbers) for _ in range(1, threads)]
    run(numbers)
    for one in waiting:
        if not one.cancel():  # one that no thread has begun finds nothing left
            one.result()


def threads_at_hand() -> int:
    """As many threads as the process may use processors."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(threads_at_hand() - 1, 1), thread_name_prefix="twin")


if hasattr(os, "register_at_fork"):  # a forked process has the pool and none of its threads: it would wait for ever
    os.register_at_fork(after_in_child=_pool.cache_clear)
