"""The cache of machine code: of the sources that run and no others, where it can be written, and small."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import metaid
from metaid.compiled.decorator import KEPT, cache_folder
from metaid.compiled.law import has_fallen

pytestmark = pytest.mark.slow

# A loop of its own in a package of metaid's, of which the law becomes a part.
LOOP = """
from metaid.compiled.decorator import compiled
from metaid.compiled.law import compensate

@compiled
def torques(law, links, speeds, torque):
    compensate(law, links, speeds, torque)
"""
ASK = """
import numpy as np
from metaid.compiled.law import LINK
from metaid.compiled.loop_of_a_test import torques

gravity, coriolis, friction = np.ones(2), np.eye(2), np.full(2, 0.02)
speeds, torque = np.array([1.0, -0.5]), np.zeros(2)
links = np.zeros(2, LINK)
for name in LINK.names:
    links[name] = 0.3
torques((gravity, coriolis, friction, friction, gravity, 0.0), links, speeds, torque)
print(torque.tolist())
"""


def test_change_of_a_source_that_is_compiled_into_another_changes_the_result(tmp_path: Path) -> None:
    """Gravity halved in the law, and another constant in `metaid.models`, are noticed by the next process."""
    package = tmp_path / "metaid"
    shutil.copytree(Path(metaid.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "compiled" / "loop_of_a_test.py").write_text(LOOP, encoding="utf-8")
    environment = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}

    def sent() -> str:
        command = [sys.executable, "-c", ASK]
        done = subprocess.run(
            command, env={**environment, "PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, cwd=tmp_path
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    seen = [sent()]
    changes = (
        ("compiled/law.py", "-gravity[i]", "-0.5 * gravity[i]"),
        ("models/law.py", "SLIDING = 0.1", "SLIDING = 3.0"),
    )
    for module, old, new in changes:
        source = (package / module).read_text(encoding="utf-8")
        assert source.count(old) == 1
        (package / module).write_text(source.replace(old, new), encoding="utf-8")
        seen.append(sent())
    assert len(set(seen)) == 3


def test_what_is_a_part_of_a_loop_can_be_called_by_python_as_well() -> None:
    """Neither takes the machine code that is kept of the other: that of a part has nothing for Python to call."""
    rest = 3.0, 2.0, 0.001, 0.5, 1.0  # of a link that is fast, and past the limit if it is farther than 0.5 rad

    @numba.njit  # type: ignore[untyped-decorator]
    def as_a_part(angle: float) -> bool:
        return has_fallen(angle, *rest)

    for angle, fallen in ((0.1, False), (3.0, True)):
        assert as_a_part(angle) == has_fallen(angle, *rest) == fallen


def test_change_in_the_package_around_another_changes_its_digest(tmp_path: Path) -> None:
    """`estimation/noisy` compiles what `estimation` has into its own loops, and code outside metaid what it likes."""
    package = tmp_path / "metaid"
    shutil.copytree(Path(metaid.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    code = f"""
from pathlib import Path
from metaid.compiled.decorator import digest

package = Path({str(package / "estimation")!r})
folders = package / "noisy", Path({str(tmp_path)!r})
before = [digest(folder) for folder in folders]
with (package / "motion.py").open("a", encoding="utf-8") as source:
    source.write("# changed\\n")
assert not {{*before}} & {{digest(folder) for folder in folders}}
"""
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, cwd=tmp_path)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of one module, and a folder for the user's own cache beside it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr("numba.config.CACHE_DIR", "")
    folder = tmp_path / "package"
    folder.mkdir()
    (folder / "module.py").write_text("number = 0\n")
    return folder


def folder_now(package: Path) -> Path | None:
    """What a new process would get."""
    cache_folder.cache_clear()
    return cache_folder(package)


def test_machine_code_of_a_package_that_cannot_be_written_to_is_in_the_users_cache(package: Path) -> None:
    """An installed package may belong to root; where nothing can be written to, nothing is kept."""
    inside = folder_now(package)
    assert inside is not None
    assert inside.parent == package / "__pycache__"
    shutil.rmtree(package / "__pycache__")
    (package / "__pycache__").touch()  # no folder can be made in a file, not by root either
    home = folder_now(package)
    assert home is not None
    assert home.parent == package.parent / "home" / "metaid"
    shutil.rmtree(home.parent)
    home.parent.touch()
    assert folder_now(package) is None


def test_folder_that_the_user_chose_for_numba_is_used(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`NUMBA_CACHE_DIR` comes first."""
    monkeypatch.setattr("numba.config.CACHE_DIR", str(package.parent / "chosen"))
    folder = folder_now(package)
    assert folder is not None
    assert folder.parent == package.parent / "chosen"


def test_folders_of_former_sources_do_not_pile_up(package: Path) -> None:
    """However often the sources change, a few folders are kept, the one in use among them."""
    folders = []
    for number in range(2 * KEPT):
        (package / "module.py").write_text(f"number = {number}\n")
        folder = folder_now(package)
        assert folder is not None
        os.utime(folder, (number, number))
        folders.append(folder)
    assert len(set(folders)) == 2 * KEPT
    assert sorted((package / "__pycache__").iterdir()) == sorted(folders[-KEPT:])


def test_same_sources_share_one_folder(package: Path) -> None:
    """The second process compiles nothing."""
    assert folder_now(package) == folder_now(package)
