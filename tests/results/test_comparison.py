"""Studies beside one another: a table, a figure and a page."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from browser import Browser
from conftest import Finished, matching_spec
from pages import seen_everywhere

from metaid.store import Store
from metaid.study import create_study, load_study, run_study

Metaid = Callable[..., Finished]


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DB with a study of a plant, one of the same plant with noise, one that was not run, and one of three links."""
    path = tmp_path_factory.mktemp("two") / "metaid.db"
    store = Store(str(path), create=True)
    for name, noisy in (("exact", False), ("noisy", True), ("new", False)):
        create_study(store, matching_spec(noisy=noisy), name)
        if name != "new":
            run_study(store, name)
    create_study(store, load_study("three-link"), "other")
    store.close()
    return path


@pytest.fixture
def compared(metaid: Metaid, two: Path) -> Metaid:
    """Compares studies of that DB."""
    shutil.copy(two, "metaid.db")
    return lambda *arguments: metaid("study", "compare", *arguments)


def test_comparison_has_what_each_study_took_and_found(compared: Metaid) -> None:
    """Its JSON and frames have the numbers of `study show`, lump by lump in the order of the studies."""
    import metaid as package

    shown = json.loads(compared("noisy", "exact", "new", "--json").out)
    assert [study["name"] for study in shown["studies"]] == ["noisy", "exact", "new"]
    exact = package.summary("exact")
    assert shown["studies"][1]["trials"] == exact["trials"]["total"]
    assert shown["studies"][1]["seconds"] > 0.0
    assert shown["studies"][2]["verdict"] == "unfinished"
    assert [lump["study"] for lump in shown["lumps"][:4]] == ["noisy", "exact", "new", "noisy"]
    found = [lump["identified"] for lump in shown["lumps"] if lump["study"] == "exact"]
    assert found == [lump["identified"] for lump in exact["lumps"]]
    frame = package.compare("noisy", "exact").lumps
    assert frame["name"].tolist()[:2] == ["gravity_1", "gravity_1"]


def test_comparison_is_a_table_a_figure_and_a_page(compared: Metaid) -> None:
    """The page needs no network and has the verdicts, the figure and the lumps of every study."""
    done = compared("exact", "new", "-o", "both.html")
    assert done.status == 0
    assert "new: 0 of 8 trials are done" in done.out
    page = Path("both.html").read_text(encoding="utf-8")
    for said in ("<b>exact: found.</b>", "<b>new: unfinished.</b>", "gravity_1", "<svg", "not found"):
        assert said in page
    assert "http:" not in page.replace("http://www.w3.org", "")
    assert "https:" not in page
    assert compared("exact", "new", "-o", "both.png").status == 0
    assert Path("both.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_page_of_a_comparison_is_whole(compared: Metaid, browser: Browser) -> None:
    """On a phone, a tablet, a desk and on paper, with a study that was not run among them."""
    assert compared("exact", "noisy", "new", "-o", "three.html").status == 0
    for text in seen_everywhere(browser, Path("three.html").absolute(), figures=1):
        assert "What each study took" in text


REFUSED = {
    "exact": "to compare: exact (allowed: 2 studies or more, each once)",
    "exact exact": "to compare: exact, exact (allowed: 2 studies or more, each once)",
    "exact other": "only studies of plants with the same joints can be compared",
    "exact none": "unknown study 'none'",
}


@pytest.mark.parametrize("names", REFUSED)
def test_what_cannot_be_compared_is_refused(compared: Metaid, names: str) -> None:
    """In one line."""
    done = compared(*names.split())
    assert (done.status, done.err.count("\n")) == (2, 1)
    assert REFUSED[names] in done.err
