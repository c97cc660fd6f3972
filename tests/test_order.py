"""The order of the packages: who may import whom, through which door, and what is not loaded."""

from __future__ import annotations

import ast
import functools
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from places import ROOT

pytestmark = pytest.mark.slow

PACKAGE = ROOT / "metaid"
# From the lowest to the highest; a package imports only those before it.
ORDER = (
    "errors",
    "files",
    "frames",
    "models",
    "plant",
    "exporting",
    "episode",
    "compiled",
    "estimation",
    "paper",
    "search",
    "store",
)
ORDER += ("study", "results", "recorded", "excitation", "show", "api", "cli")
PACKAGES = tuple(name for name in ORDER if (PACKAGE / name).is_dir())
SLOW = ("cmaes", "scipy.optimize", "scipy.stats")  # half of what a command took that only reads a DB
# What must not be loaded by importing a package.
ABSENT = {
    "models": ("mujoco", "numba", "ray", "optuna", "pandas", "metaid.files"),
    "plant": ("mujoco", "numba", "ray", "optuna", "pandas"),
    "exporting": ("mujoco", "numba", "ray", "optuna", "matplotlib", *SLOW),
    "episode": ("mujoco", "numba", "ray", "optuna", "pandas"),
    "compiled": ("ray", "optuna", "pandas"),
    "estimation": ("mujoco", "numba", "ray", "optuna", "pandas"),
    "paper": ("mujoco", "numba", "ray", "optuna", "pandas", "matplotlib"),
    "search": ("mujoco", "numba", "ray", *SLOW),
    "store": ("mujoco", "numba", "ray", "matplotlib", *SLOW),
    "study": ("mujoco", "numba", "ray", "matplotlib", *SLOW),
    "results": ("mujoco", "numba", "ray", "matplotlib", *SLOW),
    "recorded": ("mujoco", "numba", "ray", "matplotlib", *SLOW),
    "excitation": ("mujoco", "numba", "ray", "matplotlib", *SLOW),
    "show": ("mujoco", "numba", "ray", *SLOW),
    "show.figures": ("mujoco", "numba", "ray", *SLOW),
    "api": ("mujoco", "numba", "ray", "matplotlib", *SLOW),
    "cli": ("numpy", "mujoco", "numba", "ray", "optuna", "pandas", "matplotlib", *SLOW),
}
# Packages that one process imports one after the other: a start takes most of a second. What one must not load is not
# to be loaded by those before it either.
LINES = (
    (
        "cli",
        "exporting",
        "store",
        "study",
        "results",
        "recorded",
        "excitation",
        "api",
        "search",
        "show",
        "show.figures",
    ),
    ("models", "plant", "episode", "estimation", "compiled"),
    ("paper",),
)


def place(path: Path) -> list[str]:
    """The packages and the module that a file of metaid is: `metaid/study/run.py` → study, run."""
    parts = list(path.relative_to(PACKAGE).with_suffix("").parts)
    return parts[:-1] if parts[-1] == "__init__" else parts


def imports(path: Path) -> Iterator[tuple[int, list[str], list[str]]]:
    """Line, module and names of every import of metaid's own in a file, functions' own imports included."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "metaid":
            module = str(node.module).split(".")[1:]
            names = [alias.name for alias in node.names]
            if module:
                yield node.lineno, module, names
            else:  # from metaid import api
                yield from ((node.lineno, [name], []) for name in names)
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.startswith("metaid."):
                    yield node.lineno, alias.name.split(".")[1:], []


SOURCES = [path for path in sorted(PACKAGE.rglob("*.py")) if path.parent != PACKAGE or path.stem[0] != "_"]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: "/".join(place(path)))
def test_module_imports_only_from_packages_below_its_own(path: Path) -> None:
    """So that the folder listing is the architecture, and there is no circle of packages."""
    own = place(path)[0]
    for line, module, _ in imports(path):
        if module[0] != own:
            assert ORDER.index(module[0]) < ORDER.index(own), f"{path}:{line} imports metaid.{'.'.join(module)}"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: "/".join(place(path)))
def test_package_is_entered_through_its_face(path: Path) -> None:
    """Other packages import the few names of a package's `__init__`, not its modules."""
    own = place(path)
    for line, module, names in imports(path):
        if module[0] == own[0] or module[0] not in PACKAGES:
            continue
        assert (PACKAGE.joinpath(*module) / "__init__.py").exists(), (
            f"{path}:{line} looks into metaid.{'.'.join(module)}"
        )
        assert not [name for name in names if name.startswith("_")], f"{path}:{line} imports a private name"


@pytest.mark.parametrize("package", PACKAGES)
def test_modules_of_a_package_have_no_circle(package: str) -> None:
    """Within a package, too, imports point one way."""
    files = [path for path in SOURCES if place(path)[0] == package and path.stem != "__init__"]
    needs = {".".join(place(path)): {".".join(m) for _, m, _ in imports(path)} for path in files}
    left = dict(needs)
    while left:
        free = [name for name, others in left.items() if not others & (set(left) - {name})]
        assert free, f"these import one another in a circle: {', '.join(sorted(left))}"
        for name in free:
            del left[name]


@functools.cache
def loaded_by(line: tuple[str, ...]) -> dict[str, list[str]]:
    """What a process has loaded, of what each of these packages must not load, once it has imported it after those
    before it.
    """
    code = f"""
import importlib, json, sys
loaded = {{}}
for package, absent in {[(package, ABSENT[package]) for package in line]}:
    importlib.import_module(f"metaid.{{package}}")
    loaded[package] = [name for name in absent if name in sys.modules]
print(json.dumps(loaded))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    loaded: dict[str, list[str]] = json.loads(done.stdout)
    return loaded


@pytest.mark.parametrize("package", sorted(ABSENT))
def test_import_of_a_package_leaves_heavy_libraries_out(package: str) -> None:
    """What reads a DB does without MuJoCo and numba; what simulates does without Optuna."""
    (line,) = (line for line in LINES if package in line)
    for before in line[: line.index(package)]:  # or what is loaded could be that one's, and be right
        assert set(ABSENT[package]) <= set(ABSENT[before])
    assert loaded_by(line)[package] == []


def test_files_are_small_enough_to_be_seen() -> None:
    """Most are under 250 lines, and none over 400."""
    lengths = [len(path.read_text(encoding="utf-8").splitlines()) for path in SOURCES]
    assert sum(length <= 250 for length in lengths) >= 0.9 * len(lengths)
    assert max(lengths) <= 400


def test_map_for_newcomers_names_every_package_and_what_it_may_import() -> None:
    """CONTRIBUTING's table has a line for each package, in the order that the test above holds."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)/?(?:\.py)?` \|", text, flags=re.MULTILINE)
    assert tuple(rows) == ORDER
