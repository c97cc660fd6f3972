"""MuJoCo without the bindings' timer and without its log of warnings, while a loop of metaid's runs and no longer.

The timer is half of all the time of a step at three links. A diverged episode is a fall, which needs no line in a log
file. Both callbacks are variables of MuJoCo's library, so of the whole process: while a loop runs in one thread,
other threads have neither. Afterwards they are what they were.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from metaid.compiled.decorator import callback
from metaid.compiled.undocumented import LIBRARY

_library = ctypes.CDLL(str(LIBRARY))


@callback("float64()")
def _no_time() -> float:
    return 0.0


@callback("void(uintp)")
def _no_warning(_message: int) -> None:
    return


class _Callbacks:
    """MuJoCo's two callbacks, and who is in need of ours."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._inside: set[object] = set()
        self._before: list[int | None] | None = None
        self._callbacks = [ctypes.c_void_p.in_dll(_library, name) for name in ("mjcb_time", "mju_user_warning")]
        self._ours = [_no_time.address, _no_warning.address]

    def replace_for(self, loop: object) -> None:
        """The first `loop` inside puts ours in place."""
        with self._lock:
            self._inside.add(loop)
            if self._before is None:
                self._before = [callback.value for callback in self._callbacks]
                for callback, our in zip(self._callbacks, self._ours, strict=True):
                    callback.value = our

    def restore_after(self, loop: object) -> None:
        """The last `loop` to leave puts the former ones back, but for what somebody else has replaced meanwhile."""
        with self._lock:
            self._inside.discard(loop)
            if not self._inside and self._before is not None:
                for callback, our, former in zip(self._callbacks, self._ours, self._before, strict=True):
                    if callback.value == our:
                        callback.value = former
                self._before = None


_callbacks = _Callbacks()


@contextmanager
def quiet_mujoco() -> Iterator[None]:
    """Within it, MuJoCo calls no timer and logs no warning; threads may be within it at the same time."""
    loop = object()
    try:  # Ctrl-C may come at any point from here on
        _callbacks.replace_for(loop)
        yield
    finally:
        _callbacks.restore_after(loop)
