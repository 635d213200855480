"""Jobs in parallel: where they run, and how their results are taken."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TypeVar

from toolkit.errors import InputError

Result = TypeVar("Result")


@contextmanager
def executor(workers: int, cluster: str | None = None) -> Iterator[Executor]:
    """Local processes, or the workers of a dask cluster.

    Args:
        workers: Number of local processes.
        cluster: Address of the cluster's scheduler, None for local processes.

    Raises:
        InputError: Dask is not installed, or the cluster does not answer.
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
    pool: Executor,
    work: Callable[..., Result],
    arguments: Iterable[tuple],
    take: Callable[[Result], None],
    *,
    ahead: int | None = None,
) -> None:
    """Run jobs and take their results as they come, in any order. After an error, the jobs that wait are cancelled.

    Args:
        pool: Where the jobs run.
        work: The function that every job calls.
        arguments: The arguments of each job.
        take: Is called with each result in this process.
        ahead: Number of jobs that wait in the pool at a time, None for all.
    """
    left = list(arguments)[::-1]
    waiting: set[Future[Result]] = set()
    try:
        while left or waiting:
            while left and (ahead is None or len(waiting) < ahead):
                waiting.add(pool.submit(work, *left.pop()))
            finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for job in finished:
                take(job.result())
    except BaseException:
        for job in waiting:
            job.cancel()
        raise
