"""The site: what its pages are made of, and that a browser shows them whole, without a network."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import pytest
from browser import Browser, wait_for
from places import ROOT

import metaid

pytestmark = pytest.mark.slow

LONG = ("api.html", "docs/reference.html", "docs/method.html", "notebooks/03-analyse-a-study.html")
ANSWERS = {
    "ROS": "docs/ur5e.html",
    "UR5e": "docs/ur5e.html",
    "joint_states": "docs/ur5e.html",
    "Arduino": "docs/microcontroller.html",
    "friction": "docs/friction.html",
    "which command": "docs/which-command.html",
    "runaway": "docs/method.html",
}
# Texts, tables and pictures that are cut: wider than the page, and not in a place that scrolls.
CUT = """
const scrolls = e => e && e !== document.body && (['auto', 'scroll'].includes(getComputedStyle(e).overflowX)
  || scrolls(e.parentElement));
return [...document.querySelectorAll('article :is(table, pre, p, img, h1, h2)')].filter(e =>
  e.getBoundingClientRect().right > document.documentElement.clientWidth + 1 && !scrolls(e)).map(e => e.outerHTML);
"""


@pytest.fixture(scope="module")
def pages() -> dict[str, Any]:
    """What docs/pages.py defines."""
    return runpy.run_path(str(ROOT / "docs" / "pages.py"))


def test_page_says_what_it_says_on_github(pages: dict[str, Any]) -> None:
    """Comments go, a list may follow a line of text, headings keep their anchors, and blocks of code are left alone."""
    block = "```toml\n# a.toml\nx\n- y\n```\n"
    text = f"# Use it … now\n<!-- printed by: x -->\nThree:\n- one\n\n{block}[n](../notebooks/1-a.ipynb)\n"
    shown = f"# Use it … now {{: #use-it--now }}\nThree:\n\n- one\n\n{block}[n](../notebooks/1-a.md)\n"
    assert pages["page"](text) == shown


def test_notebook_is_a_page_with_its_stored_outputs(pages: dict[str, Any]) -> None:
    """Text, code, what was printed, tables and pictures, in order."""
    outputs = [
        {"text": ["a < b\n"]},
        {"data": {"text/html": ["<table>\n", "</table>"], "text/plain": ["no"]}},
        {"data": {"image/png": "aGVsbG8=", "text/plain": ["no"]}},
    ]
    cells = [{"cell_type": "markdown", "source": ["# T"]}, {"cell_type": "code", "source": ["f()"], "outputs": outputs}]
    text, pictures = pages["notebook"]({"cells": cells}, "n")
    assert text == (
        '# T\n\n```python\nf()\n```\n\n<pre class="printed">a &lt; b\n</pre>\n\n'
        '<div class="printed"><table></table></div>\n\n![What the cell above draws](n-1.png)\n'
    )
    assert pictures == {"n-1.png": b"hello"}


def test_every_public_name_is_on_the_page_of_calls(pages: dict[str, Any]) -> None:
    """Each once, `figures` as the module that it is."""
    source = (ROOT / "metaid" / "__init__.py").read_text()
    named = [line.removeprefix("::: ") for line in pages["api"](source).splitlines() if line.startswith("::: ")]
    assert sorted(named) == sorted(
        {f"metaid.{name}" for name in metaid.__all__} - {"metaid.figures"} | {"metaid.show.figures"}
    )


def test_equations_are_typeset(site: Path) -> None:
    """Each block of LaTeX is MathML, which needs no script, and indices are below."""
    text = (site / "docs" / "method.html").read_text(encoding="utf-8")
    assert text.count("<math") == (ROOT / "docs" / "method.md").read_text(encoding="utf-8").count("```math")
    assert "\\sum" not in text
    assert "φ<sub>i</sub>" in text


def test_browser_shows_the_site_whole_and_fetches_nothing(site: Path, browser: Browser) -> None:
    """On a phone and on a desk, dark and light, opened as files: nothing is cut, and no error."""
    for name in LONG:
        for width, dark in ((360, True), (1440, False)):
            browser.look((site / name).as_uri(), width, dark)
            assert browser.driver.execute_script(CUT) == [], (name, width)
            sideways = "return document.documentElement.scrollWidth - window.innerWidth"
            assert browser.driver.execute_script(sideways) <= 0, (name, width)
            assert [url for url in browser.fetched() if not url.startswith(site.as_uri())] == []
            assert browser.complaints() == []
            paper = browser.driver.execute_script("return getComputedStyle(document.body).backgroundColor")
            assert (paper == "rgb(255, 255, 255)") is not dark


def test_search_has_the_right_page_first(site: Path, browser: Browser) -> None:
    """For what somebody types who has a machine, and has read nothing."""
    links = "return [...document.querySelectorAll('.md-search-result__item > a')].map(each => each.href)"
    for asked, page in ANSWERS.items():
        browser.look((site / "index.html").as_uri(), 1440)
        browser.driver.find_element("css selector", "input[name=query]").send_keys(asked)
        wait_for(browser, "matching document")
        assert browser.driver.execute_script(links)[0].startswith((site / page).as_uri()), asked
