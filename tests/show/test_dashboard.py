"""optuna-dashboard on real studies, in a real browser: the note, our graphs, the falls; companions of long studies."""

from __future__ import annotations

import shutil
import socket
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import optuna
import pandas as pd
import pytest
from browser import Browser, served, wait_for
from conftest import Finished
from optuna_dashboard import get_note, save_note

import metaid as package
from metaid.show import companions, dashboard, notes
from metaid.store import Store, Trial
from metaid.study import Problem, create_study, load_study, run_study, stored_spec

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]


@pytest.fixture
def store(studied: Path, tmp_path: Path) -> Iterator[Store]:
    """A copy of the studies, to be written to."""
    shutil.copy(studied, tmp_path / "studies.db")
    opened = Store(str(tmp_path / "studies.db"))
    yield opened
    opened.close()


def test_browser_shows_note_graphs_and_falls_and_fetches_nothing_outside(store: Store, browser: Browser) -> None:
    """The lumps in the note, our graphs among its own, a pruned trial with the step it fell at; all from loopback."""
    fall = package.trials("plain", store.url).query("state == 'PRUNED'").iloc[0]
    lumps = package.lumps("plain", store.url)
    with served(store) as address:
        assert address.startswith("http://127.0.0.1:")
        study = f"{address}/dashboard/studies/{store.optuna.get_study_id_from_name('plain')}"
        browser.look(f"{study}/note")
        wait_for(browser, "coriolis_2_3")
        for lump in lumps.to_dict("records"):
            assert f"{lump['identified']:.5g}" in browser.text()
        assert f"{package.summary('plain', store.url)['trials']['pruned']} fell" in browser.text()
        browser.look(study)
        for title in ("Convergence", "Lumps", "Falls"):
            wait_for(browser, title)
        wait_for(browser, "best so far")
        browser.look(f"{study}/trials?numbers={fall['number']}")
        wait_for(browser, "Pruned")
        wait_for(browser, "fall_value")
        wait_for(browser, f"{fall['value']}"[:6])
        assert all(url.startswith(address) for url in browser.fetched())
        assert browser.complaints() == []


def test_note_and_graphs_are_written_once_and_users_notes_are_kept(store: Store) -> None:
    """Starting again without new trials writes nothing; a note that a user took over stays."""
    study = optuna.load_study(study_name="plain", storage=store.optuna)
    dashboard.explain(store, "plain")
    assert dashboard.SIGNED in get_note(study)
    written = store.optuna.get_study_system_attrs(study._study_id)
    dashboard.explain(store, "plain")
    assert store.optuna.get_study_system_attrs(study._study_id) == written
    save_note(study, "mine")
    store.optuna.set_study_system_attr(study._study_id, dashboard.SHOWN_KEY, 0)
    dashboard.explain(store, "plain")
    assert get_note(study) == "mine"


def test_a_note_says_names_as_they_are(store: Store) -> None:
    """What a stranger calls a study is text, not markup, in the note."""
    assert notes.escaped("<b>*a*</b> | [x](y)") == r"\<b\>\*a\*\</b\> \| \[x\]\(y\)"


def test_long_study_gets_a_thinned_companion(store: Store, metaid: Metaid, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has the best trial, falls and both ends of the search, says which trials they are, and goes with the study."""
    monkeypatch.setattr(companions, "MOST_TRIALS_SHOWN", 500)
    monkeypatch.setattr(companions, "KEPT", 100)
    dashboard.explain(store, "plain")
    long = package.trials("plain", store.url)
    companion = optuna.load_study(study_name="plain (thinned)", storage=store.optuna)
    trials = companion.trials
    assert 50 < len(trials) <= 100
    kept = pd.DataFrame([{"number": t.user_attrs["trial"], **t.params} for t in trials])
    ours = long.set_index("number").loc[kept["number"], kept.columns[1:]].reset_index()
    pd.testing.assert_frame_equal(kept, ours, check_dtype=False)
    assert companion.best_trial.user_attrs["trial"] == package.summary("plain", store.url)["best"]["number"]
    assert {t.state.name for t in trials} == {"COMPLETE", "PRUNED"}
    assert kept["number"].min() == 0
    assert "plain (thinned)" not in package.studies(store.url)["name"].tolist()
    assert any("plain (thinned): http://127.0.0.1:" in line for line in dashboard.addresses(store, 80))
    assert metaid("study", "delete", "plain", "--yes", "--storage", store.url).status == 0
    assert "plain (thinned)" not in optuna.get_all_study_names(store.optuna)


def test_companion_of_a_long_study_has_failed_trials_too(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """A trial that could not be evaluated has no value, in the companion as in the study."""
    problem = Problem(stored_spec(store, "plain"))
    count, factors = store.count("plain"), np.ones(len(problem.names))
    failed = [Trial(count + i, 1000, factors, problem.failed("no answer")) for i in range(300)]
    store.append("plain", problem.names, problem.low, problem.high, failed)
    monkeypatch.setattr(companions, "MOST_TRIALS_SHOWN", 500)
    monkeypatch.setattr(companions, "KEPT", 100)
    dashboard.explain(store, "plain")
    companion = optuna.load_study(study_name="plain (thinned)", storage=store.optuna)
    failures = [trial for trial in companion.trials if trial.state.name == "FAIL"]
    assert len(failures) > 10
    assert all(trial.value is None and not trial.intermediate_values for trial in failures)


def test_note_and_graphs_leave_the_study_as_it_was(store: Store) -> None:
    """Trials, summary and resuming know nothing of them."""
    before = package.trials("plain", store.url), package.summary("plain", store.url)
    dashboard.explain(store, "plain")
    assert package.trials("plain", store.url).equals(before[0])
    assert package.summary("plain", store.url) == before[1]


def test_a_taken_port_is_said_in_one_line(store: Store, metaid: Metaid) -> None:
    """The second dashboard on a port is refused with what to do, before it says or writes anything."""
    with served(store) as address:
        assert urllib.request.urlopen(f"{address}/dashboard").status == 200
        refused = metaid("dashboard", "--storage", store.url, "--port", address.rpartition(":")[2])
    assert refused.status == 2
    assert "choose another with --port" in refused.err
    assert refused.out == ""


MALFORMED = (
    "POST /api/trials/1/tell HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\nContent-Length: 1\r\n\r\n1",
    "POST /api/studies HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\nContent-Length: x\r\n\r\n1",
    "GET /api/studies/1?after=zz HTTP/1.1\r\nHost: {host}\r\n\r\n",
    "GET /static/%00 HTTP/1.1\r\nHost: {host}\r\n\r\n",
    "GET /\r\n\r\n",
    "nonsense\r\n\r\n",
)


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Where the dashboard of a study of a few trials is served."""
    path = tmp_path_factory.mktemp("short") / "short.db"
    with closing(Store(str(path), create=True)) as opened:
        create_study(opened, load_study("one-link-count", {"trials": 9}))
        run_study(opened, "one-link-count")
        with served(opened) as shown:
            yield shown


@pytest.mark.parametrize("request_text", MALFORMED)
def test_malformed_request_is_answered_and_costs_a_line_at_most(
    address: str, capfd: pytest.CaptureFixture[str], request_text: str
) -> None:
    """Never a traceback on the terminal of whoever serves it, and the next request is answered."""
    host = address.removeprefix("http://")
    name, _, port = host.partition(":")
    with socket.create_connection((name, int(port))) as browser:
        browser.sendall(request_text.format(host=host).encode())
        assert browser.recv(1000)
    assert urllib.request.urlopen(f"{address}/dashboard").status == 200
    said = capfd.readouterr().err
    assert "Traceback" not in said
    assert said.count("\n") <= 1
    assert said == "" or said.startswith("metaid: the dashboard could not answer a request: ")
