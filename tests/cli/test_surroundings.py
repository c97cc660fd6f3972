"""What surrounds a command and is not as it should be: one clear line and exit status 2, or it works all the same."""

from __future__ import annotations

import json
import os
import socket
import subprocess
from pathlib import Path

import pytest
from places import METAID, ROOT

from metaid.errors import StudyError
from metaid.study import Problem, load_study
from metaid.study.evaluation import RayEvaluator

pytestmark = pytest.mark.slow

FULL = Path("/dev/full")


def ran(
    *arguments: str, cwd: Path = ROOT, out: Path | None = None, err: Path | None = None, **more: str
) -> subprocess.CompletedProcess[bytes]:
    """A command in a process of its own, its output to these files, with `more` in its environment."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **more}
    with open(out or os.devnull, "wb") as to_out, open(err or os.devnull, "wb") as to_err:
        return subprocess.run(
            [*METAID, *arguments],
            cwd=cwd,
            env=environment,
            stdout=to_out if out else subprocess.PIPE,
            stderr=to_err if err else subprocess.PIPE,
        )


def refused(done: subprocess.CompletedProcess[bytes]) -> str:
    """What a command said that could not do its work: one line, status 2."""
    said = done.stderr.decode()
    assert (done.returncode, said.count("\n")) == (2, 1), said
    return said


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
@pytest.mark.parametrize("arguments", [["plant", "list"], ["plant", "show", "two-link", "--json"], ["--help"]])
def test_full_device_is_said_in_a_line(arguments: list[str]) -> None:
    """Tables, JSON and help alike."""
    assert refused(ran(*arguments, out=FULL)) == "metaid: standard output: No space left on device\n"


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
def test_full_device_of_messages_leaves_the_exit_status(tmp_path: Path) -> None:
    """There is nowhere left to say what is wrong."""
    assert ran("plant", "show", "nosuch", err=FULL).returncode == 2


@pytest.mark.parametrize("arguments", [["plant", "list"], ["plant", "show", "two-link", "--json"]])
def test_reader_that_has_had_enough_ends_a_command_in_silence(arguments: list[str]) -> None:
    """As `head` does: no complaint, and status 1."""
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([*METAID, *arguments], cwd=ROOT, stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, b"")


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_output_without_codes_for_all_letters_writes_them_out(encoding: str) -> None:
    """The table has its numbers, and JSON is JSON."""
    shown = ran("plant", "show", "two-link", PYTHONIOENCODING=encoding)
    assert shown.returncode == 0
    assert "coriolis_1_2" in shown.stdout.decode(encoding)
    found = json.loads(ran("plant", "show", "two-link", "--json", PYTHONIOENCODING=encoding).stdout)
    assert found["lumps"][-1]["unit"] == "kg m²"


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("NUMBA_DISABLE_JIT", "1", "NUMBA_DISABLE_JIT is set"),
        ("MUJOCO_GL", "nonsense", "invalid value for environment variable MUJOCO_GL: nonsense (allowed: egl, osmesa"),
    ],
)
def test_setting_of_a_library_that_it_cannot_work_with_is_named(name: str, value: str, message: str) -> None:
    """Where the library is needed; what does without it works."""
    assert message in refused(ran("episode", "one-link", "--steps", "10", **{name: value}))
    assert ran("plant", "show", "one-link", **{name: value}).returncode == 0


def closed_port() -> int:
    """A port of this machine at which nothing listens."""
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        return int(held.getsockname()[1])


@pytest.mark.parametrize("address", ["127.0.0.1:{}", "ray://127.0.0.1:{}", "nosuch.invalid:{}", "127.0.0.1:9{}"])
def test_ray_address_where_nothing_listens_is_refused_and_not_waited_for(address: str) -> None:
    """Ray by itself would try for minutes."""
    named = address.format(closed_port())
    with pytest.raises(StudyError, match=r"no Ray cluster at .*: nothing answers there"):
        RayEvaluator(Problem(load_study("one-link-count")), 1, named)


def test_token_of_a_cluster_is_not_asked_of_a_ray_that_is_started_later(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would refuse the process that started it, if that had a Ray without one before."""
    monkeypatch.setenv("RAY_AUTH_TOKEN", "0" * 64)
    monkeypatch.delenv("RAY_AUTH_MODE", raising=False)
    with pytest.raises(StudyError, match="nothing answers there"):
        RayEvaluator(Problem(load_study("one-link-count")), 1, f"127.0.0.1:{closed_port()}")
    assert "RAY_AUTH_MODE" not in os.environ
