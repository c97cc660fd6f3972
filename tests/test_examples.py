"""The short programs of examples/ run as they stand, in an empty folder, and print what they promise."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest
from places import ROOT
from remembered import estimate_once

LINES = 25
PRINT = {
    "log": "found.xml, loaded by MuJoCo, is 8.3% off",
    "arm_log": "the third run, to which nothing was fitted: 0.23% off",
    "pushes": "with the identified model it coasts for 19.9 s",
    "plain_optuna": "inertia_2  0.04022     0.03950  0.03950",
    "rig": "listening at unix:rig.sock",
    "into_mujoco": "found.xml has the torques of the model to",
}


@pytest.mark.parametrize("name", PRINT)
def test_example_is_short(name: str) -> None:
    """One screen, with its docstring."""
    assert len((ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8").splitlines()) <= LINES


@pytest.mark.slow
@pytest.mark.parametrize("name", PRINT)
def test_example_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """It prints the line that says what came of it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("METAID_STORAGE", raising=False)
    estimate_once(monkeypatch)
    runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    assert PRINT[name] in capfd.readouterr().out
