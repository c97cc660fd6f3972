"""How the functions of the episode's inner loop are compiled, and where their machine code is kept.

They release the GIL, so that threads run side by side. Each becomes a part of its compiled callers. They are compiled
without numba's reference counts: these are atomic, and at three links they cost more than the compensation law. Without
them nothing can be allocated.

They are cached on disk, in a folder named by a digest of all that the machine code was made from. Functions become a
part of their callers, and constants a part of the code. But numba's own cache looks at the source file of the outermost
function only, so after a change elsewhere it would run the old code. The digest is of all sources of this package and
its `spatial`, of `metaid.models` and of the function's own package, with those that it is in, of a function outside
metaid of all of metaid, and of the versions of numba, llvmlite and MuJoCo.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import os
import shutil
import tempfile
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import llvmlite
import numba
from numba import types
from numba.core import event
from numba.extending import overload, typeof_impl

from metaid.errors import MetaidError, usable_mujoco

with usable_mujoco():
    import mujoco

from metaid.compiled.undocumented import WITHOUT_REFERENCE_COUNTS, class_of

if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise MetaidError("NUMBA_DISABLE_JIT is set, and metaid's loops are nothing without numba's compiler: unset it")

KEPT = 4  # folders in one place: those that were used last; two working copies or environments may take turns

_OWN = Path(__file__).resolve().parent
_INLINED = (_OWN, _OWN / "spatial", _OWN.parent / "models")
_PREFIX = "machine-code-"

_choosing = threading.Lock()
_options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **WITHOUT_REFERENCE_COUNTS}
_of_parts: dict[str, Any] = {"forceinline": True, "no_cpython_wrapper": True}


class Compiled:
    """A function that is compiled when it is first called with arguments of given types: as a whole where Python calls
    it, as a part of its caller where another such function does.

    A part has no wrapper for Python. Its body would become a part of that, too, which takes half as long again.
    Options beside the `function` are numba's.
    """

    def __init__(self, function: Callable[..., Any], **more: Any) -> None:
        functools.update_wrapper(self, function)
        self._function, self._options = function, {**_options, **more}
        self.whole = _kept(function, functools.partial(numba.njit, **self._options))

    @functools.cached_property
    def part(self) -> Any:
        """What is compiled into callers. A process that has their machine code from the disk does without it."""
        return _kept(self._function, functools.partial(numba.njit, **self._options, **_of_parts), "parts")

    def __call__(self, *arguments: Any) -> Any:
        return self.whole(*arguments)


@typeof_impl.register(Compiled)
def _type_of(function: Compiled, _: Any) -> types.Dispatcher:
    return types.Dispatcher(function.part)


_CALLS: dict[int, Callable[[Compiled], Callable[..., Any]]] = {  # by the number of arguments
    2: lambda function: lambda a, b: function(a, b),
    3: lambda function: lambda a, b, c: function(a, b, c),
    5: lambda function: lambda a, b, c, d, e: function(a, b, c, d, e),
}


def choose(stub: Callable[..., Any], functions: Mapping[type, Compiled]) -> None:
    """Lets compiled functions that call the `stub` call one of these `functions` in its place: by the class of its
    first argument, a NamedTuple, when they are compiled. It can be called again for further classes.
    """
    call = _CALLS[len(inspect.signature(stub).parameters)]

    @overload(stub, inline="always", strict=False)
    def _chosen(*arguments: Any) -> Any:
        function = functions.get(class_of(arguments[0]))
        return None if function is None else call(function)


def callback(signature: str) -> Callable[[Callable[..., Any]], Any]:
    """A function that C calls, with numba's `signature`, compiled at once."""
    return lambda function: _kept(function, functools.partial(numba.cfunc, signature))


def _kept(function: Callable[..., Any], compiler: Callable[..., Any], within: str = "") -> Any:
    """The `function` as a `compiler` of numba's makes it, whose machine code is kept where there is a place for it: in
    the folder `within` that place, for numba would take what another compiler has made.
    """
    source = Path(inspect.getfile(function)).resolve()
    folder = cache_folder(source.parent) if source.is_file() else None
    if folder is None:
        return compiler()(function)
    with _choosing:  # numba chooses the folder of a function's cache where the function is decorated
        before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder / within)  # type: ignore[attr-defined]
        try:
            return compiler(cache=True)(function)
        finally:
            numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


class _Compiling(event.Listener):
    """Counts the functions that are compiled now, one within the other or in threads."""

    now = 0

    def on_start(self, _: event.Event) -> None:
        self.now += 1

    def on_end(self, _: event.Event) -> None:
        self.now -= 1


_compiling = _Compiling()
event.register("numba:compile", _compiling)  # type: ignore[no-untyped-call]


def is_compiling() -> bool:
    """Whether machine code is made now that is not on the disk yet: of all loops that takes up to a minute."""
    return _compiling.now > 0


compiled = Compiled
fused = functools.partial(Compiled, fastmath={"contract"})  # a product and a sum become one instruction


@functools.cache
def cache_folder(package: Path) -> Path | None:
    """The folder for machine code of the functions of a `package` (its folder), made if it is not there.

    It is the first of these that can be written to: a folder in `NUMBA_CACHE_DIR`; one in the package's `__pycache__`;
    one in the user's own cache. None if none can be.
    """
    name = _PREFIX + digest(package)
    chosen = [Path(numba.config.CACHE_DIR)] if numba.config.CACHE_DIR else []  # type: ignore[attr-defined]
    for place in (*chosen, package / "__pycache__", _user_cache()):
        folder = place / name
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            os.utime(folder)
            _forget_old(place)
            return folder
    return None


def digest(package: Path) -> str:
    """Of everything that the machine code of the functions of a `package` (its folder) is made from. Those of a package
    within another are made from the functions of that, too.
    """
    found = hashlib.blake2b(digest_size=10)
    found.update(repr((numba.__version__, llvmlite.__version__, mujoco.__version__)).encode())
    packages = [folder for folder in (package, *package.parents) if _OWN.parent in folder.parents]
    if not packages:
        packages = sorted({path.parent for path in _OWN.parent.rglob("*.py")})
    for folder in dict.fromkeys((*_INLINED, package, *packages)):
        for path in sorted(folder.glob("*.py")):
            source = path.read_bytes()
            found.update(f"{path.name} {len(source)} ".encode() + source)
    return found.hexdigest()


def _user_cache() -> Path:
    given = os.environ.get("XDG_CACHE_HOME")
    return (Path(given) if given else Path("~/.cache").expanduser()) / "metaid"


def _forget_old(place: Path) -> None:
    """Removes all but the last folders there; numba does without one that has gone, and makes it again."""

    def used(folder: Path) -> float:
        try:
            return folder.stat().st_mtime
        except OSError:  # another process has just removed it
            return 0.0

    for folder in sorted(place.glob(_PREFIX + "*"), key=used)[:-KEPT]:
        shutil.rmtree(folder, ignore_errors=True)
