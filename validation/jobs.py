"""Run the trials of an experiment in a pool of processes, each of them exactly once, whatever happens in them."""

from __future__ import annotations

import os
import re
import time
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass
from typing import Any, Protocol

from rich.console import Console

from toolkit.learning.jobs import executor
from toolkit.report.console import progress_bar

Record = dict[str, Any]
_BATCH = 16  # trials of a process before a fresh one takes over: what it has freed stays with it, and looks like need
_FOLDERS = re.compile(r"(?<![\w.])/(?:[^\s/:']+/)+")  # before the name of a file
ERROR = "error"  # stage of a trial that ended in an error of the program
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class Store(Protocol):
    """Keeps records; see `validation.trial_file`.

    Attributes:
        records: by name of the trial.
        others: number of records of other settings.
    """

    records: dict[str, Record]
    others: int

    def add(self, record: Record) -> None:
        """Keep a record."""
        ...


@dataclass(frozen=True)
class Job:
    """One trial.

    Attributes:
        name: unique within the experiment.
        function: of a module, so that it can be sent to another process; returns the record.
        arguments: of the function.
    """

    name: str
    function: Callable[..., Record]
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class PoolOptions:
    """Where trials run.

    Attributes:
        workers: processes, one thread each; 0 for this process.
        cluster: scheduler of a dask cluster; None for this machine.
        unencrypted: whether a scheduler on another machine may be used without TLS.
    """

    workers: int = 1
    cluster: str | None = None
    unencrypted: bool = False


def run_job(job: Job) -> Record:
    """The record of a job; an error that it raises becomes part of the record, since every trial counts."""
    began, load = time.perf_counter(), os.getloadavg()[0]
    try:
        record = job.function(*job.arguments)
    except Exception as error:  # whatever it is, the trial has failed
        record = failed_record(f"{type(error).__name__}: {reason_of(error)}", traceback.format_exc())
    return {"name": job.name, **record, "load": load, "wall_seconds": time.perf_counter() - began}


def reason_of(error: Exception) -> str:
    """What an error says, on one line and without the folders of this machine."""
    return _FOLDERS.sub("", " ".join(str(error).split()))


def failed_record(reason: str, trace: str = "") -> Record:
    """What is left of a trial that ended in an error of the program."""
    return {"stage": ERROR, "passed": False, "reason": reason, "traceback": trace}


def run_jobs(
    jobs: Sequence[Job],
    store: Store,
    options: PoolOptions,
    console: Console,
    title: str,
    minutes: float | None = None,
) -> list[Record]:
    """Run the jobs that have no record yet, and again those that ended in an error of the program.

    Args:
        jobs: to run, in order.
        store: keeps records.
        options: where to run.
        console: shows progress.
        title: of the progress bar.
        minutes: no job is started later than that; None for no end.

    Returns:
        Records of the jobs that have one, in order: of all of them where there was time.
    """
    end = time.monotonic() + (float("inf") if minutes is None else 60.0 * minutes)
    done = {name for name, record in store.records.items() if record.get("stage") != ERROR}
    waiting = [job for job in jobs if job.name not in done]
    known = len(jobs) - len(waiting)
    if known or store.others:
        console.print(f"{known} of {len(jobs)} trials known from before, {store.others} records of other settings left")
    # Spawned processes read these at their start, before any numerical library.
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        with progress_bar(console) as progress:
            task = progress.add_task(title, total=len(jobs), completed=known)

            def keep(record: Record) -> None:
                store.add(record)
                progress.advance(task)
                if not console.is_terminal:
                    word = "PASS" if record.get("passed") else f"FAIL {record.get('stage', '')}: {record.get('reason')}"
                    console.print(f"{record['name']}  {record['wall_seconds']:.0f} s  {word}", soft_wrap=True)

            if options.workers == 0:
                for job in waiting:
                    if time.monotonic() < end:
                        keep(run_job(job))
            elif waiting:
                _run_in_pools(waiting, options, keep, end)
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
    return [store.records[job.name] for job in jobs if job.name in store.records]


def _run_in_pools(jobs: list[Job], options: PoolOptions, keep: Callable[[Record], None], end: float) -> None:
    """Run jobs in a pool; what was under way when a process died runs again alone, and fails if it dies again."""
    size = _BATCH * max(options.workers, 1)
    suspects: list[tuple[Job, bool]] = []
    for first in range(0, len(jobs), size):
        suspects += _run_in_pool(jobs[first : first + size], options, options.workers, keep, end)
    while suspects:
        doubtful = [suspect for suspect in suspects if suspect[1]]
        for job, _ in doubtful:
            if _run_in_pool([job], options, 1, keep, end):
                keep({"name": job.name, **failed_record("its process died"), "load": 0.0, "wall_seconds": 0.0})
        suspects = _run_in_pool([job for job, at_work in suspects if not at_work], options, options.workers, keep, end)


def _run_in_pool(
    jobs: list[Job], options: PoolOptions, workers: int, keep: Callable[[Record], None], end: float
) -> list[tuple[Job, bool]]:
    """Run jobs in one pool, none after `end`; returns those lost because it broke, and whether each was under way."""
    if not jobs or time.monotonic() >= end:
        return []
    left = list(jobs)[::-1]
    with executor(workers, options.cluster, unencrypted=options.unencrypted) as pool:
        running: dict[Future, Job] = {}
        lost: list[Job] = []
        while left or running:
            if time.monotonic() >= end:
                left.clear()
            while left and len(running) < max(workers, 1):
                job = left.pop()
                future = _submit(pool, job)
                if future is None:
                    lost.append(job)
                    break
                running[future] = job
            if lost and not running:
                break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                job = running.pop(future)
                try:
                    keep(future.result())
                except BrokenExecutor:
                    lost.append(job)
        return [(job, True) for job in lost] + [(job, False) for job in left[::-1]]


def _submit(pool: Executor, job: Job) -> Future | None:
    """The job's future; None where the pool is broken."""
    try:
        return pool.submit(run_job, job)
    except BrokenExecutor:
        return None
