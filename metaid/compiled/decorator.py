"""How the functions of the episode's inner loop are compiled.

They release the GIL, so that threads run side by side; they are cached on disk; each becomes a part of its caller; and
they have no part in numba's reference counts. Those cost more than the compensation law at three links, atomic as they
are, at every array that is taken up; without them nothing can be allocated either.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

_options: dict[str, Any] = {"nogil": True, "cache": True, "error_model": "numpy", "forceinline": True, "_nrt": False}
compiled: Callable[[Any], Any] = njit(**_options)
