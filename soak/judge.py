"""What must hold whatever is handed in: success, or one line that says what is wrong. Never a traceback, a hang, a NaN,
or a control character on the terminal.
"""

from __future__ import annotations

import io
import json
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, NamedTuple, NoReturn

import optuna

from metaid.cli import main
from metaid.errors import MetaidError

LONGEST = 20.0  # s of processor time: a process that is stopped for a while does not hang


class BrokenPromiseError(Exception):
    """A case that was answered as none may be."""


class Hang(BaseException):
    """More processor time than any case may take."""


class Answer(NamedTuple):
    """What a command left behind."""

    status: int
    out: str
    err: str


@contextmanager
def promised() -> Iterator[None]:
    """Within it only a MetaidError may be raised, of one printable line; a warning is as bad as an error, for on the
    command line it is a line of its own. Raises BrokenPromiseError.
    """
    with _watched(), warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        # Python 3.13 and newer, of connections that Optuna's pool keeps; nobody is shown it.
        warnings.filterwarnings("ignore", "unclosed database", ResourceWarning)
        try:
            yield
        except MetaidError as refusal:
            _refuse_unless(bool(str(refusal)) and "\n" not in str(refusal), f"not one line: {refusal!s:.300}")
        except BrokenPromiseError:
            raise
        except Hang:
            raise BrokenPromiseError(f"more than {LONGEST:g} s") from None
        except Exception as problem:
            raise BrokenPromiseError(_trace(problem)) from problem


def command(arguments: list[str]) -> Answer:
    """What the command line answers to `arguments`, in this process.  Raises BrokenPromiseError."""
    before = sys.stdin, sys.stdout, sys.stderr
    out, err = io.BytesIO(), io.BytesIO()
    sys.stdin = io.StringIO()
    sys.stdout = io.TextIOWrapper(out, encoding="utf-8", errors="strict", write_through=True)
    sys.stderr = io.TextIOWrapper(err, encoding="utf-8", errors="backslashreplace", write_through=True)
    status: Any = None
    try:
        with promised():
            try:
                main(arguments)
            except SystemExit as stop:
                status = stop.code or 0
        answer = Answer(status, out.getvalue().decode(), err.getvalue().decode())
    finally:
        sys.stdin, sys.stdout, sys.stderr = before
    judge(answer)
    return answer


def judge(answer: Answer) -> None:
    """Raises BrokenPromiseError if an answer is neither success nor a refusal in one line."""
    status, out, err = answer
    _refuse_unless(status in (0, 2, 130), f"exit status {status}")  # 130: asked, and not answered
    if status == 2:
        _refuse_unless(out == "", f"refused after it said something: {out[:200]!r}")
        _refuse_unless(err.startswith("metaid: ") and err.count("\n") == 1, f"not one line: {err[:300]!r}")
    for text in (out, err):
        strange = {letter for letter in text if not letter.isprintable() and letter != "\n"}
        _refuse_unless(not strange, f"would reach the terminal: {strange}")
    if out.startswith(("{", "[")):
        json.loads(out, parse_constant=_no_constant)


def _no_constant(name: str) -> NoReturn:
    raise BrokenPromiseError(f"{name} in JSON")


def _refuse_unless(kept: bool, otherwise: str) -> None:
    if not kept:
        raise BrokenPromiseError(otherwise)


def _trace(problem: Exception) -> str:
    """The error and the last place of ours that it came through."""
    place, step = "", problem.__traceback__
    while step is not None:
        if "metaid" in (file := step.tb_frame.f_code.co_filename):
            place = f"{file.rpartition('/')[2]}:{step.tb_lineno}"
        step = step.tb_next
    return f"{type(problem).__name__} at {place}: {' '.join(str(problem).split())[:200]}"


@contextmanager
def _watched() -> Iterator[None]:
    before = signal.signal(signal.SIGPROF, _hang)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def _hang(_number: int, _frame: FrameType | None) -> NoReturn:
    raise Hang
