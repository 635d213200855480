"""A pool of processes of this machine."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import ParamSpec, TypeVar

from toolkit.interruption import end_with_parent, starting_processes

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class Processes(ProcessPoolExecutor):
    """Processes that end with the one that started them, and leave the answer to an interruption to it.

    Args:
        workers: How many there are at most; they are started as work comes in.
        prepare: What each calls first.
    """

    def __init__(self, workers: int, prepare: Callable[[], object] = end_with_parent) -> None:
        super().__init__(workers, mp_context=get_context("spawn"), initializer=prepare)

    def submit(
        self, fn: Callable[Arguments, Result], /, *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Future[Result]:
        """As any executor does; this starts processes."""
        with starting_processes():
            return super().submit(fn, *args, **kwargs)
