"""The report of a study of an arm: what it says, that it repeats the study, and that a browser shows all of it."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from conftest import Finished
from pages import ids_are_single, repeat, seen_everywhere

import metaid as package
from metaid.cli import main
from metaid.results import Findings, read_findings, shown_rows
from metaid.show import render
from metaid.store import Store

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]
FIGURES = ("convergence", "factors", "known", "tracking", "parallel", "estimate-motion", "estimate-residuals")
FIGURES += ("estimate-correlation", "estimate-trials")


def findings(arms: Path, name: str) -> Findings:
    """Those of a study of an arm."""
    with closing(Store(str(arms))) as store:
        return read_findings(store, name)


@pytest.fixture(scope="module")
def page(arms: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of the study `exact`."""
    written = tmp_path_factory.mktemp("report") / "exact.html"
    written.write_text(render(findings(arms, "exact")), encoding="utf-8")
    return written


def test_browser_shows_an_arm_what_it_is_worth_and_its_figures(page: Path, arms: Path, browser: Browser) -> None:
    """On a phone, a tablet, a desk and on paper: every part is there and whole, nothing comes from outside."""
    summary = package.summary("exact", str(arms))
    for text in seen_everywhere(browser, page, figures=1 + len(FIGURES)):
        assert text.splitlines()[0] == "exact"
        assert "Found." in text
        for lump in shown_rows(summary):
            assert f"{lump['identified']:.5g}" in text
            assert lump["expression"] in text
        for part in ("gravity torque", "Coriolis torque", "mass matrix", "pushes that coast throughout"):
            assert part in text
        assert "What is not drawn" in text


@pytest.fixture(scope="module")
def bent(arms: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of the study `bent`, as the command writes it."""
    written = tmp_path_factory.mktemp("report") / "bent.html"
    with pytest.raises(SystemExit) as stop:
        main(["study", "report", "bent", "--storage", str(arms), "-o", str(written)])
    assert not stop.value.code
    return written


def test_page_of_an_arm_that_was_not_found_is_whole(bent: Path, browser: Browser) -> None:
    """On a phone, a tablet, a desk and on paper, with the figures that there are."""
    assert all("Not found." in text for text in seen_everywhere(browser, bent, figures=3))


def test_files_and_commands_of_a_report_repeat_the_study_of_an_arm(metaid: Metaid, page: Path, arms: Path) -> None:
    """Saved and run as the page says, they give the same trials; no id is there twice."""
    assert ids_are_single(page)
    assert len(repeat(metaid, page)) == 1
    assert package.trials("exact").equals(package.trials("exact", str(arms)))


def test_report_of_an_arm_that_was_not_found_has_no_number(bent: Path) -> None:
    """The verdict says why first, nothing was validated, and what is not drawn is said."""
    text = bent.read_text(encoding="utf-8")
    (verdict,) = re.findall(r'<p class="lead" id="verdict">.*?</p>', text, re.DOTALL)
    assert "Not found." in verdict
    assert "The model does not explain what was seen" in verdict
    (table,) = re.findall(r'<table id="lumps-table">.*?</table>', text, re.DOTALL)
    assert table.count("<b>not found</b>") == 22
    assert "Nothing was validated" in text
    assert "the verdict is &#39;not found&#39;" in text
    assert 'id="figure-estimate-motion"' in text
    assert 'id="figure-known"' not in text


@pytest.mark.parametrize("name", ["exact", "noisy"])
def test_replay_of_an_arm_is_what_was_seen_beside_the_twin(arms: Path, name: str) -> None:
    """To rounding on exact sensors, to their noise on noisy ones."""
    found = findings(arms, name)
    assert found.estimate is not None
    replay = found.estimate.replay()
    difference = (replay.simulated - replay.seen)[~np.isnan(replay.seen)]
    assert len(difference) > 100
    assert replay.joints == found.problem.nominal.names
    assert np.sqrt((difference**2).mean()) < (1e-9 if name == "exact" else 1.5 * replay.noise.max())
    moved = np.nanmax(replay.simulated, axis=1) - np.nanmin(replay.simulated, axis=1)
    assert moved.max() > 0.1
