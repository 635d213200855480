"""Jobs: every result once, no more at a time than asked for, and none left behind by a failure."""

from concurrent.futures import Executor, Future, ThreadPoolExecutor

import pytest

from toolkit.learning.jobs import run_jobs


class Holding(Executor):
    """Runs nothing but the first job."""

    def __init__(self):
        self.jobs = []

    def submit(self, fn, /, *args, **kwargs):
        self.jobs.append(Future())
        if len(self.jobs) == 1:
            self.jobs[0].set_result(fn(*args, **kwargs))
        return self.jobs[-1]


def test_every_result_is_taken_once():
    taken = []
    with ThreadPoolExecutor(2) as pool:
        run_jobs(pool, divmod, [(number, 3) for number in range(20)], taken.append, ahead=3)
        run_jobs(pool, divmod, [], taken.append)
    assert sorted(taken) == [divmod(number, 3) for number in range(20)]


@pytest.mark.parametrize(("ahead", "handed"), [(2, 2), (None, 5)])
def test_a_failure_drops_what_waits(ahead, handed):
    def refuse(result):
        raise RuntimeError(f"refused {result}")

    executor = Holding()
    with pytest.raises(RuntimeError, match="refused 1"):
        run_jobs(executor, abs, [(-number,) for number in range(1, 6)], refuse, ahead=ahead)
    assert len(executor.jobs) == handed and all(job.cancelled() for job in executor.jobs[1:])


def test_what_has_come_in_decides_whether_there_is_another_job():
    taken = []

    def until_enough():
        number = 0
        while sum(taken) < 10:
            yield (number := number + 1,)

    with ThreadPoolExecutor(1) as pool:
        run_jobs(pool, abs, until_enough(), taken.append, ahead=1)
    assert taken == [1, 2, 3, 4]
