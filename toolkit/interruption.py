"""SIGINT, SIGTERM and SIGHUP: how a command is stopped, and what must not be stopped half-way."""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
WORDS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}
IMPATIENCE = 2.0  # s; a signal that comes later than this after the first one ends the process at once


class Stopped(KeyboardInterrupt):
    """A signal asked the command to end.

    Attributes:
        exit_code: What a shell shows for a process that the signal ended.
        word: What is said on standard error.
    """

    def __init__(self, number: int):
        super().__init__(number)
        self.exit_code, self.word = 128 + number, WORDS[signal.Signals(number).name]


def raise_when_stopped() -> None:
    """Raise `Stopped` in the main thread when a signal asks the process to end, from now on until it ends.

    A signal that the process was started to ignore (by nohup, or in the background of a script) stays ignored.
    Where the exception is swallowed by a callback that cannot raise, it is raised again.
    """
    first: list[float] = []

    def stop(number: int, frame: FrameType | None) -> None:
        if not first:
            first.append(time.monotonic())
            raise Stopped(number)
        if time.monotonic() - first[0] > IMPATIENCE:
            os._exit(128 + number)

    def swallowed(failure: Any) -> None:
        if not isinstance(failure.exc_value, Stopped):
            return usual(failure)
        first.clear()
        again = threading.Timer(0.02, _thread.interrupt_main, failure.exc_value.args)
        again.daemon = True
        again.start()

    usual, sys.unraisablehook = sys.unraisablehook, swallowed
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, stop)


def end_when_stopped() -> None:
    """Let a signal end the process at once and without a word: everything that was to be cleared away is."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Hold signals back while a short block runs; they take effect after it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    usual = {number: signal.getsignal(number) for number in SIGNALS}
    for number in SIGNALS:
        signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
    if came:
        signal.raise_signal(came[0])
