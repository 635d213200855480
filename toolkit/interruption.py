"""SIGINT, SIGTERM and SIGHUP: how a command is stopped, and what must not be stopped half-way."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

WORDS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}
SIGNALS = tuple(getattr(signal, name) for name in WORDS if hasattr(signal, name))
PATIENCE = 5.0  # s; what has not been cleared away by then stays
GRACE = 0.5  # s; a process that was started has as long to end by itself


def end_when_stopped() -> None:
    """Let a signal end the process from now on: clear away, one line on standard error, and 128 + its number as code.

    Nothing is raised in whatever is at work then: compiled extensions turn an exception into another one, or swallow
    it. What has to be cleared away is registered with `weakref.finalize` or `atexit` instead. A signal that the process
    was started to ignore (by nohup, or in the background of a script) stays ignored.
    """
    stopped: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        if stopped:
            return
        stopped.append(number)
        late = threading.Timer(PATIENCE, os._exit, [128 + number])
        late.daemon = True
        late.start()
        children = sys.modules["multiprocessing"].active_children() if "multiprocessing" in sys.modules else []
        for child in children:
            child.terminate()
        for child in children:  # one that was being forked may have missed the signal, and exit functions wait for it
            child.join(GRACE)
            child.kill()
        atexit._run_exitfuncs()
        try:
            os.write(2, f"{WORDS[signal.Signals(number).name]}\n".encode())
        finally:
            os._exit(128 + number)

    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, stop)


def end_with_parent() -> None:
    """Let this process of a pool end as soon as the one that started it does, even if that is killed."""
    from multiprocessing import parent_process  # here, since every command imports this module

    parent = parent_process()
    if parent is not None:

        def watch() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()


@contextmanager
def starting_processes() -> Iterator[None]:
    """Keep interruptions from the processes that the block starts, from their first moment; one waits for its end."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    usual = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which processes inherit
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, usual)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Hold signals back while a short block runs; they take effect after it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    usual = {number: signal.getsignal(number) for number in SIGNALS}
    for number in SIGNALS:
        if usual[number] is not signal.SIG_IGN:
            signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])
