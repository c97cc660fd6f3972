"""Tables on a terminal are whole, however narrow it is."""

from __future__ import annotations

import fcntl
import importlib
import os
import pty
import re
import struct
import sys
import termios
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from conftest import Finished
from rich.cells import cell_len

from metaid.cli.common import print_table
from metaid.store import Store

pytestmark = pytest.mark.slow

WIDTHS = (60, 80, 120)
TOO_NARROW = "too narrow for: "
PRINTING = ("checks.determined", "compare", "episodes", "listing", "paper", "plants", "printed", "results")
PRINTING += ("shown_plants",)
STYLE = re.compile(r"\x1b\[[\d;]*m")

Metaid = Callable[..., Finished]
Printed = tuple[tuple[Any, ...], dict[str, Any]]


@pytest.fixture(autouse=True)
def no_stated_width(monkeypatch: pytest.MonkeyPatch) -> None:
    """COLUMNS, which whoever runs the tests on two processes has set, says no width of these terminals."""
    monkeypatch.delenv("COLUMNS", raising=False)


@contextmanager
def terminal(width: int) -> Iterator[list[str]]:
    """A pseudo-terminal in the place of stdout; afterwards the list has what was printed on it, as one text."""
    printed: list[str] = []
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 50, width, 0, 0))
    pieces: list[bytes] = []

    def read() -> None:
        while True:
            try:
                piece = os.read(master, 65536)
            except OSError:  # the other end is closed
                return
            pieces.append(piece)

    reader, before = threading.Thread(target=read), sys.stdout
    reader.start()
    sys.stdout = os.fdopen(slave, "w", encoding="utf-8")
    try:
        yield printed
    finally:
        sys.stdout.close()
        sys.stdout = before
        reader.join()
        os.close(master)
        printed.append(STYLE.sub("", b"".join(pieces).decode()).replace("\r", ""))


@pytest.fixture(scope="module")
def tabled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DB with two studies of two links by the estimate, and a plain Optuna study."""
    import optuna

    from metaid.study import create_study, load_study, run_study

    path = tmp_path_factory.mktemp("tabled") / "metaid.db"
    store = Store(str(path), create=True)
    matched = {"sampler": "output-error", "trials": 3, "search.probes": 1}
    for name, changes in (("a", matched), ("a-longer-name-of-a-study", {**matched, "seed": 1})):
        create_study(store, load_study("two-link-tpe", changes), name)
        run_study(store, name)
    optuna.create_study(study_name="not-metaid's", storage=store.optuna)
    store.close()
    return path


RIG = 'socket = "tcp://127.0.0.1:5000"\njoints = 2\ntimestep = 0.01\n'
COMMANDS = (
    "plant list",
    "plant show three-link",
    "plant show puma560",
    "plant show rig.toml",
    "episode two-link --factor gravity_1=1.02 --steps 500",
    "study list --shipped",
    "study list",
    "study check two-link-tpe",
    "study check spatial-three-link",
    "study show a --bodies",
    "study compare a a-longer-name-of-a-study",
    "study validate a --pushes 1",
    "paper table1",
    "paper table2",
    "paper fig4",
    "paper sweep",
)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_table_of_a_command_is_whole(
    metaid: Metaid, tabled: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """At 60, 80 and 120 columns no line is longer, every cell of a column that is shown is there in full, and those
    that are not shown are named.
    """
    Path("rig.toml").write_text(RIG, encoding="utf-8")
    monkeypatch.setenv("METAID_STORAGE", str(tabled))
    tables: list[Printed] = []

    def recorded(*arguments: Any, **named: Any) -> None:
        tables.append((arguments, named))
        print_table(*arguments, **named)

    for module in PRINTING:
        monkeypatch.setattr(importlib.import_module(f"metaid.cli.{module}"), "print_table", recorded)
    done = metaid(*command.split())
    assert (done.status, done.err) == (0, "")
    assert tables
    for arguments, named in tables:
        for width in WIDTHS:
            with terminal(width) as printed:
                print_table(*arguments, **named)
            check_whole(printed[0], width, *arguments[1:3])


def check_whole(text: str, width: int, columns: list[str], rows: list[list[str]]) -> None:
    """What a terminal shows of a table has every cell of its columns, but for those that it names."""
    assert "…" not in text
    left_out: list[str] = []
    if TOO_NARROW in text:
        text, _, named = text.partition(TOO_NARROW)
        named = " ".join(named.split())
        left_out = [column for column in columns if column in named]
        assert ", ".join(left_out) == named
    assert max(map(cell_len, text.splitlines())) <= width
    words = text.split()
    for column, cells in zip(columns, zip(*rows, strict=True), strict=True):
        if column in left_out:
            continue
        for word in " ".join(cells).split():
            assert word in words, f"{word} of {column} at {width}"


def test_terminal_says_how_wide_it_is(metaid: Metaid) -> None:
    """A command asks the terminal that it prints on, and COLUMNS before it."""
    from metaid.cli import main

    for width in WIDTHS:
        with terminal(width) as printed, pytest.raises(SystemExit):
            main(["plant", "list"])
        assert width - 3 <= max(map(len, printed[0].splitlines())) <= width


def test_columns_are_left_out_in_the_order_that_is_stated() -> None:
    """Those that say nothing go first; what is still too wide is printed as a list of entries."""
    from metaid.cli.layout import Column, laid_out

    numbers = tuple(Column(name, ("123456",), is_words=False) for name in "abc")
    nothing = Column("d", ("–",), is_words=False)
    columns = (*numbers, nothing)
    assert laid_out(columns, ("b", "d"), 30).left_out == ()
    assert laid_out(columns, ("b", "d"), 22).left_out == ("d",)
    assert laid_out(columns, ("b", "d"), 16).left_out == ("b", "d")
    assert laid_out(columns, ("b", "d"), 10).widths == ()
    with terminal(10) as printed:
        print_table("title", ["a", "b"], [["123456", "12345678"]])
    assert printed[0].split() == ["title", "a:", "123456", "b:", "12345678"]


def test_progress_of_a_run_fits_sixty_columns(metaid: Metaid) -> None:
    """Neither the bar nor the lumps below it are cut."""
    import io

    from rich.console import Console

    from metaid.cli.live import Live
    from metaid.study import create_study, load_study, run_study

    store = Store("metaid.db", create=True)
    create_study(store, load_study("two-link-tpe", {"trials": 3}), "a-longer-name-of-a-study")
    shown = Console(file=io.StringIO(), force_terminal=True, width=60, markup=False, highlight=False)
    with Live(store, "a-longer-name-of-a-study", False, shown) as live:
        run_study(store, "a-longer-name-of-a-study", watch=live.update)
        rendered = io.StringIO()
        still = Console(file=rendered, width=60)
        for part in live._bar.get_renderables():
            still.print(part)
    store.close()
    assert "…" not in rendered.getvalue()
    for said in ("3/3", "a-longer-name-of-a-study", "coriolis_1_2", "kg m²", "left"):
        assert said in rendered.getvalue()
