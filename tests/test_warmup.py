"""What a run needs is compiled before, by other processes: the list is complete, and nothing goes wrong half-way."""

import json
import os
import signal
import subprocess
import sys
import time
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from toolkit.compiled import is_kept
from toolkit.pipeline import warmup
from toolkit.pipeline.observer import Observer
from toolkit.pipeline.warmup import Kernel, lacking, listed, warm_up
from toolkit.search.costs.grid_kernels import spread

ROOT = Path(__file__).resolve().parent.parent
RECORD = "python -m validation.first_minute --record"
SPREAD = Kernel("toolkit.search.costs.grid_kernels:spread", 0.2, ["float64[3]", "int64[2]", "float64", "float64[3]"])


class Told(Observer):
    """Notes what it is told."""

    def __init__(self):
        self.stages, self.shares, self.details = [], [], []

    def started(self, stage):
        self.stages.append(stage)

    def progress(self, stage, fraction, detail=""):
        self.shares.append(fraction)
        self.details.append(detail)

    def finished(self, stage, passed, seconds, detail=""):
        self.stages.append((stage, passed))
        self.details.append(detail)


def python(program, *words, cache=None, **options):
    """Output of a program of its own, as JSON of its last line."""
    environment = dict(os.environ, PYTHONPATH=str(ROOT), **options)
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    done = subprocess.run(
        [sys.executable, "-c", program, *words], env=environment, capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_the_list_names_kernels_and_types_that_there_are():
    kernels = listed()
    assert kernels
    for kernel in kernels:
        assert kernel.seconds > 0.0
        try:
            is_kept(kernel.name, kernel.arguments)
        except LookupError as error:
            pytest.fail(f"{kernel.name} has changed ({error}): run {RECORD}")


USED = """
import json, sys
from toolkit import validate
from toolkit.compiled import used_kernels
validate.main(sys.argv[1:])
print()
print(json.dumps(used_kernels()))
"""
WALK = """
<mujoco>
  <custom><numeric name="transition_timing" data="0.4 0.6"/></custom>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" friction="0.7"/>
    <site name="start" pos="0 0 0"/>
    <site name="goal" type="cylinder" pos="0.8 0 0" size="0.3 0.5"/>
  </worldbody>
</mujoco>
"""


def assert_all_were_listed(used):
    known = {(kernel.name, json.dumps(kernel.arguments)) for kernel in listed()}
    assert used
    for name, arguments, made in used:
        assert (name, json.dumps(arguments)) in known, f"{name} is called with other arguments: run {RECORD}"
        assert not made, f"{name} was compiled by the run"


def test_a_run_compiles_nothing_itself(tmp_path):
    world = tmp_path / "walk.xml"
    world.write_text(WALK)
    assert_all_were_listed(python(USED, str(world), "--out", str(tmp_path / "run")))


@pytest.mark.slow
def test_a_first_run_compiles_nothing_itself(tmp_path):
    world, cache = tmp_path / "walk.xml", tmp_path / "kernels"
    world.write_text(WALK)
    for name in ("first", "second"):
        assert_all_were_listed(python(USED, str(world), "--out", str(tmp_path / name), cache=cache))
    first, second = (np.load(tmp_path / name / "execution.npz") for name in ("first", "second"))
    assert set(first.files) == set(second.files)
    for name in first.files:
        np.testing.assert_array_equal(first[name], second[name], err_msg=name)


WARM = """
import json
from tests.test_warmup import SPREAD, Told
from toolkit.pipeline import warmup
warmup.listed = lambda: [SPREAD]
told, before = Told(), len(warmup.lacking())
with warmup.warm_up(told):
    pass
with warmup.warm_up(told):
    pass
print(json.dumps([before, len(warmup.lacking()), told.stages, told.shares, told.details]))
"""


def test_what_is_lacking_is_compiled_once(tmp_path):
    before, after, stages, shares, details = python(WARM, cache=tmp_path)
    assert (before, after) == (1, 0)
    assert stages == ["compiling", ["compiling", True]]  # told once, though asked twice
    assert shares == sorted(shares) and all(0.0 < share < 1.0 for share in shares)
    assert "1 of 1, about" in details[-2] and details[-1] == "1 kernels, once after installation"


def test_nothing_lacks_where_compiled_code_is_not_kept(monkeypatch):
    monkeypatch.setattr(warmup, "listed", lambda: [SPREAD._replace(arguments=["float32[3]", *SPREAD.arguments[1:]])])
    assert len(lacking()) == 1
    monkeypatch.setattr(warmup, "kept_folder", lambda: None)
    assert lacking() == []


def test_nothing_lacks_where_nothing_is_compiled():
    program = "import json; from toolkit.pipeline.warmup import lacking; print(json.dumps(len(lacking())))"
    assert python(program, NUMBA_DISABLE_JIT="1") == 0


def test_a_kernel_that_is_listed_in_an_older_form_is_left_to_the_run(monkeypatch):
    older = [SPREAD._replace(name="toolkit.nowhere:spread"), SPREAD._replace(name=SPREAD.name + "_")]
    older += [SPREAD._replace(arguments=[["toolkit.search.moves.screen:Sole", "float64"]])]
    older += [SPREAD._replace(arguments=[kind]) for kind in ("no_type", "Literal[int](0)")]
    monkeypatch.setattr(warmup, "listed", lambda: older)
    assert lacking() == []


def test_what_cannot_be_compiled_before_is_left_to_the_run(monkeypatch):
    monkeypatch.setattr(warmup, "lacking", lambda: [SPREAD._replace(arguments=["float64"]), SPREAD])
    told = Told()
    with warm_up(told):
        pass
    assert told.stages == ["compiling", ("compiling", False)] and told.details[-1].startswith("1 of 2 kernels are left")


def test_an_error_ends_the_processes(monkeypatch):
    slow = max(listed(), key=lambda kernel: kernel.seconds)
    monkeypatch.setattr(warmup, "lacking", lambda: [slow._replace(name="time:sleep", arguments=[])] * 3)
    monkeypatch.setattr(warmup, "keep", _sleep)
    before, began = set(active_children()), time.perf_counter()
    with pytest.raises(ValueError, match="in the block"), warm_up(Told()):
        raise ValueError("in the block")
    assert set(active_children()) <= before and time.perf_counter() - began < LONG


LONG = 300.0  # s


def _sleep(name, arguments):
    time.sleep(LONG)


@pytest.mark.parametrize("command", ["validate", "plan"])
def test_a_folder_that_is_not_fit_is_refused_before_anything_is_compiled(tmp_path, command):
    (tmp_path / "mine.txt").write_text("kept")
    done = subprocess.run(
        [sys.executable, "-m", f"toolkit.{command}", "flat", "--out", str(tmp_path)],
        env=dict(os.environ, PYTHONPATH=str(ROOT), NUMBA_CACHE_DIR=str(tmp_path / "kernels")),
        capture_output=True,
        text=True,
        timeout=LONG,
    )
    assert done.returncode == 2 and "is not an earlier run" in done.stderr, done.stderr
    assert "compiling" not in done.stdout + done.stderr


def test_the_processes_share_the_work():
    assert warmup._ends([4.0, 2.0, 1.0], 2) == [5.0, 3.0, 4.0]
    one, many = [SPREAD], [SPREAD] * 1000
    assert warmup._workers(one) == 1 and 1 <= warmup._workers(many) <= (os.cpu_count() or 1)


def test_an_interruption_ends_a_first_run_in_one_line(tmp_path):
    words = [sys.executable, "-m", "toolkit.validate", "flat", "--out", str(tmp_path / "run")]
    environment = dict(os.environ, PYTHONPATH=str(ROOT), NUMBA_CACHE_DIR=str(tmp_path / "kernels"))
    run = subprocess.Popen(
        words,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=_interruptible,
    )
    while not _children(run.pid) and run.poll() is None:
        time.sleep(0.05)
    time.sleep(2.0)  # the processes compile, or are about to
    os.killpg(run.pid, signal.SIGINT)  # as a terminal does
    out, err = run.communicate(timeout=120)
    assert run.returncode == 128 + signal.SIGINT and err == "interrupted\n" and "Traceback" not in out
    assert not (tmp_path / "run").exists()


def _interruptible():
    """Mind SIGINT again, which shells make the programs that they run in the background ignore."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _children(parent):
    """Processes that a process has started."""
    return Path(f"/proc/{parent}/task/{parent}/children").read_text().split()


def test_the_index_is_locked_while_it_is_written():
    import fcntl

    cache = spread._cache
    with cache._locked(fcntl.LOCK_EX):
        (path,) = Path(cache.cache_path).glob(f"{cache._impl.filename_base}.lock")
        with path.open("ab") as file, pytest.raises(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
