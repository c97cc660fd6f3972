"""What is shown while a study runs: on a terminal, elsewhere, and with --quiet."""

from __future__ import annotations

import io
import os
import pty
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numba
import pytest
from conftest import Finished
from rich.console import Console

from metaid.cli import live
from metaid.store import Store
from metaid.study import run_study

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]


def test_terminal_shows_bar_rate_falls_best_step_size_time_left_and_lumps(metaid: Metaid) -> None:
    """In a real pseudo-terminal, all of it is on the screen at some time, and the bar is gone at the end."""
    metaid("study", "create", "three-link-coast", "--set", "search.coordinates=plain", "--set", "search.start=1.4")
    program = [sys.executable, "-c", "from metaid.cli import main; main()", "study", "run", "three-link-coast"]
    ours, theirs = pty.openpty()
    clean = {**os.environ, "COLUMNS": "100", "LINES": "40", "TERM": "xterm"}
    child = subprocess.Popen(program, stdout=subprocess.PIPE, stderr=theirs, env=clean, text=True)
    os.close(theirs)
    seen = b""
    try:
        while chunk := os.read(ours, 65536):
            seen += chunk
    except OSError:  # how Linux says that the other side has closed
        pass
    assert child.stdout is not None
    out = child.stdout.read()
    child.stdout.close()
    assert child.wait() == 0
    os.close(ours)
    screen = seen.decode()
    for part in ("/600", "trials/s", "falls", "best ", "step size", "left", "error", "moved lately", "coriolis_2_3"):
        assert part in screen
    assert "identified" in out


def test_elsewhere_plain_lines_at_intervals(metaid: Metaid, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line each, with the same numbers and no control characters; not more often than the interval."""
    metaid("study", "create", "three-link-coast")
    monkeypatch.setattr(live, "INTERVAL", 0.0)
    store, written = Store("metaid.db"), io.StringIO()
    console = Console(file=written, markup=False, highlight=False)
    with live.Live(store, "three-link-coast", False, console) as shown:
        run_study(store, "three-link-coast", 100, watch=shown.update)
        monkeypatch.setattr(live, "INTERVAL", 1e9)
        lines = written.getvalue().splitlines()
        run_study(store, "three-link-coast", 200, watch=shown.update)
    store.close()
    assert len(lines) > 5
    assert lines[-1].startswith("three-link-coast 100/100 ")
    assert "falls, best" in lines[-1]
    assert "\x1b" not in written.getvalue()
    assert written.getvalue().splitlines() == lines


def test_terminal_says_that_loops_are_compiled(metaid: Metaid) -> None:
    """Which takes half a minute the first time, and nothing else moves meanwhile."""
    metaid("study", "create", "three-link-coast")
    store, written = Store("metaid.db"), io.StringIO()
    with live.Live(store, "three-link-coast", False, Console(file=written, force_terminal=True, width=100)) as shown:
        for number in range(100):
            numba.njit(lambda x, shift=number: x + shift)(1.0)
            if "compiling" in written.getvalue():
                break
    store.close()
    assert "compiling, the first time on this machine" in written.getvalue()
    assert shown.trials == 0


def test_output_error_shows_the_largest_deviation_of_a_lump(metaid: Metaid, monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes no steps: its spread is that of the estimate, and the word says so."""
    metaid("study", "create", "three-link-coast", "--set", "sampler=output-error")
    monkeypatch.setattr(live, "INTERVAL", 0.0)
    store, written = Store("metaid.db"), io.StringIO()
    with live.Live(store, "three-link-coast", False, Console(file=written, markup=False, highlight=False)) as shown:
        run_study(store, "three-link-coast", watch=shown.update)
    store.close()
    assert ", largest deviation " in written.getvalue().splitlines()[-1]
    assert "step size" not in written.getvalue()


def test_quiet_shows_nothing_while_it_runs(metaid: Metaid) -> None:
    """Not a word on stderr."""
    metaid("study", "create", "three-link-coast")
    ran = metaid("study", "run", "three-link-coast", "--trials", "50", "--quiet")
    assert (ran.status, ran.err) == (0, "")
    assert Path("metaid.db").exists()
