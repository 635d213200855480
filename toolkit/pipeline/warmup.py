"""The kernels that a run needs, compiled before they are called, by several processes at once.

`kernels.json` names them, with the types of their arguments and the processor time that each takes to compile. It is
recorded from runs by `python -m validation.first_minute --record`.
"""

from __future__ import annotations

import gc
import json
import math
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from multiprocessing import active_children
from pathlib import Path
from typing import NamedTuple

from toolkit.compiled import is_kept, keep, kept_folder
from toolkit.interruption import end_with_parent
from toolkit.pipeline.observer import Observer
from toolkit.processes import Processes

KERNELS = Path(__file__).with_name("kernels.json")
STAGE = "compiling"
_START = 1.0  # s; until a new process compiles
_LOOK = 0.2  # s between two looks at what is done


class Kernel(NamedTuple):
    """A kernel that a run needs.

    Attributes:
        name: `module:function`.
        seconds: Processor time that it takes to compile, on the machine where the list was recorded.
        arguments: Types of its arguments; see `toolkit.compiled.is_kept`.
    """

    name: str
    seconds: float
    arguments: list


def listed() -> list[Kernel]:
    """The kernels that runs need."""
    return [Kernel(**entry) for entry in json.loads(KERNELS.read_text(encoding="utf-8"))]


def lacking() -> list[Kernel]:
    """The kernels that a run needs and that are not compiled yet.

    There is none where compiled code cannot be kept. A kernel that the list knows in an older form is left out, and
    compiles when it is called.
    """
    if kept_folder() is None:
        return []
    return [kernel for kernel in listed() if not _is_ready(kernel)]


def _is_ready(kernel: Kernel) -> bool:
    try:
        return is_kept(kernel.name, kernel.arguments)
    except LookupError:
        return True


@contextmanager
def warm_up(observer: Observer) -> Iterator[None]:
    """Compile what a run lacks, while the block goes on; afterwards, wait for it and show how far it is.

    Where a process fails, what it left is compiled when it is called. An error in the block ends the processes.

    Args:
        observer: Is told of the stage `STAGE`, unless nothing is lacking.
    """
    kernels = sorted(lacking(), key=lambda kernel: -kernel.seconds)
    if not kernels:
        yield
        return
    began, others = time.perf_counter(), set(active_children())
    workers = _workers(kernels)
    with Processes(workers, _begin) as pool:
        jobs = {pool.submit(keep, kernel.name, kernel.arguments): kernel for kernel in kernels}
        try:
            yield
            _wait(jobs, _ends([kernel.seconds for kernel in kernels], workers), observer, began)
        except BaseException:
            for child in set(active_children()) - others:
                child.terminate()
            raise


def _workers(kernels: Sequence[Kernel]) -> int:
    """How many processes help: no more than cores, and than have something to do while the longest kernel compiles."""
    total, longest = sum(kernel.seconds for kernel in kernels), max(kernel.seconds for kernel in kernels)
    return max(1, min(os.cpu_count() or 1, math.ceil(total / longest)))


def _begin() -> None:
    """Prepare a process that compiles, which is short-lived."""
    end_with_parent()
    gc.disable()  # a tenth of the time


def _ends(seconds: Sequence[float], workers: int) -> list[float]:
    """When each of the jobs ends, in s, if every free worker takes the next."""
    free = [_START] * workers
    ends = []
    for one in seconds:
        worker = free.index(min(free))
        free[worker] += one
        ends.append(free[worker])
    return ends


def _wait(jobs: dict[Future, Kernel], ends: Sequence[float], observer: Observer, began: float) -> None:
    """Wait for all jobs, which were expected to end at `ends`; how they keep up tells how long the rest takes."""
    observer.started(STAGE)
    expected, waiting = dict(zip(jobs, ends, strict=True)), set(jobs)
    last, pace, share = max(ends), 1.0, 0.0
    while waiting:
        done, waiting = wait(waiting, timeout=_LOOK, return_when=FIRST_COMPLETED)
        elapsed = time.perf_counter() - began
        if done:
            pace = elapsed / max(expected[job] for job in done)
        left = max(pace * last - elapsed, 0.02 * elapsed)
        share = max(share, elapsed / (elapsed + left))
        words = f"once after installation: {len(jobs) - len(waiting)} of {len(jobs)}, about {left:.0f} s left"
        observer.progress(STAGE, share, words)
    failed = sum(job.exception() is not None for job in jobs)
    detail = f"{len(jobs)} kernels, once after installation"
    if failed:
        detail = f"{failed} of {len(jobs)} kernels are left to the run, for a process that compiled them failed"
    observer.finished(STAGE, not failed, time.perf_counter() - began, detail)
