"""The report of logs: what it says, that a browser shows all of it, and that its command makes it anew."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from browser import Browser
from conftest import Finished
from pages import ids_are_single, repeat, seen_everywhere
from places import ROOT

from metaid.cli.recorded.command import FIGURES

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]
ESTIMATE = ("estimate", "double-pendulum", "--nominal", "double-pendulum")


def test_browser_shows_what_logs_say_and_fetches_nothing(metaid: Metaid, browser: Browser) -> None:
    """On a phone, a tablet, a desk and on paper every joint, parameter and figure is there, and its command repeats
    it.
    """
    for name in ("run1.csv", "run2.csv"):  # two seconds of a log are enough, and faster
        rows = (ROOT / "logs" / "double-pendulum" / name).read_text(encoding="utf-8").splitlines(keepends=True)
        Path(name).write_text("".join(rows[:1000]), encoding="utf-8")
    asked = ("estimate", "run1.csv", "run2.csv", "--nominal", "double-pendulum", "--friction", "viscous,coulomb")
    told = metaid(*asked, "--report", "log.html", "-o", "found.py", "-o", "a-friction.svg", "--json")
    summary, page = json.loads(told.out), Path("log.html").resolve()
    assert Path("a-friction.svg").read_text(encoding="utf-8").count("joint 2") == 1
    assert ids_are_single(page)
    for text in seen_everywhere(browser, page, figures=len(FIGURES)):
        for row in summary["parameters"]:
            assert row["name"] in text
            assert f"{row['value']:.5g}" in text
        for log in summary["logs"]:
            assert log["path"] in text
        assert f"{summary['files'][0]['relative']:.1%}" in text
        for part in ("What was left out", "repairs", "What was tried", "How to repeat it"):
            assert part in text
    before = page.read_text(encoding="utf-8")
    repeat(metaid, page)
    assert page.read_text(encoding="utf-8") == before


def test_file_whose_name_is_no_figure_is_refused_before_anything_is_read(metaid: Metaid) -> None:
    """One line says which there are."""
    told = metaid(*ESTIMATE, "-o", "torques.pdf")
    assert told.status == 2
    assert told.out == ""
    assert "allowed: torque, friction, gravity, bodies" in told.err
