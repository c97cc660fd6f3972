"""Files and DBs from strangers can do no harm: they name nothing outside their folder, run nothing, show as text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Finished

Metaid = Callable[..., Finished]

LINK = "[[links]]\nlength = 0.5\nmass = 1.0\n"
STUDY = 'trials = 60\nplant = "{plant}"\nnominal = "{nominal}"\n'


@pytest.fixture
def secret(tmp_path: Path, metaid: Metaid) -> Path:
    """A plant file outside the folder `theirs`, which has one of its own, another in a sub-folder, and two links out
    of it.
    """
    outside = tmp_path / "secret.toml"
    outside.write_text(LINK)
    (tmp_path / "theirs" / "parts").mkdir(parents=True)
    for own in ("theirs/own.toml", "theirs/parts/arm.toml"):
        (tmp_path / own).write_text(LINK)
    (tmp_path / "theirs" / "link.toml").symlink_to(outside)
    (tmp_path / "theirs" / "way").symlink_to(tmp_path, target_is_directory=True)
    return outside


@pytest.mark.parametrize("key", ["plant", "nominal"])
@pytest.mark.parametrize(
    "name", ["../secret.toml", "parts/../../secret.toml", "ABSOLUTE", "link.toml", "way/secret.toml"]
)
def test_study_file_names_nothing_outside_its_folder(metaid: Metaid, secret: Path, key: str, name: str) -> None:
    """Not upwards, not from the root, not by a symbolic link; nothing of the file is told."""
    named = {"plant": "own.toml", "nominal": "own.toml", key: str(secret) if name == "ABSOLUTE" else name}
    Path("theirs/study.toml").write_text(STUDY.format(**named))
    answered = metaid("study", "create", "theirs/study.toml")
    assert answered.status == 2
    assert "outside the file's own folder" in answered.err
    assert answered.err.count("\n") == 1
    assert not Path("metaid.db").exists()


@pytest.mark.parametrize("plant", ["own.toml", "parts/arm.toml", "one-link"])
def test_study_file_names_what_is_in_its_folder_or_shipped(metaid: Metaid, secret: Path, plant: str) -> None:
    """Relative to the file, wherever the user is."""
    Path("theirs/study.toml").write_text(STUDY.format(plant=plant, nominal="own.toml"))
    assert metaid("study", "check", "theirs/study.toml").status == 0


def test_path_on_the_command_line_is_the_users_own(metaid: Metaid, secret: Path) -> None:
    """The user may use any file, by a relative or an absolute path."""
    Path("theirs/study.toml").write_text(STUDY.format(plant="own.toml", nominal="own.toml"))
    for path in ("secret.toml", str(secret)):
        assert metaid("study", "check", "theirs/study.toml", "--set", f"plant={path}").status == 0
        assert metaid("plant", "show", path).status == 0


def test_file_too_large_for_a_person_to_have_written_is_refused_unread(metaid: Metaid) -> None:
    """A disk's worth of comments takes neither memory nor time."""
    with Path("huge.toml").open("wb") as file:
        file.truncate(1 << 40)
    answered = metaid("plant", "show", "huge.toml")
    assert answered.status == 2
    assert "too large" in answered.err
