"""SIGINT and SIGTERM end a command while a compiled loop runs, which comes back to Python in minutes only."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Finished
from forked import Command

from metaid.store import Store

pytestmark = pytest.mark.slow

LONGEST = 10_000_000  # steps: what an episode may have; of ten links they take 20 s
FAR_LESS = 8.0  # s
BEGUN = 1.5  # s of processor time


def started(folder: Path, *arguments: str) -> Command:
    """A command in a folder, once it has computed for far longer than it takes to begin."""
    process = Command(folder, *arguments, first=f"import os; os.chdir({str(folder)!r})")
    while _cpu_seconds(process.pid) < BEGUN:
        time.sleep(0.1)
        assert process.poll() is None, process.err
    return process


def ended(process: Command, number: signal.Signals) -> str:
    """What a command that gets a signal says last on stderr; it ends at once, with the status of that signal."""
    process.send(number)
    assert process.wait(FAR_LESS) == 128 + number, process.err
    assert "Traceback" not in process.err
    return process.err.strip()


def _cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_long_episode_ends_at_once(tmp_path: Path) -> None:
    """Nothing is printed but what click says of a command that was left."""
    assert ended(started(tmp_path, "episode", "ten-link", "--steps", str(LONGEST)), signal.SIGINT) == ""


def test_run_of_long_episodes_ends_at_once_and_loses_nothing(metaid: Callable[..., Finished], tmp_path: Path) -> None:
    """Trials of before are in the DB, whoever runs it next finds it free, and a line says how to go on."""
    asked = {"trials": 100, "sampler": "random", "search.generation": 2, "episode.pushes": [[0.01, 0.0, 0.0]]}
    changes = [f"--set={key}={value}" for key, value in {**asked, "episode.steps": LONGEST}.items()]
    assert metaid("study", "create", "three-link-coast", *changes).status == 0
    for number in (signal.SIGINT, signal.SIGTERM):
        # Quiet: on a busy machine a line of progress is due before the signal comes.
        said = ended(started(tmp_path, "study", "run", "three-link-coast", "--quiet"), number)
        trials = Store(str(tmp_path / "metaid.db")).count("three-link-coast")
        go_on = "go on with: metaid study run three-link-coast"
        assert said == f"stopped; {trials} trials are in metaid.db; {go_on}"


def test_last_words_are_said_once_by_a_command_that_takes_long_to_end_by_itself() -> None:
    """It says them, and the thread that ends it a moment later does not say them again."""
    lines = (
        "import time",
        "from metaid.cli.interrupted import Interruption",
        "with Interruption() as interruption:",
        "    interruption.defer(lambda: print('stopped', flush=True))",
        "    print('ready', flush=True)",
        "    try:",
        "        time.sleep(60)",
        "    except KeyboardInterrupt:",
        "        interruption.say_last_words()",
        "        time.sleep(60)",
    )
    command = [sys.executable, "-c", "\n".join(lines)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=FAR_LESS)
    assert process.returncode == 128 + signal.SIGINT
    assert said == "stopped\n"
