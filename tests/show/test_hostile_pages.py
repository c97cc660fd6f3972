"""What a browser makes of a study whose every text is a script, and who listens where: loopback alone."""

from __future__ import annotations

import http.client
import os
import re
import shutil
import urllib.parse
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from browser import Browser, served, wait_for
from conftest import Finished
from listeners import listening

from metaid.results import read_findings
from metaid.show import dashboard
from metaid.store import Store
from metaid.study import create_study, load_study, run_study

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]

SCRIPT = "<script>document.title = 'owned'</script>"
IMAGE = "<img src=x onerror=\"document.title = 'owned'\">"
LINK = "[click](javascript:document.title='owned')"
MATHS = "$x$ & 'y'"
EVIL = f"{SCRIPT}{IMAGE}"
OWNED = "return document.title == 'owned' || document.querySelector('img[src=x]') !== null"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DB with a study whose name, plant's name and descriptions are markup, and a note of the stranger's own."""
    path = tmp_path_factory.mktemp("evil") / "evil.db"
    store = Store(str(path), create=True)
    spec = load_study("one-link-count", {"description": f"{EVIL} {LINK} {MATHS}", "trials": 30})
    plant = spec.plant.model_copy(update={"description": EVIL})
    create_study(store, spec.model_copy(update={"plant_name": EVIL, "plant": plant}), EVIL)
    run_study(store, EVIL)
    create_study(store, spec, "noted")
    store.optuna.set_study_system_attr(store.optuna.get_study_id_from_name("noted"), "dashboard:note_ver", 1)
    text = f"# seen\n\n{SCRIPT}\n\n{IMAGE}\n\n{LINK}\n\n<svg onload=\"document.title = 'owned'\"></svg>"
    store.optuna.set_study_system_attr(store.optuna.get_study_id_from_name("noted"), "dashboard:note_str:0", text)
    store.close()
    return path


@pytest.fixture
def evil(made: Path, tmp_path: Path) -> Path:
    """A copy of it: the dashboard writes notes into a DB that it serves."""
    return Path(shutil.copy(made, tmp_path / "evil.db"))


def test_report_of_a_study_named_as_a_script_runs_none(metaid: Metaid, evil: Path, browser: Browser) -> None:
    """Name, plant's name and descriptions are read as they are, in a real browser, and are no markup in the file."""
    assert metaid("study", "report", EVIL, "--storage", str(evil), "-o", "evil.html").status == 0
    text = Path("evil.html").read_text()
    assert "<script" not in text
    assert "&lt;script&gt;" in text
    browser.look(Path("evil.html").absolute().as_uri())
    assert browser.text().count(EVIL) >= 3
    assert MATHS in browser.text()
    assert not browser.driver.execute_script(OWNED)
    assert browser.driver.execute_script("return document.scripts.length") == 0
    assert len(browser.fetched()) == 1


def test_dashboard_of_a_study_named_as_a_script_runs_none(evil: Path, browser: Browser) -> None:
    """Its list, its study, our note and a stranger's note."""
    store = Store(str(evil))
    with served(store) as address:
        ours, theirs = (store.optuna.get_study_id_from_name(name) for name in (EVIL, "noted"))
        for page, text in (
            ("dashboard", "noted"),
            (f"dashboard/studies/{ours}", "Convergence"),
            (f"dashboard/studies/{ours}/note", "This note is written by metaid"),
            (f"dashboard/studies/{theirs}/note", "seen"),
        ):
            _look(browser, f"{address}/{page}", text)
            assert not browser.driver.execute_script(OWNED), page
            assert all(url.startswith(address) for url in browser.fetched())
    store.close()


def test_our_note_has_a_strangers_texts_without_their_markup(evil: Path) -> None:
    """Every sign that Markdown or HTML would read is escaped."""
    with closing(Store(str(evil))) as store:
        note = dashboard.note(read_findings(store, EVIL))
    assert "\\[click\\]\\(javascript:" in note
    assert re.search(r"(?<!\\)[<\[]", note) is None


def _look(browser: Browser, url: str, text: str) -> None:
    browser.look(url)
    wait_for(browser, text)


@pytest.fixture(scope="module")
def address(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Where the dashboard of a copy of it is served."""
    copy = shutil.copy(made, tmp_path_factory.mktemp("served") / "evil.db")
    with closing(Store(str(copy))) as store, served(store) as shown:
        yield shown


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"Origin": "http://127.0.0.1:PORT"}, 200),
        ({"Origin": "https://stranger.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Host": "stranger.example:PORT"}, 403),
        ({"Host": "127.0.0.1"}, 403),
    ],
)
def test_dashboard_answers_no_page_from_elsewhere(address: str, headers: dict[str, str], status: int) -> None:
    """A stranger's page in the same browser, or a name that a stranger pointed at this machine, is refused."""
    port = urllib.parse.urlsplit(address).port
    connection = http.client.HTTPConnection("127.0.0.1", port)
    asked = {key: value.replace("PORT", str(port)) for key, value in headers.items()}
    connection.request("GET", "/api/studies", headers=asked)
    answer = connection.getresponse()
    answer.read()
    connection.close()
    assert answer.status == status
    if status == 200:
        assert "script-src 'self';" in str(answer.getheader("Content-Security-Policy"))


def test_dashboard_listens_on_loopback_alone(evil: Path) -> None:
    """By the sockets that this process has."""
    store = Store(str(evil))
    before = listening(os.getpid())
    with served(store):
        opened = listening(os.getpid()) - before
    store.close()
    assert {address for address, _ in opened} == {"127.0.0.1"}
