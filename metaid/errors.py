"""The errors that a user can mend. Each is one line that says what is wrong, and what is allowed.

The command line prints the line alone and exits with status 2. In Python they are ordinary exceptions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from shlex import quote


def printable(text: str) -> str:
    """`text` with every control character, line break and half of a surrogate pair written out: what a file or a DB
    says cannot command a terminal.
    """
    return text if text.isprintable() else "".join(map(_written_out, text))


def _written_out(letter: str) -> str:
    return letter if letter.isprintable() else letter.encode("unicode_escape").decode()


class MetaidError(Exception):
    """Base of every error that a user can mend; its message is one printable line."""

    def __init__(self, message: str) -> None:
        super().__init__(printable(" ".join(message.split())))


class PlantError(MetaidError):
    """A plant that does not exist, does not parse, or cannot be built."""


class BranchesError(PlantError):
    """A robot whose branches leave open which of its joints move: the names of those in each of its `series`, from the
    base on, and of the `slides` among them.
    """

    def __init__(self, message: str, series: Sequence[Sequence[str]], slides: Sequence[str]) -> None:
        super().__init__(message)
        self.series, self.slides = series, slides


class LostPlant(PlantError):  # noqa: N818, what happened to it, not what is wrong with it
    """A plant that stopped answering in the middle of something: what it was doing can be done again."""


class ImplausiblePlant(LostPlant):
    """A plant whose answers cannot be true. What it was doing is not done again: it would be moved in vain."""


class AbsentPlant(LostPlant):
    """A plant that cannot be reached at all, so that the next request would fail, too."""


class StudyError(MetaidError):
    """A study file or a study setting that cannot be used."""


class StorageError(MetaidError):
    """A study DB that is missing, is not one, or does not hold what is wanted."""


class UnreachableError(StorageError):
    """A study DB on a server that does not answer now."""


class EpisodeError(MetaidError):
    """An episode that cannot be run with these settings."""


class RecordError(MetaidError):
    """A rig's log that cannot be used, or that says too little."""


class WorkerError(MetaidError):
    """Workers that are gone and do not come back."""


class RenderError(MetaidError):
    """A picture that this machine cannot make."""


class MissingExtraError(MetaidError):
    """A package that metaid needs only for some of what it does, and that is not installed."""


@contextmanager
def optional_packages(extra: str) -> Iterator[None]:
    """Within it the packages of an optional dependency are imported.  Raises MissingExtraError, which says how that
    `extra` is installed, where one of them is missing.
    """
    try:
        yield
    except ImportError as problem:
        missing = problem.name or "a package"
        raise MissingExtraError(f"{missing} is not installed: {how_to_install(extra)}") from None


def how_to_install(extra: str) -> str:
    """The command that installs the packages of an optional dependency, wherever metaid itself came from."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        stated = [need.partition(";") for need in requires("metaid") or []]
    except PackageNotFoundError:  # run from its sources, and not installed
        stated = []
    wanted = (f"extra == '{extra}'", f'extra == "{extra}"')
    needs = [need.strip() for need, _, marker in stated if marker.strip() in wanted]
    return f"python -m pip install {' '.join(map(quote, needs or [f'metaid[{extra}]']))}"


@contextmanager
def usable_mujoco() -> Iterator[None]:
    """Within it MuJoCo is imported for the first time, which asks MUJOCO_GL for an OpenGL whether it is needed or not.
    Raises MetaidError where that names none.
    """
    try:
        yield
    except RuntimeError as problem:
        if "MUJOCO_GL" not in str(problem):
            raise
        raise MetaidError(f"{problem} (allowed: egl, osmesa, glfw or disabled, or leave it unset)") from None


def first_of(names: Sequence[str], most: int, between: str = ", ") -> str:
    """The first of some `names`, and how many more there are than `most`."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return between.join(names[:most]) + more


def joints_of(names: Sequence[str]) -> str:
    """Those joints, in words: `joint A`, or `joints A, B`."""
    return f"joint{'s' * (len(names) != 1)} {', '.join(names)}"


def unknown(what: str, name: str, allowed: Iterable[str]) -> str:
    """The message for a `name` that is not among `allowed`: the nearest one, then all of them."""
    names = list(allowed)
    near = get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    return f"unknown {what} '{name}'{hint} (allowed: {', '.join(names) or 'none'})"
