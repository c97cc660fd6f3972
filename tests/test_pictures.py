"""Pictures of the documents show what their commands print now."""

from __future__ import annotations

import json
import runpy
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from browser import Browser
from conftest import Finished
from places import ROOT
from remembered import estimate_once

IMAGES = ROOT / "docs" / "images"
FAST = ("log", "terminal", "figures", "paper")  # parts that need neither a browser nor what renders


@pytest.fixture(scope="module")
def pictures() -> dict[str, Any]:
    """What docs/pictures.py defines."""
    return runpy.run_path(str(ROOT / "docs" / "pictures.py"))


@pytest.fixture(scope="module")
def record() -> dict[str, Any]:
    """What is stored of each picture."""
    stored: dict[str, Any] = json.loads((IMAGES / "said.json").read_text(encoding="utf-8"))
    return stored


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder, as docs/pictures.py has it: a study that several parts show is run by the first of them."""
    return tmp_path_factory.mktemp("pictures")


@pytest.fixture
def names(pictures: dict[str, Any], metaid: Callable[..., Finished], monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The names that its functions look up. Commands print the same in this process, where they need no start."""
    looked_up: dict[str, Any] = pictures["metaid"].__globals__

    def run(*arguments: str) -> str:
        done = metaid(*arguments)
        assert done.status == 0, done.err
        return done.out

    monkeypatch.setitem(looked_up, "metaid", run)
    return looked_up


def test_every_picture_is_the_one_whose_texts_are_stored(pictures: dict[str, Any], record: dict[str, Any]) -> None:
    """None is added, replaced or left behind without `docs/pictures.py`."""
    stored = {path.name: pictures["digest"](path) for path in IMAGES.iterdir() if path.name != "said.json"}
    assert stored == {name: row["sha256"] for name, row in record.items()}
    assert {name for name, row in record.items() if "said" not in row} == set(pictures["OF_BENCHMARKS"])


@pytest.mark.parametrize(
    ("now", "is_stale"),
    [("best 0.0103 Hz", False), ("best 0.01031 Hz", False), ("best 0.0203 Hz", True), ("least 0.0103 Hz", True)],
)
def test_picture_whose_text_is_another_is_stale(pictures: dict[str, Any], now: str, is_stale: bool) -> None:
    """A word, or a number beyond rounding."""
    record = {"a.svg": {"said": "best 0.0103 Hz"}}
    assert (pictures["stale"]("a.svg", now, None, record) is not None) is is_stale


def test_picture_that_looks_otherwise_is_stale(pictures: dict[str, Any]) -> None:
    """One is itself to the last pixel, and another one of another picture."""
    one, other = IMAGES / "paper-table1.png", IMAGES / "paper-table2.png"
    assert pictures["distance"](one, one) == 0.0
    assert pictures["distance"](one, other) > pictures["DISTANCE"]


@pytest.mark.slow
@pytest.mark.usefixtures("names")
@pytest.mark.parametrize("part", FAST)
def test_pictures_say_and_look_what_their_commands_make_now(
    part: str,
    pictures: dict[str, Any],
    record: dict[str, Any],
    tmp_path: Path,
    place: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Texts to rounding; pixels to a stated distance. Make them anew with `python docs/pictures.py PART`."""
    estimate_once(monkeypatch)
    if part != "terminal":  # which shows how studies are made
        monkeypatch.chdir(place)
    (tmp_path / "made").mkdir()
    made = dict(pictures["PARTS"][part](tmp_path / "made"))
    why = {name: pictures["stale"](name, said, tmp_path / "made" / name, record) for name, said in made.items()}
    assert {name: reason for name, reason in why.items() if reason} == {}


@pytest.mark.slow
@pytest.mark.usefixtures("names")
def test_films_are_of_the_lumps_that_their_studies_find_now(
    pictures: dict[str, Any], record: dict[str, Any], tmp_path: Path
) -> None:
    """By command and parameters, for a film has no text."""
    made = dict(pictures["films"](tmp_path, render=False))
    why = {name: pictures["stale"](name, said, None, record) for name, said in made.items()}
    assert {name: reason for name, reason in why.items() if reason} == {}


@pytest.mark.slow
@pytest.mark.usefixtures("few_candidates")
def test_pictures_of_pages_say_what_the_pages_say_now(
    pictures: dict[str, Any],
    record: dict[str, Any],
    tmp_path: Path,
    place: Path,
    monkeypatch: pytest.MonkeyPatch,
    names: dict[str, Any],
    browser: Browser,
) -> None:
    """The beginning of a report, and the note on the dashboard."""
    monkeypatch.chdir(place)
    monkeypatch.setitem(names, "open_browser", lambda profile: nullcontext(browser))  # one runs already
    # What a page looks like is not compared here: nobody waits until all of it is drawn.
    monkeypatch.setitem(names, "time", SimpleNamespace(sleep=lambda seconds: None))
    why = {name: pictures["stale"](name, said, None, record) for name, said in pictures["pages"](tmp_path)}
    assert {name: reason for name, reason in why.items() if reason} == {}
