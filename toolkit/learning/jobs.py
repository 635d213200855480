"""Jobs in parallel, by any executor."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TypeVar

from toolkit.errors import InputError

Result = TypeVar("Result")


@contextmanager
def executor(workers: int, cluster: str | None) -> Iterator[Executor]:
    """Local processes, or the workers of a dask cluster.

    Raises:
        InputError: dask is not installed, or the cluster does not answer.
    """
    if cluster is None:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            yield pool
        return
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--cluster needs dask: pip install -e '.[cluster]'") from None
    try:
        client = Client(cluster, timeout="20s")
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"--cluster {cluster}: no dask scheduler answers there ({error})") from None
    with client, client.get_executor(pure=False) as pool:
        yield pool


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
