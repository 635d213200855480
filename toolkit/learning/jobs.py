"""Jobs in parallel, by any executor."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import TypeVar

Result = TypeVar("Result")


def run_jobs(
    executor: Executor,
    work: Callable[..., Result],
    arguments: Iterable[tuple],
    take: Callable[[Result], None],
    *,
    ahead: int | None = None,
) -> None:
    """Run jobs and take their results as they come, in any order; where something fails, what still waits is dropped.

    Args:
        executor: where they run, through the `concurrent.futures` interface.
        work: what a job does.
        arguments: of each job.
        take: told each result, here.
        ahead: jobs handed to the executor at a time; None: all.
    """
    left = list(arguments)[::-1]
    waiting: set[Future[Result]] = set()
    try:
        while left or waiting:
            while left and (ahead is None or len(waiting) < ahead):
                waiting.add(executor.submit(work, *left.pop()))
            finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for job in finished:
                take(job.result())
    except BaseException:
        for job in waiting:
            job.cancel()
        raise
