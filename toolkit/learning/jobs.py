"""Jobs in parallel: where they run, and how their results are taken."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from contextlib import contextmanager
from itertools import islice
from typing import TypeVar

from toolkit.errors import WorkerError
from toolkit.learning.cluster import cluster_executor
from toolkit.processes import Processes

Result = TypeVar("Result")


@contextmanager
def executor(workers: int, cluster: str | None = None, *, unencrypted: bool = False) -> Iterator[Executor]:
    """Local processes, or the workers of a dask cluster.

    Args:
        workers: Number of local processes.
        cluster: Address of the cluster's scheduler, None for local processes.
        unencrypted: Whether a scheduler on another machine may be used without encryption.

    Raises:
        InputError: Dask is not installed, or the cluster cannot be used (see `cluster_executor`).
    """
    if cluster is not None:
        with cluster_executor(cluster, unencrypted=unencrypted) as pool:
            yield pool
        return
    with Processes(workers) as pool:
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
        arguments: The arguments of each job. They are asked for when there is room for a job, so that what has come in
            until then can decide whether there is another one.
        take: Is called with each result in this process.
        ahead: Number of jobs that wait in the pool at a time, None for all.

    Raises:
        WorkerError: A process of the pool died.
    """
    left = iter(arguments)
    waiting: set[Future[Result]] = set()
    try:
        while True:
            for job in islice(left, None if ahead is None else ahead - len(waiting)):
                waiting.add(pool.submit(work, *job))
            if not waiting:
                return
            finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for job in finished:
                take(_result_of(job))
    except BaseException:
        for job in waiting:
            job.cancel()
        raise


def _result_of(job: Future[Result]) -> Result:
    """What a finished job returned.

    Raises:
        WorkerError: The process that ran it died, or the cluster went away.
    """
    try:
        return job.result()
    except (BrokenExecutor, CancelledError) as error:
        reason = " ".join(str(error).split()) or "the connection was lost"
        raise WorkerError(
            f"a process that did a part of the work died ({reason}); what is done is kept, the same command goes on"
        ) from error
