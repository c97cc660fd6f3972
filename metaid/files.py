"""Reading what users write: TOML files, by shipped name or by path, into checked and frozen settings.

Every problem becomes one line that says which file, which entry, and what is allowed there.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from metaid.errors import MetaidError, unknown

PACKAGE = Path(__file__).resolve().parent
ENDINGS = (".toml", ".xml", ".urdf", ".xacro")  # of what is a path, and no shipped name
LARGEST_FILE = 1_000_000  # bytes; what a person writes of 64 links is a hundredth of it
MOST_PARTS = 16  # of a dotted key; no setting has more than three

# Where a key may stand, that many parts and one more. tomllib remembers every beginning of a key, which grows with the
# square of its parts: 100 kB take 9 GB.
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"(?:^|[\[{{,])[ \t]*+(?:{_PART}[ \t]*+\.[ \t]*+){{{MOST_PARTS}}}", re.MULTILINE)


class Settings(BaseModel):
    """A table of a user's file: frozen, strict about types, finite numbers only, no unknown keys."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_keys_only(cls, data: Any) -> Any:
        for key in data if isinstance(data, Mapping) else ():
            if key not in cls.model_fields:
                # A custom error carries the text verbatim: a key with braces in it must not be read as a template.
                raise PydanticCustomError("unknown_key", "{text}", {"text": unknown("key", str(key), cls.model_fields)})
        return data


SettingsT = TypeVar("SettingsT", bound=Settings)
_KINDS = {"plants": "plant", "studies": "study"}


def shipped_folder(kind: str) -> Path:
    """The folder of shipped files of a `kind` ("plants", "studies", "logs"): inside an installed package, beside it in
    a checkout.
    """
    installed = PACKAGE / kind
    return installed if installed.is_dir() else PACKAGE.parent / kind


def shipped_names(kind: str) -> list[str]:
    """Names of the shipped files of a `kind`, sorted."""
    return sorted(path.stem for path in shipped_folder(kind).glob("*.toml"))


def shipped_logs(name: str) -> list[Path]:
    """The logs of a real robot that ship under a `name`, one a run; none where there are no such logs."""
    folder = shipped_folder("logs")
    return sorted((folder / name).glob("*.csv")) if name in {path.name for path in folder.iterdir()} else []


def find_file(kind: str, name: str, error: type[MetaidError], source: Path | None = None) -> Path:
    """The file that a name means: a path if it looks like one, else a shipped name.

    Whoever wrote a `source` that has the name in it may be a stranger. So a path is within the folder of that file, and
    does not lead out of it by a link either.

    Args:
        kind: of the file that is meant, "plants" or "studies".
        name: as it is written.
        error: the class of the exception.
        source: the file that it is written in; None where it is the user's own word, which may lead anywhere.

    Raises:
        error: there is no such file, or it is in another folder.
    """
    if not (name.endswith(ENDINGS) or "/" in name or "\\" in name):
        if name not in shipped_names(kind):
            raise error(f"{unknown(_KINDS[kind], name, shipped_names(kind))}, or the path of a .toml file")
        return shipped_folder(kind) / f"{name}.toml"
    path = Path(name) if source is None else source.parent / name
    try:
        found = path.is_file()
    except OSError as problem:  # too long a name, a folder that may not be read
        raise error(f"{path}: {problem.strerror}") from None
    if not found:
        raise error(f"no {_KINDS[kind]} file at {path}")
    if source is not None and not path.resolve().is_relative_to(source.parent.resolve()):
        raise error(f"{source}: {name} is outside the file's own folder (allowed: a path within it, or a shipped name)")
    return path


def read_toml(path: Path, error: type[MetaidError]) -> dict[str, Any]:
    """The tables of a TOML file; raises `error` where it cannot be read or does not parse."""
    try:
        with path.open("rb") as file:
            text = file.read(LARGEST_FILE + 1)
    except OSError as problem:
        raise error(f"{path}: {problem.strerror}") from None
    if len(text) > LARGEST_FILE:
        raise error(f"{path}: too large (allowed: at most {LARGEST_FILE} bytes)")
    try:
        return parse_toml(text.decode())
    except ValueError as problem:
        raise error(f"{path}: not valid TOML: {_one_line(str(problem))}") from None


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of `text`.  Raises ValueError, whatever is wrong with it."""
    if _LONG_KEY.search(text):
        raise ValueError(f"a dotted key of more than {MOST_PARTS} parts")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def check(model: type[SettingsT], data: Mapping[str, Any], source: str, error: type[MetaidError]) -> SettingsT:
    """Tables as checked settings.

    Args:
        model: the class of the settings.
        data: the tables, as they were read.
        source: what they were read from, as the message names it.
        error: the class of the exception.

    Raises:
        error: the first problem: where it is, and what is allowed.
    """
    try:
        return model.model_validate(data)
    except ValidationError as problem:
        try:
            found = problem.errors(include_url=False)
        except UnicodeEncodeError:
            raise error(f"{source}: holds a text that is not UTF-8") from None
        # Of a value that may be several things, the side that it fits best has its problem deepest.
        first = max(found, key=lambda error: len(_path(data, error)))
        path = _path(data, first)
        where = "".join(f"entry {part + 1}: " if isinstance(part, int) else f"{part}: " for part in path)
        message = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
        if message != first["msg"] and "error" not in first["type"]:
            message = f"should be {message}, not {_shown(first['input'])}"
        raise error(_one_line(f"{source}: {where}{message}")) from None


def _shown(value: Any) -> str:
    try:
        return repr(value)
    except (ValueError, RecursionError):  # an integer of more digits than Python prints, tables a thousand deep
        return "what it is"


def _path(data: Any, problem: ErrorDetails) -> list[int | str]:
    """Keys and indices that lead to a problem in `data`, without pydantic's own names for the sides of a union."""
    path = []
    for part in problem["loc"]:
        here = part in (data if isinstance(data, Mapping) else range(len(data)) if isinstance(data, list) else ())
        if here or (problem["type"] == "missing" and part == problem["loc"][-1]):
            path.append(part)
            data = data[part] if here else None
    return path


def _one_line(text: str, longest: int = 400) -> str:
    line = " ".join(text.split())
    return line if len(line) <= longest else line[: longest - 1] + "…"
