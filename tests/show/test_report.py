"""The report of a real study: what it says, that it repeats the study, and that a browser shows all of it."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from browser import open_browser
from conftest import Finished

import metaid as package
from metaid.results import read_findings
from metaid.show.report import render
from metaid.store.database import Store
from metaid.study.create import create_study
from metaid.study.kinds import load_chain_study
from metaid.study.run import run_study

Metaid = Callable[..., Finished]
FIGURES = ("convergence", "factors", "ranges", "frequency", "boundary", "parallel", "correlation", "episode")
FIGURES += ("estimate-motion", "estimate-residuals", "estimate-correlation", "estimate-trials")


@pytest.fixture(scope="module")
def page(studied: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of the study `plain`."""
    written = tmp_path_factory.mktemp("report") / "plain.html"
    written.write_text(render(package.load_findings("plain", str(studied))), encoding="utf-8")
    return written


def test_browser_shows_lumps_figures_and_falls_and_fetches_nothing(page: Path, studied: Path, tmp_path: Path) -> None:
    """On a desk and on a phone, light and dark: every part is there, nothing comes from outside, no error."""
    summary = package.summary("plain", str(studied))
    with open_browser(tmp_path / "profile") as browser:
        for width, dark in ((1200, False), (390, True)):
            browser.look(page.as_uri(), width, dark)
            text = browser.text()
            for lump in summary["lumps"]:
                assert f"{lump['name']}" in text
                assert f"{lump['identified']:.5g}" in text
            assert f"{summary['trials']['pruned']} trials fell" in text
            for part in ("What was searched", "What could not be identified", "Cost", "How to repeat it"):
                assert part in text
            heights = "return [...document.querySelectorAll('figure svg')].map(s => s.getBoundingClientRect().height)"
            assert sum(height > 100 for height in browser.driver.execute_script(heights)) == 1 + len(FIGURES)
            sideways = "return document.documentElement.scrollWidth - window.innerWidth"
            assert browser.driver.execute_script(sideways) <= 0
            paper = browser.driver.execute_script("return getComputedStyle(document.body).backgroundColor")
            assert paper == ("rgb(22, 23, 27)" if dark else "rgb(255, 255, 255)")
            assert browser.fetched() == [page.as_uri()]
            assert browser.complaints() == []


@pytest.fixture(scope="module")
def hidden(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a study of a plant that does not tell its truth, without falls."""
    spec = load_chain_study("two-link-tpe", {"sampler": "output-error", "trials": 3})
    plant = spec.plant.model_copy(update={"truth_known": False})  # type: ignore[union-attr]
    folder = tmp_path_factory.mktemp("hidden")
    store = Store(str(folder / "metaid.db"), create=True)
    create_study(store, spec.model_copy(update={"plant": plant}), "hidden")
    run_study(store, "hidden")
    (folder / "hidden.html").write_text(render(read_findings(store, "hidden")), encoding="utf-8")
    store.close()
    return folder / "hidden.html"


def test_pages_are_whole_on_a_phone_a_tablet_a_desk_and_on_paper(page: Path, hidden: Path, tmp_path: Path) -> None:
    """Every figure is 200 pixels high at least, no text is cut or over another, and nothing is wider than the page."""
    with open_browser(tmp_path / "profile") as browser:
        for each in (page, hidden):
            for width, dark in ((360, False), (768, True), (1440, False)):
                browser.look(each.as_uri(), width, dark)
                assert browser.badly_laid_out() == [], (each.name, width)
            browser.print()
            assert browser.badly_laid_out() == [], (each.name, "print")


def test_plant_that_does_not_tell_its_truth_is_nowhere_on_the_page(hidden: Path) -> None:
    """Neither in the picture nor in the files; what is not drawn, and why, is said in place of an empty box."""
    text = html.unescape(hidden.read_text(encoding="utf-8"))
    readable = " ".join(re.sub("<[^>]+>", " ", re.sub(r"<style.*?</style>", "", text, flags=re.DOTALL)).split())
    links = load_chain_study("two-link-tpe").plant.links  # type: ignore[union-attr]
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
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    for name in FIGURES:
        assert f'id="figure-{name}"' in text


def test_its_files_and_command_repeat_the_study(metaid: Metaid, page: Path, studied: Path) -> None:
    """Saved and run as the page says, they give the same trials."""
    text = page.read_text()
    for name, content in re.findall(r'<pre class="file" data-name="([^"]+)">(.*?)</pre>', text, flags=re.DOTALL):
        Path(name).write_text(html.unescape(content))
    (commands,) = re.findall(r'<pre id="commands">(.*?)</pre>', text, flags=re.DOTALL)
    for command in html.unescape(commands).splitlines():
        assert metaid(*command.split()[1:]).status == 0
    assert package.trials("plain").equals(package.trials("plain", str(studied)))


def test_what_nothing_has_tested_is_not_found(metaid: Metaid) -> None:
    """The best trial of a count alone has no number in the report: the verdict says why, and each lump is named."""
    metaid("study", "create", "paper-two-link", "--set", "estimate.enabled=false")
    assert metaid("study", "run", "paper-two-link", "--quiet").status == 3
    assert metaid("study", "report", "paper-two-link", "-o", "count.html").status == 0
    page = Path("count.html").read_text()
    (section,) = re.findall(r'<section id="unidentified">.*?</section>', page, re.DOTALL)
    assert all(lump in section for lump in ("gravity_1", "gravity_2", "coriolis_1_2"))
    assert section.count("not found: see the verdict") == 3
    (verdict,) = re.findall(r'<p class="lead" id="verdict">.*?</p>', page, re.DOTALL)
    assert "Not found." in verdict
    assert "nothing has tested the model" in verdict


def test_names_and_descriptions_are_text_not_markup(metaid: Metaid) -> None:
    """A study from a stranger cannot put a script into the page."""
    evil = "<script>alert('$x$ & y')</script>"
    store = Store("evil.db", create=True)
    create_study(store, load_chain_study("one-link-count", {"description": evil, "trials": 30}), evil)
    run_study(store, evil)
    store.close()
    assert metaid("study", "report", evil, "--storage", "evil.db", "-o", "evil.html").status == 0
    text = Path("evil.html").read_text()
    assert "<script" not in text
    assert html.escape(evil, quote=False).replace("'", "&#39;") in text
