"""The report of a real study: what it says, that it repeats the study, and that a browser shows all of it."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from browser import Browser
from conftest import Finished
from pages import ids_are_single, repeat, seen_everywhere

import metaid as package
from metaid.results import read_findings
from metaid.show import report
from metaid.show.figures import Gallery
from metaid.show.pages import templates
from metaid.store import Store
from metaid.study import create_study, load_study, run_study

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]
FIGURES = (
    "convergence",
    "factors",
    "ranges",
    "frequency",
    "boundary",
    "parallel",
    "correlation",
    "episode",
    "tracking",
)
FIGURES += ("estimate-motion", "estimate-residuals", "estimate-correlation", "estimate-trials")
TRACKING = "tracking_rms_deg", "tracking_max_deg"
# What a browser says of what is in the middle of each mark that has a text, where that is on top.
POINTED_AT = """
return [...document.querySelectorAll('.wide title')].map(title => {
  title.parentElement.scrollIntoView({block: 'center'});
  const r = title.parentElement.getBoundingClientRect();
  const top = document.elementFromPoint(r.left + r.width / 2, r.top + r.height / 2);
  return top && title.parentElement.contains(top) ? title.textContent : '';
});
"""


@pytest.fixture(scope="module")
def page(studied: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of the study `plain`."""
    written = tmp_path_factory.mktemp("report") / "plain.html"
    written.write_text(report.render(package.load_findings("plain", str(studied))), encoding="utf-8")
    return written


def test_browser_shows_lumps_figures_and_falls_and_fetches_nothing(page: Path, studied: Path, browser: Browser) -> None:
    """On a phone, a tablet, a desk and on paper: every part is there and whole, nothing comes from outside."""
    summary = package.summary("plain", str(studied))
    for text in seen_everywhere(browser, page, figures=1 + len(FIGURES)):
        for lump in summary["lumps"]:
            assert f"{lump['name']}" in text
            assert f"{lump['identified']:.5g}" in text
        assert f"{summary['trials']['pruned']} trials fell" in text
        for part in ("What was searched", "What could not be identified", "Cost", "How to repeat it"):
            assert part in text
    browser.look(page.as_uri(), 1440)
    browser.driver.execute_script("document.querySelector('#search details').open = true")
    said = browser.driver.execute_script(POINTED_AT)
    assert f"trial {summary['best']['number']}: {summary['best']['value']:.4g} Hz" in said
    assert any(re.fullmatch(r"gravity_1: [\d.]+, from [\d.]+ to [\d.]+ kg m", text) for text in said)


@pytest.fixture(scope="module")
def hidden(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a study of a plant that does not tell its truth, without falls."""
    spec = load_study("two-link-tpe", {"sampler": "output-error", "trials": 3})
    plant = spec.plant.model_copy(update={"truth_known": False})  # type: ignore[union-attr]
    folder = tmp_path_factory.mktemp("hidden")
    store = Store(str(folder / "metaid.db"), create=True)
    create_study(store, spec.model_copy(update={"plant": plant}), "hidden")
    run_study(store, "hidden")
    (folder / "hidden.html").write_text(report.render(read_findings(store, "hidden")), encoding="utf-8")
    store.close()
    return folder / "hidden.html"


def test_page_without_falls_and_truth_is_whole(hidden: Path, browser: Browser) -> None:
    """It has fewer figures, and says what is not drawn."""
    assert all("What is not drawn" in text for text in seen_everywhere(browser, hidden, figures=13))


def test_plant_that_does_not_tell_its_truth_is_nowhere_on_the_page(hidden: Path) -> None:
    """Neither in the picture nor in the files; what is not drawn, and why, is said in place of an empty box."""
    text = html.unescape(hidden.read_text(encoding="utf-8"))
    readable = " ".join(re.sub("<[^>]+>", " ", re.sub(r"<style.*?</style>", "", text, flags=re.DOTALL)).split())
    links = load_study("two-link-tpe").plant.links  # type: ignore[union-attr]
    for link in links:
        assert f"mass {link.mass:.3g} kg" not in readable
        for said in (f"mass = {link.mass}", f"com = {link.com}", f"inertia = {link.inertia}"):
            assert not re.search(rf"{re.escape(said)}(?!\d)", readable)
    assert "Errors the plant does not tell its true lumps" in readable
    assert "Falls no trial fell" in readable
    assert "A plant whose truth is not told, drawn by the nominal model" in readable


def test_page_refers_to_nothing_outside(page: Path) -> None:
    """No script, no address to fetch, figures inline, no id twice."""
    text = page.read_text()
    assert "<script" not in text
    assert set(re.findall(r'(?:src|href)="([^#"][^"]{0,4})', text)) <= {"data:"}
    assert ids_are_single(page)
    for name in FIGURES:
        assert f'id="figure-{name}"' in text


def test_page_lists_its_sections_and_shows_the_files_that_repeat_it(page: Path) -> None:
    """Every heading is a link at the top; a reader copies the files as they stand there."""
    text = page.read_text(encoding="utf-8")
    headed = re.findall(r'<section id="([\w-]+)">\s*<h2>(.*?)</h2>', text)
    (contents,) = re.findall(r'<nav id="contents".*?</nav>', text)
    assert re.findall(r'<a href="#([\w-]+)">(.*?)</a>', contents) == headed
    assert len(headed) > 8
    assert text.count("<details open>") == text.count('<pre class="file"') == 2


def test_figures_of_the_page_are_as_wide_as_one_another(page: Path) -> None:
    """So their letters are of one size."""
    wide = re.findall(r'<div class="wide">.*?<svg .*?width="([\d.]+)pt"', page.read_text(), flags=re.DOTALL)
    assert len(wide) == 1 + len(FIGURES)
    assert set(wide) == {"504"}


@pytest.mark.parametrize("error", [1.5, None])
def test_dash_is_explained_where_control_was_lost_and_nowhere_else(error: float | None) -> None:
    """Below the table of a validation."""
    row = {"model": "nominal", "coasting_s": 0.1, "coasting_whole_horizon": 0}
    validation = {"pushes": 10, "horizon_s": 1.0, "models": [{**row, **dict.fromkeys(TRACKING, error)}]}
    shown = templates().get_template("parts.html").module.validation_table(validation, {"°": "deg"}, "law")
    assert ("control was lost" in shown) == ("–" in shown) == (error is None)


def test_its_files_and_command_repeat_the_study(metaid: Metaid, page: Path, studied: Path) -> None:
    """Saved and run as the page says, they give the same trials."""
    repeat(metaid, page)
    assert package.trials("plain").equals(package.trials("plain", str(studied)))


def test_what_nothing_has_tested_is_not_found(metaid: Metaid) -> None:
    """The best trial of a count alone has no number in the report: the verdict says why, and each lump is named."""
    metaid("study", "create", "paper-two-link", "--set", "estimate.enabled=false")
    assert metaid("study", "run", "paper-two-link", "--quiet").status == 3
    found = package.load_findings("paper-two-link")
    page = report.page(found, Gallery(found), [])
    (section,) = re.findall(r'<section id="unidentified">.*?</section>', page, re.DOTALL)
    assert all(lump in section for lump in ("gravity_1", "gravity_2", "coriolis_1_2"))
    assert section.count("not found: see the verdict") == 3
    (verdict,) = re.findall(r'<p class="lead" id="verdict">.*?</p>', page, re.DOTALL)
    assert "Not found." in verdict
    assert "Nothing has tested the model" in verdict
