"""How the functions of the episode's inner loop are compiled.

They release the GIL, so that threads run side by side; they are cached on disk (`cache_folder`); each becomes a part of
its caller; and they have no part in numba's reference counts. Those cost more than the compensation law at three links,
atomic as they are, at every array that is taken up; without them nothing can be allocated either.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from metaid.compiled.cache_folder import cache_folder
from metaid.compiled.undocumented import WITHOUT_REFERENCE_COUNTS

_options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "forceinline": True, **WITHOUT_REFERENCE_COUNTS}


def compiled(function: Callable[..., Any], **more: Any) -> Any:
    """The `function`, compiled when it is first called with arguments of given types; `more` are options of numba's."""
    options = {**_options, **more}
    source = Path(inspect.getfile(function)).resolve()
    folder = cache_folder(source.parent) if source.is_file() else None
    if folder is None:
        return numba.njit(**options)(function)
    # numba chooses the folder of a function's cache where the function is decorated.
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder)  # type: ignore[attr-defined]
    try:
        return numba.njit(cache=True, **options)(function)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]
