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


_callbacks = [ctypes.c_void_p.in_dll(_library, name) for name in ("mjcb_time", "mju_user_warning")]
_ours = [_no_time.address, _no_warning.address]
_lock = threading.RLock()
_inside: set[object] = set()
_before: list[int | None] = []  # what was there before ours, while anybody is inside


@contextmanager
def quiet_mujoco() -> Iterator[None]:
    """Within it, MuJoCo calls no timer and logs no warning; threads may be within it at the same time. The last to
    leave puts the former callbacks back, but for what somebody else has replaced meanwhile.
    """
    loop = object()
    try:  # Ctrl-C may come at any point from here on
        with _lock:
            _inside.add(loop)
            if not _before:
                _before[:] = [callback.value for callback in _callbacks]
                for callback, our in zip(_callbacks, _ours, strict=True):
                    callback.value = our
        yield
    finally:
        with _lock:
            _inside.discard(loop)
            if not _inside and _before:
                for callback, our, former in zip(_callbacks, _ours, _before, strict=True):
                    if callback.value == our:
                        callback.value = former
                _before.clear()
