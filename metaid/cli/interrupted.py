"""SIGINT and SIGTERM end any command within a second.

Python handles a signal between two of its own instructions, and a compiled loop may run for minutes. So the signal also
wakes a thread. It lets the command end by itself. If that takes too long, it ends the process, as a kill would: a DB
has whole transactions, and a rig sees its connection end.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from types import FrameType

PATIENCE = 0.25  # s that a command may go on until it can be left well
GRACE = 0.6  # s after which it is ended whatever it does
LAST_WORDS = 0.2  # s in which it says so
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """A context manager within which both signals raise KeyboardInterrupt in the main thread, and end the process if
    the main thread does not listen. In another thread it does nothing.
    """

    def __init__(self) -> None:
        self.number: int = signal.SIGINT  # of the last that came
        self._is_deferred = self._is_requested = self._has_raised = False
        self._last_words: Callable[[], None] = lambda: None
        self._says = threading.Lock()
        self._is_over = threading.Event()

    def defer(self, last_words: Callable[[], None]) -> None:
        """From now on a signal interrupts PATIENCE after it came, or where `raise_if_requested` is called meanwhile.
        `last_words` are what `say_last_words` says.
        """
        self._is_deferred, self._last_words = True, last_words

    def raise_if_requested(self) -> None:
        """Raises KeyboardInterrupt after a deferred signal; called where the command can be left well."""
        if self._is_requested:
            self._raise()

    def say_last_words(self) -> None:
        """Says them once, be it by the command that ends by itself or where the process has to be ended."""
        with self._says:
            last_words, self._last_words = self._last_words, lambda: None
            last_words()

    def __enter__(self) -> Interruption:
        self._is_main = threading.current_thread() is threading.main_thread()
        if self._is_main:
            self._awake, self._wakes = os.pipe()
            os.set_blocking(self._wakes, False)
            self._wakes_before = signal.set_wakeup_fd(self._wakes, warn_on_full_buffer=False)
            self._before = [signal.signal(number, self._handle) for number in _SIGNALS]
            threading.Thread(target=self._watch, name="metaid-signals", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_main:
            self._is_over.set()
            for number, before in zip(_SIGNALS, self._before, strict=True):
                signal.signal(number, before)
            signal.set_wakeup_fd(self._wakes_before)
            os.close(self._wakes)

    def _handle(self, number: int, _frame: FrameType | None) -> None:
        again, self._is_requested, self.number = self._is_requested, True, number
        if again or not self._is_deferred:
            self._raise()

    def _raise(self) -> None:
        self._has_raised = True
        raise KeyboardInterrupt

    def _watch(self) -> None:
        """Waits for a signal, or for the end."""
        with os.fdopen(self._awake, "rb", buffering=0) as awake:
            came = awake.read(1)
            while came and came[0] not in _SIGNALS:
                came = awake.read(1)
            if came:  # the pipe stays open meanwhile, or a second signal finds none
                self._end(came[0])

    def _end(self, number: int) -> None:
        if self._is_over.wait(PATIENCE):
            return
        if not self._has_raised:
            signal.pthread_kill(threading.main_thread().ident or 0, number)
        if self._is_over.wait(GRACE - PATIENCE):
            return
        threading.Timer(LAST_WORDS, os._exit, [128 + number]).start()
        with suppress(Exception):
            self.say_last_words()
        os._exit(128 + number)
