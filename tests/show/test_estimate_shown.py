"""The estimate in the report, the dashboard's note and the figures; and that nothing is shown where none was found."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import metaid as package
from metaid.show import dashboard
from metaid.show.report import render

NOT_FOUND = "NOT FOUND: the model does not explain what was seen: misfit "


def words(name: str, estimated: Path) -> tuple[str, str]:
    """What the report says beside its figures and files, and the dashboard's note."""
    found = package.load_findings(name, str(estimated))
    page = re.sub(r"<style.*?</style>|<svg.*?</svg>|<pre.*?</pre>", "", render(found), flags=re.DOTALL)
    return " ".join(re.sub("<[^>]+>", " ", page).split()), dashboard.note(found)


@pytest.mark.parametrize("name", ["matched", "searched"])
def test_report_and_note_show_the_estimate_with_its_intervals(name: str, estimated: Path) -> None:
    """All nine lumps once, from how many trials, what the misfit means, and that low to high is an interval."""
    which = {"matched": "all 2 trials", "searched": "the first 32 trials"}[name]
    for text in words(name, estimated):
        assert f"Estimate from {which}: the model explains what was seen: misfit " in text
        assert "ow and high are the 95 % interval" in text
        for lump in package.estimate(name, str(estimated)).to_dict("records"):
            assert lump["name"] in text
            assert f"{lump['identified']:.5g}" in text


@pytest.mark.parametrize("name", ["hidden", "hidden-searched"])
def test_report_and_note_show_no_lump_of_an_estimate_that_explains_nothing(name: str, estimated: Path) -> None:
    """They say that it was not found and why; no interval, no error of it, no inertia lump."""
    for text in words(name, estimated):
        assert NOT_FOUND in text
        assert "95 %" not in text
        shown = re.findall(r"inertia_\d`? \|? ?([\d.]+) ?\|? (\S+)", text)
        assert [identified for _, identified in shown] == (["–"] * 3 if name == "hidden" else [])
    if name == "hidden":
        page, _ = words(name, estimated)
        assert "The largest error" not in page
        assert "every lump within" not in page
        assert "not found: the model does not explain what was seen" in page
