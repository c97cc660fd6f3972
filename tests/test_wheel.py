"""The wheel works on its own: installed into an empty environment, run from an empty folder, with no extra."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
import venv
import zipfile
from dataclasses import dataclass
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

from supply.pins import installed

ROOT = Path(__file__).parent.parent
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


@dataclass(frozen=True)
class Bare:
    """`metaid` in an environment without extras, run in an empty `folder`."""

    bin: Path
    folder: Path

    def __call__(self, *command: str, **variables: str) -> subprocess.CompletedProcess[str]:
        """Runs a program of the environment."""
        clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "METAID"))}
        program = [str(self.bin / command[0]), *command[1:]]
        return subprocess.run(program, cwd=self.folder, env={**clean, **variables}, capture_output=True, text=True)


def absent_modules() -> set[str]:
    """The top-level modules here that no hard dependency of metaid brings, nor a dependency of one in turn."""
    present = set(installed(PROJECT["dependencies"])) | {"metaid"}
    owners = packages_distributions()
    return {module for module, names in owners.items() if not present & {canonicalize_name(name) for name in names}}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def bare(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Bare:
    """With the study `three-link`, run. The hard dependencies are this environment's, by path; nothing else of it can
    be imported; metaid itself comes from the wheel alone.
    """
    environment = tmp_path_factory.mktemp("bare") / "venv"
    venv.create(environment, with_pip=False)
    pip = [sys.executable, "-m", "pip", "--python", str(environment / "bin" / "python")]
    subprocess.run([*pip, "install", "--quiet", "--no-deps", "--no-index", str(wheel)], check=True, capture_output=True)
    site = next((environment / "lib").glob("python*/site-packages"))
    (site / "blocker.py").write_text(BLOCKER.format(absent=absent_modules()))
    paths = [path for path in sys.path if path.endswith("site-packages")]
    (site / "dependencies.pth").write_text("\n".join([*paths, "import blocker"]))
    bare = Bare(environment / "bin", tmp_path_factory.mktemp("empty"))
    assert str(environment) in bare("python", "-c", "import metaid; print(metaid.__file__)").stdout
    for command in ("create", "run"):
        done = bare("metaid", "study", command, "three-link")
        assert done.returncode == 0, done.stderr
    return bare


def test_wheel_carries_plants_and_studies(wheel: Path) -> None:
    """All that are shipped, and no other."""
    shipped = {Path(name) for name in zipfile.ZipFile(wheel).namelist()}
    for kind in ("plants", "studies"):
        there = {path.name for path in shipped if path.parent.name == kind}
        assert there == {path.name for path in (ROOT / kind).glob("*.toml")}


def test_bare_environment_lacks_what_only_extras_bring() -> None:
    """Or the tests below would test nothing."""
    assert {"optuna_dashboard", "pyarrow", "psycopg", "imageio_ffmpeg", "OpenGL", "glfw"} <= absent_modules()


def test_bare_install_identifies_three_links_from_an_empty_folder(bare: Bare) -> None:
    """Created and run without any extra, the study finds every lump."""
    assert "three-link" in bare("metaid", "plant", "list").stdout
    shown = bare("metaid", "study", "show", "three-link", "--json")
    assert json.loads(shown.stdout)["max_error"] < 0.01


@pytest.mark.parametrize(
    "command",
    [
        ["study", "show", "three-link"],
        ["study", "check", "three-link"],
        ["study", "validate", "three-link", "--pushes", "1", "-o", "tracking.png"],
        ["study", "report", "three-link", "-o", "report.html"],
        ["study", "export", "three-link", "-o", "trials.csv"],
        ["study", "create", "two-link-tpe"],
        ["study", "delete", "two-link-tpe", "--yes"],
        ["plant", "draw", "three-link", "-o", "plant.png"],
        ["episode", "three-link", "-o", "angles.png"],
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_bare_install_does_all_that_needs_no_extra(bare: Bare, command: list[str]) -> None:
    """Tables, figures and reports come with the hard dependencies."""
    done = bare("metaid", *command)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("extra", "command"),
    [
        ("dashboard", ["dashboard", "--port", "0"]),
        ("parquet", ["study", "export", "three-link", "-o", "trials.parquet"]),
        ("video", ["episode", "three-link", "-o", "e.png", "--video", "e.mp4"]),
        ("view", ["plant", "view", "three-link"]),
        ("postgresql", ["study", "list", "--storage", "postgresql://me:secret@127.0.0.1:1/studies"]),
    ],
)
def test_command_that_needs_an_extra_names_it_in_one_line(bare: Bare, extra: str, command: list[str]) -> None:
    """Exit status 2, no traceback, and no file is made."""
    before = sorted(path.name for path in bare.folder.iterdir())
    done = bare("metaid", *command, DISPLAY=":0")
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert f"is not installed: pip install 'metaid[{extra}]'" in done.stderr
    assert sorted(path.name for path in bare.folder.iterdir()) == before


@pytest.mark.parametrize("extra", sorted(set(PROJECT["optional-dependencies"]) - {"all", "dev"}))
def test_extra_all_has_every_extra_of_a_user(extra: str) -> None:
    """`metaid[all]` names each of them."""
    (every,) = PROJECT["optional-dependencies"]["all"]
    assert extra in every.removeprefix("metaid[").removesuffix("]").split(",")
