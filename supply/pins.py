"""What is installed, and whether a constraints file names it."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name


def pinned(constraints: Path) -> dict[str, str]:
    """The version that a constraints file gives to each package, by its canonical name."""
    lines = re.findall(r"^([\w.-]+)==(\S+)$", constraints.read_text(encoding="utf-8"), re.MULTILINE)
    return {canonicalize_name(name): version for name, version in lines}


def direct(project: dict[str, Any]) -> list[str]:
    """The requirements of a pyproject.toml's `project` and of all its extras, each once; an extra made of others of the
    project's own adds none.
    """
    needs = [*project["dependencies"], *(need for extra in project["optional-dependencies"].values() for need in extra)]
    return list(dict.fromkeys(need for need in needs if canonicalize_name(Requirement(need).name) != project["name"]))


def are_installed(requirements: Iterable[str]) -> bool:
    """Whether all these packages are in this environment."""
    here = {canonicalize_name(package.name) for package in distributions()}
    return {canonicalize_name(Requirement(requirement).name) for requirement in requirements} <= here


def installed(requirements: Iterable[str], environment: Path | None = None) -> dict[str, Distribution]:
    """All that `requirements` need, each and what it needs in turn, by canonical name: as it is installed in this
    environment, or in the one of the given folder.
    """
    paths = sys.path if environment is None else [str(path) for path in environment.glob("lib/python*/site-packages")]
    here = {canonicalize_name(package.name): package for package in reversed([*distributions(path=paths)])}
    found: dict[str, Distribution] = {}
    waiting = [Requirement(requirement) for requirement in requirements]
    seen: set[tuple[str, frozenset[str]]] = set()
    while waiting:
        wanted = waiting.pop()
        name = canonicalize_name(wanted.name)
        if (name, frozenset(wanted.extras)) in seen:
            continue
        seen.add((name, frozenset(wanted.extras)))
        if name not in here:
            needs = "pip install --constraint constraints.txt '.[all,dev]'" if environment is None else "make docs"
            raise SystemExit(f"{name} is not installed: {needs}")
        found[name] = here[name]
        waiting += _needed(found[name], wanted.extras)
    return found


def _needed(package: Distribution, extras: Iterable[str]) -> Iterator[Requirement]:
    for text in package.requires or []:
        requirement = Requirement(text)
        if requirement.marker is None or any(requirement.marker.evaluate({"extra": e}) for e in ("", *extras)):
            yield requirement
