"""What an MJCF or URDF asks for, found before MuJoCo reads it: files, and more memory than anybody means.

MuJoCo opens every file that is named, and allocates every size that is asked for. A few letters of a stranger's are
enough for either.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain
from math import prod
from pathlib import Path
from typing import Any
from xml.parsers import expat

from metaid.errors import PlantError

SCHEME = "://"  # of a mesh's address: package://NAME/PATH, file:///PATH
LARGEST_XML = 50_000_000  # bytes of a file and what it includes
MOST_COPIES = 10_000  # elements that are repeated, or repeat themselves: MuJoCo takes seconds for so many
MOST_MEMORY = 1.0  # GB

_REPEATING = ("replicate", "flexcomp", "composite")
_ALONG = (("nrow", "ncol"), ("width", "height"))  # of a height field, of a texture
_SIZES = (*_ALONG, *((key,) for key in ("dim", "actdim", "nsample", "nuserdata", "njmax", "nconmax")))
_OF_AN_ELEMENT = 2_000  # bytes
_OF_A_CELL = 8
_OF_A_VERTEX = 700  # of a mesh that MuJoCo makes, by the square of its resolution
_READ = ("include", "model")  # elements whose file is XML, too


def refuse_absurd_sizes(path: Path) -> None:
    """Raises PlantError where an MJCF or URDF, with what it includes, is no XML or asks for what no machine has."""
    _Asked(path)


def refuse_files_outside(path: Path, folder: Path) -> None:
    """Raises PlantError where an MJCF or URDF, or a file that it names, lies outside a `folder`, by a link or not."""
    for place in chain([path], _Asked(path).files()):
        if not place.resolve().is_relative_to(folder.resolve()):
            raise PlantError(f"{path}: {place} is outside the study's own folder (allowed: files within it)")


class _Asked:
    """What a file at a path asks for, with what it includes.  Raises PlantError."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._named: list[tuple[str, Path]] = []  # files, and the folder of the file that names them
        self._folders = [""]  # where they may be: beside it, or as the file says
        self._read: set[Path] = set()
        self._bytes = 0
        self._copies = self._memory = self._elements = self._users = 0.0
        self._scan(path, 1.0)
        of_elements = (_OF_AN_ELEMENT + _OF_A_CELL * self._users) * self._elements
        if (gigabytes := 1e-9 * (self._memory + of_elements)) > MOST_MEMORY:
            raise self._refused(f"the sizes in it take {gigabytes:.3g} GB", f"up to {MOST_MEMORY:g} GB")

    def files(self) -> Iterator[Path]:
        """Files that MuJoCo may open."""
        for name, beside in self._named:
            named = name.partition(SCHEME)[2].lstrip("/") if SCHEME in name else name
            bases = list(self._path.resolve().parents) if SCHEME in name else [self._path.parent, beside]
            for place in (base / folder / end for base in bases for folder in self._folders for end in _ends(named)):
                try:
                    if place.is_file():
                        yield place
                except (OSError, ValueError):  # too long a name, or one that no file can have
                    continue

    def _scan(self, path: Path, copies: float) -> None:
        text = self._text(path)
        around = [copies]  # of every element that is open
        included: list[tuple[str, float]] = []

        def begin(element: str, given: dict[str, str]) -> None:
            repeats = max(1.0, prod(_numbers(given, "count"))) if element in _REPEATING else 1.0
            around.append(around[-1] * repeats)
            self._count(element, given, around[-1])
            for key, value in given.items():
                if key.startswith("file"):
                    self._named.append((value, path.parent))
                if key in ("meshdir", "texturedir", "assetdir"):
                    self._folders.append(value)
            if element in _READ and "file" in given:
                included.append((given["file"], around[-1]))

        parser = expat.ParserCreate()
        parser.StartElementHandler, parser.EndElementHandler = begin, lambda _: around.pop()
        try:
            parser.Parse(text, True)
        except (expat.ExpatError, ValueError, LookupError) as problem:
            if not _is_utf8(text):
                raise PlantError(f"{path}: a text in it is not UTF-8 (allowed: texts that are)") from None
            raise PlantError(f"{path}: not valid XML: {problem}") from None
        self._read.add(path.resolve())
        for name, repeats in included:
            for place in {self._path.parent / name, path.parent / name}:
                if place.resolve() not in self._read and place.is_file():
                    self._scan(place, repeats)

    def _text(self, path: Path) -> bytes:
        try:
            with path.open("rb") as file:
                text = file.read(LARGEST_XML - self._bytes + 1)
        except OSError as problem:
            raise PlantError(f"{path}: {problem.strerror}") from None
        self._bytes += len(text)
        if self._bytes > LARGEST_XML:
            raise self._refused("too large", f"at most {LARGEST_XML} bytes, with what it includes")
        return text

    def _count(self, element: str, given: Mapping[str, str], copies: float) -> None:
        self._elements += copies * (1.0 + sum(_numbers(given, "nkey")))
        if element != "replicate" and copies > 1.0:
            self._copies += copies
        if not max(copies, self._copies) <= MOST_COPIES:
            raise self._refused(
                f"at <{element}> it has {max(copies, self._copies):.15g} copies", f"up to {MOST_COPIES}"
            )
        cells = sum(prod(max(0.0, number) for key in keys for number in _numbers(given, key)) for keys in _SIZES)
        cells += sum(_numbers(given, "size")) if element == "numeric" else 0.0
        finest = max(_numbers(given, "params"), default=0.0)
        self._memory += copies * (_OF_A_CELL * cells + _OF_A_VERTEX * finest**2)
        self._users += sum(number for key in given if key.startswith("nuser_") for number in _numbers(given, key))

    def _refused(self, met: str, allowed: str) -> PlantError:
        return PlantError(f"{self._path}: {met} (allowed: {allowed})")


def _is_utf8(text: bytes) -> bool:
    try:
        text.decode()
    except UnicodeDecodeError:
        return False
    return True


def _ends(name: str) -> tuple[str, str]:
    """A file's name, and its last part: MuJoCo may be told to look for that alone."""
    return name, name.replace("\\", "/").rpartition("/")[2]


def _numbers(given: Mapping[str, Any], key: str) -> list[float]:
    """The numbers in an attribute; none where MuJoCo would read none."""
    try:
        return [float(number) for number in given.get(key, "").split()]
    except ValueError:
        return []
