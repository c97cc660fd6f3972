"""The wheel works on its own: installed into an empty environment, run from an empty folder, with no extra."""

from __future__ import annotations

import functools
import json
import os
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from dataclasses import dataclass
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any

import pytest
from conftest import made_once
from numba.core.caching import _CacheLocator
from packaging.utils import canonicalize_name
from places import ROOT

from supply.pins import installed

pytestmark = pytest.mark.slow

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]

# What a bare environment would not have: imported by its site, before anything else.
BLOCKER = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {absent}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocker())
"""


# Commands, from the standard input, each in a copy of the folder `studied`, by turns in one process: what it answers,
# and what it leaves in the folder, on the standard output. The study `small` is in its DB by then: figures of few lumps
# are drawn in half the time.
COMMANDS = """
import io, json, os, shutil, sys
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from metaid.cli import main

os.environ["DISPLAY"] = ":0"
base, done = Path.cwd(), []
storage = str(base / "studied" / "metaid.db")
for command in ("create two-link-tpe --name small --set trials=4", "run small --quiet"):
    with redirect_stdout(io.StringIO()), suppress(SystemExit):
        main(["study", *command.split(), "--storage", storage])
for number, command in enumerate(json.load(sys.stdin)):
    folder = base / f"command-{number}"
    shutil.copytree(base / "studied", folder)
    os.chdir(folder)
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        try:
            main(command)
        except SystemExit as end:
            status = end.code
    files = sorted(path.name for path in folder.iterdir())
    done.append({"status": status, "out": out.getvalue(), "err": err.getvalue(), "files": files})
json.dump(done, sys.stdout)
"""
WORK = (
    ["study", "show", "three-link"],
    ["study", "check", "three-link"],
    ["study", "validate", "three-link", "--pushes", "1", "-o", "tracking.png"],
    ["study", "report", "small", "-o", "report.html"],
    ["study", "export", "three-link", "-o", "trials.csv"],
    ["study", "create", "two-link-tpe"],
    ["study", "delete", "three-link", "--yes"],
    ["plant", "list"],
    ["plant", "draw", "three-link", "-o", "plant.png"],
    ["episode", "three-link", "-o", "angles.png"],
    ["estimate", "double-pendulum", "--nominal", "double-pendulum", "-o", "found.xml"],
)
NEEDS = {
    "dashboard": ["dashboard", "--port", "0"],
    "parquet": ["study", "export", "three-link", "-o", "trials.parquet"],
    "ros": ["estimate", "log.mcap", "--nominal", "double-pendulum"],
    "video": ["episode", "three-link", "-o", "e.png", "--video", "e.mp4"],
    "view": ["plant", "view", "three-link"],
    "postgresql": ["study", "list", "--storage", "postgresql://me:secret@127.0.0.1:1/studies"],
}
SHIPPED = (("plants", "*.toml"), ("studies", "*.toml"), ("plants/arms", "*.xml"), ("examples", "*.py"))
SHIPPED += (("logs/double-pendulum", "*"),)  # with its licence and citation
IDENTIFIED = ["study", "show", "three-link", "--json"]


@dataclass(frozen=True)
class Bare:
    """`metaid` in an environment without extras; it was run in an empty folder, in which it left the files `studied`.
    After each of the commands in copies of that folder `answers` has what it answered, and what files there were.
    """

    studied: list[str]
    answers: list[dict[str, Any]]

    def answer(self, command: list[str]) -> dict[str, Any]:
        """Exit status, output, errors and files."""
        return self.answers[[*WORK, *NEEDS.values(), IDENTIFIED].index(command)]


@functools.cache
def absent_modules() -> set[str]:
    """The top-level modules here that no hard dependency of metaid brings, nor a dependency of one in turn."""
    present = set(installed(PROJECT["dependencies"])) | {"metaid"}
    owners = packages_distributions()
    return {module for module, names in owners.items() if not present & {canonicalize_name(name) for name in names}}


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the checkout."""

    def build(folder: Path) -> None:
        command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
        subprocess.run(command, check=True, capture_output=True)

    return next(made_once(tmp_path_factory, "wheel", build).glob("*.whl"))


def keep_machine_code(site: Path) -> None:
    """Gives the installed package what the checkout's has compiled, for its sources are the same: that one compiles
    anew after a change is said in compiled/test_cache.py. numba asks for the time of a source, and names a folder by
    where it is.
    """

    def named(source: Path) -> str:
        return str(_CacheLocator.get_suitable_cache_subpath(str(source)))

    for source in (ROOT / "metaid").rglob("*.py"):
        shutil.copystat(source, site / source.relative_to(ROOT))
        for kept in (ROOT / "metaid").rglob(f"machine-code-*/{named(source)}"):
            there = site / kept.relative_to(ROOT).with_name(named(site / source.relative_to(ROOT)))
            shutil.copytree(kept, there, dirs_exist_ok=True)


@pytest.fixture(scope="session")
def bare(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Bare:
    """The study `three-link` was created and run by the installed command, and all the other commands were in a process
    of the environment. The hard dependencies are this environment's, by path; nothing else of it can be imported;
    metaid itself comes from the wheel alone.
    """

    def install(folder: Path) -> None:
        environment, studied = folder / "venv", folder / "studied"
        venv.create(environment, with_pip=False)
        pip = [sys.executable, "-m", "pip", "--python", str(environment / "bin" / "python")]
        command = [*pip, "install", "--quiet", "--no-deps", "--no-index", str(wheel)]
        subprocess.run(command, check=True, capture_output=True)
        site = next((environment / "lib").glob("python*/site-packages"))
        keep_machine_code(site)
        (site / "blocker.py").write_text(BLOCKER.format(absent=absent_modules()))
        paths = [path for path in sys.path if path.endswith("site-packages")]
        (site / "dependencies.pth").write_text("\n".join([*paths, "import blocker"]))
        studied.mkdir()
        clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "METAID"))}

        def run(where: Path, name: str, *arguments: str, given: str = "") -> str:
            program = [str(environment / "bin" / name), *arguments]
            done = subprocess.run(program, cwd=where, env=clean, input=given, capture_output=True, text=True)
            assert done.returncode == 0, done.stderr
            return done.stdout

        assert str(environment) in run(studied, "python", "-c", "import metaid; print(metaid.__file__)")
        run(studied, "metaid", "study", "run", "three-link", "--create")
        asked = json.dumps([*WORK, *NEEDS.values(), IDENTIFIED])
        (folder / "answers.json").write_text(run(folder, "python", "-c", COMMANDS, given=asked))

    folder = made_once(tmp_path_factory, "bare", install)
    studied = sorted(path.name for path in (folder / "studied").iterdir())
    return Bare(studied, json.loads((folder / "answers.json").read_text()))


def test_wheel_carries_plants_and_studies(wheel: Path) -> None:
    """All that are shipped, and no other."""
    shipped = {Path(name) for name in zipfile.ZipFile(wheel).namelist()}
    for kind, files in SHIPPED:
        there = {path.name for path in shipped if path.parent == Path("metaid", kind)}
        assert there == {path.name for path in (ROOT / kind).glob(files)}


def test_bare_environment_lacks_what_only_extras_bring() -> None:
    """Or the tests below would test nothing."""
    assert {"optuna_dashboard", "pyarrow", "psycopg", "imageio_ffmpeg", "OpenGL", "glfw"} <= absent_modules()


def test_bare_install_identifies_three_links_from_an_empty_folder(bare: Bare) -> None:
    """Created and run without any extra, the study finds every lump."""
    assert "three-link" in bare.answer(["plant", "list"])["out"]
    assert json.loads(bare.answer(IDENTIFIED)["out"])["max_error"] < 0.01


@pytest.mark.parametrize("command", WORK, ids=lambda command: " ".join(command[:2]))
def test_bare_install_does_all_that_needs_no_extra(bare: Bare, command: list[str]) -> None:
    """Tables, figures and reports come with the hard dependencies."""
    answer = bare.answer(command)
    assert answer["status"] == 0, answer["err"]


@pytest.mark.parametrize("extra", NEEDS)
def test_command_that_needs_an_extra_names_it_in_one_line(bare: Bare, extra: str) -> None:
    """Exit status 2, no traceback, and no file is made."""
    answer = bare.answer(NEEDS[extra])
    assert answer["status"] == 2
    assert answer["out"] == ""
    assert len(answer["err"].splitlines()) == 1
    assert "is not installed: python -m pip install " in answer["err"]
    assert answer["files"] == bare.studied


@pytest.mark.parametrize("extra", sorted(set(PROJECT["optional-dependencies"]) - {"all", "dev"}))
def test_extra_all_has_every_extra_of_a_user(extra: str) -> None:
    """`metaid[all]` names each of them."""
    (every,) = PROJECT["optional-dependencies"]["all"]
    assert extra in every.removeprefix("metaid[").removesuffix("]").split(",")
