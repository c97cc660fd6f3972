"""optuna-dashboard on the study DB, on this machine's loopback alone.

Before it is served, every study is given a note that explains it and our key figures as the dashboard's custom
graphs; studies too long for a browser get a thinned companion.
"""

from __future__ import annotations

import io
import json
import logging
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from socketserver import ThreadingMixIn
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

import numpy as np
import optuna

from metaid.errors import MetaidError, optional_packages, printable
from metaid.results import Findings, evenly, read_findings
from metaid.show.companions import companion_name, is_long, write_companion
from metaid.show.figures import FALL, RANGE, SURVIVOR
from metaid.show.loopback import loopback_only
from metaid.show.notes import SIGNED, note
from metaid.store import Store

with optional_packages("dashboard"):
    from optuna_dashboard import get_note, save_note, save_plotly_graph_object, wsgi

HOST = "127.0.0.1"
POINTS = 400  # of a custom graph at most: the DB keeps graphs in rows of 2 kB
SHOWN_KEY = "metaid:shown"  # the number of trials that note and graphs were made from


@dataclass(frozen=True)
class Graph:
    """A graph in plotly's terms, which the dashboard draws by itself: plotly need not be installed."""

    data: list[dict[str, Any]]
    layout: dict[str, Any]

    def to_json(self) -> str:
        return json.dumps({"data": self.data, "layout": self.layout})


def serve(store: Store, port: int, say: Callable[[str], None]) -> None:
    """Serves the dashboard until interrupted; `say` gets its addresses.  Raises MetaidError if the port is taken."""
    with make_dashboard(store, port, say) as server:
        lines = list(addresses(store, server.server_port))  # whoever reads the first may press Ctrl-C at once
        for line in lines:
            say(line)
        server.serve_forever()


def make_dashboard(store: Store, port: int, say: Callable[[str], None] = lambda text: None) -> WSGIServer:
    """The server, bound to loopback and not yet serving, with a note to each study; port 0 takes a free one. `say` gets
    what it is doing. Nothing is written where the port is taken.  Raises MetaidError.
    """
    log = logging.getLogger("optuna_dashboard")
    log.handlers, log.propagate = [_FirstLines()], False
    try:
        server = make_server(HOST, port, loopback_only(wsgi(store.optuna)), _Server, _Quiet)
    except OSError as problem:
        raise MetaidError(f"port {port} cannot be used: {problem.strerror} (choose another with --port)") from None
    try:
        say("writing notes and graphs where there are new trials …")
        for name in store.names():
            explain(store, name)
    except BaseException:
        server.server_close()
        raise
    return server


def addresses(store: Store, port: int) -> Iterator[str]:
    """Where each study is to be seen."""
    yield f"the dashboard is http://{HOST}:{port}/dashboard, for this machine alone, until Ctrl-C"
    listed = optuna.get_all_study_names(store.optuna)
    for name in store.names():
        shown = companion_name(name) if companion_name(name) in listed else name
        yield f"  {shown}: http://{HOST}:{port}/dashboard/studies/{store.optuna.get_study_id_from_name(shown)}"


class _Server(ThreadingMixIn, WSGIServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Says nothing of a browser that has gone."""


class _Complaints(io.StringIO):
    """A traceback that is written here is one line on stderr, its last."""

    def write(self, text: str) -> int:
        if said := [line for line in text.splitlines() if line.strip()]:
            sys.stderr.write(f"metaid: the dashboard could not answer a request: {printable(said[-1].strip())}\n")
        return len(text)


class _Quiet(WSGIRequestHandler):
    def log_message(self, format: str, *arguments: Any) -> None:
        """Says nothing of each request."""

    def get_stderr(self) -> Any:
        """Where what cannot be answered is complained of."""
        return _Complaints()


class _FirstLines(logging.Handler):
    """What the dashboard logs is one line on stderr: its first, for tracebacks follow."""

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno >= logging.ERROR:
            _Complaints().write(record.getMessage().partition("\n")[0])


def explain(store: Store, name: str) -> None:
    """Attaches note, custom graphs and, where it is long, a companion to a study, unless they are there already."""
    study = optuna.load_study(study_name=name, storage=store.optuna)
    number = store.optuna.get_study_id_from_name(name)
    count = store.optuna.get_n_trials(number)
    if store.optuna.get_study_system_attrs(number).get(SHOWN_KEY) == count:
        return
    found = read_findings(store, name)
    for each in [study, write_companion(store, found)] if is_long(found) else [study]:
        _annotate(each, note(found))
        if not found.survivors.empty:
            for title, graph in graphs(found).items():
                save_plotly_graph_object(each, graph, graph_object_id=title)
    store.optuna.set_study_system_attr(number, SHOWN_KEY, count)


def _annotate(study: optuna.Study, text: str) -> None:
    """Writes a note, unless there is one that is a user's own."""
    if not (written := get_note(study)) or SIGNED in written:
        save_note(study, text)


def graphs(found: Findings) -> dict[str, Graph]:
    """Our key figures by title: convergence, the lumps' ranges, falls over the first two lumps."""
    made = {"Convergence": _convergence(found), "Lumps": _lumps(found)}
    if len(found.names) > 1:
        made["Falls"] = _falls(found, *found.names[:2])
    return made


def _convergence(found: Findings) -> Graph:
    survivors = found.survivors
    best = survivors["value"].cummin()
    changes = survivors[best.diff().ne(0.0)]
    last = int(found.trials["number"].max())
    falls = evenly(found.falls, POINTS)["number"]
    lines = [
        _trace(
            "best so far",
            [*changes["number"].tolist(), last],
            [*changes["value"], best.iloc[-1]],
            mode="lines",
            line={"shape": "hv", "color": SURVIVOR},
        ),
        _trace(
            f"falls ({len(found.falls)})",
            falls.tolist(),
            np.full(len(falls), survivors["value"].max()),
            marker={"symbol": "line-ns-open", "color": FALL},
        ),
    ]
    scale = "log" if best.iloc[-1] > 0.0 else "linear"
    return Graph(lines, _layout("Convergence", "trial", found.label, scale))


def _lumps(found: Findings) -> Graph:
    lumps, known = found.lumps, found.lumps["identified"].notna().to_numpy()
    ends = (lumps[key].to_numpy() / found.sought.scale for key in ("identified", "low", "high"))
    value, low, high = (found.drawn(each)[known] for each in ends)
    spread = {
        "type": "data",
        "symmetric": False,
        "array": five_digits(high - value),
        "arrayminus": five_digits(value - low),
    }
    label, names = f"identified, with its {found.interval_name}", lumps["name"][known].tolist()
    data = [_trace(label, names, value, marker={"color": SURVIVOR, "size": 9}, error_y=spread)]
    if found.true_factors is not None:
        star = {"symbol": "star-open", "size": 13, "color": FALL}
        data.append(_trace("truth", found.names, found.drawn(found.true_factors), marker=star))
    return Graph(data, _layout("Lumps", "", found.sought.axis))


def _falls(found: Findings, first: str, second: str) -> Graph:
    kinds = [("survivor", found.survivors, RANGE, "circle"), ("fall", found.falls, FALL, "x")]
    data = []
    for label, rows, colour, symbol in kinds:
        shown = evenly(found.drawn_rows(rows), POINTS)
        marker = {"color": colour, "symbol": symbol, "size": 5}
        data.append(_trace(label, five_digits(shown[first]), shown[second], marker=marker))
    return Graph(data, _layout("Falls", found.sought.label(first), found.sought.label(second)))


def _trace(name: str, x: list[Any], y: Any, **more: Any) -> dict[str, Any]:
    """A curve, or marks, of that `name` in plotly's terms: its points are at `x` (npoint), numbers or names, and `y`
    (npoint); `more` are plotly's keys.
    """
    return {"type": "scatter", "mode": "markers", "name": name, "x": x, "y": five_digits(y), **more}


def _layout(title: str, x: str, y: str, scale: str = "linear") -> dict[str, Any]:
    return {"title": {"text": title}, "xaxis": {"title": {"text": x}}, "yaxis": {"title": {"text": y}, "type": scale}}


def five_digits(numbers: Any) -> list[float]:
    """Numbers rounded to five digits, which is more than a graph shows."""
    return [float(f"{number:.5g}") for number in numbers]
