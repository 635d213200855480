"""Every trial runs once: after an interruption, with an error in it, with a process that dies."""

import io
import os
import signal

import pytest
from rich.console import Console

from toolkit.errors import InputError
from validation.jobs import Job, PoolOptions, reason_of, run_jobs
from validation.trial_file import TrialFile


def quiet() -> Console:
    return Console(file=io.StringIO())


def good(value: int) -> dict:
    return {"passed": True, "value": value}


def broken(value: int) -> dict:
    raise ValueError(f"no {value}")


def interrupted(value: int) -> dict:
    raise KeyboardInterrupt


def deadly(value: int) -> dict:
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def job(name: str, function=good) -> Job:
    return Job(name, function, (len(name),))


def test_a_reason_names_files_without_their_folders():
    error = ValueError("/home/me/runs/a-1.xml: too fast at 3 m/s,\n 1/2 of 'worlds/b.xml'; see /a/b c/d")
    assert reason_of(error) == "a-1.xml: too fast at 3 m/s, 1/2 of 'worlds/b.xml'; see b c/d"


def test_an_interrupted_experiment_goes_on_where_it_stopped(tmp_path):
    path = tmp_path / "out" / "trials.jsonl"
    here = PoolOptions(workers=0)
    with pytest.raises(KeyboardInterrupt):
        run_jobs([job("a"), job("bb", interrupted), job("c")], TrialFile(path, {"x": 1}), here, quiet(), "")
    # The first trial is known: were it run again, it would fail.
    records = run_jobs([job("a", broken), job("bb"), job("c")], TrialFile(path, {"x": 1}), here, quiet(), "")
    assert [record["name"] for record in records] == ["a", "bb", "c"]
    assert [record["passed"] for record in records] == [True] * 3
    # Other settings know nothing of it, and leave it alone.
    other = TrialFile(path, {"x": 2})
    assert (len(other.records), other.others) == (0, 3)
    assert len(path.read_text().splitlines()) == 3


def test_a_trial_that_ended_in_an_error_is_run_again(tmp_path):
    path, here = tmp_path / "trials.jsonl", PoolOptions(workers=0)
    (record,) = run_jobs([job("a", broken)], TrialFile(path, {"x": 1}), here, quiet(), "")
    assert record["stage"] == "error" and not record["passed"]
    (record,) = run_jobs([job("a")], TrialFile(path, {"x": 1}), here, quiet(), "")
    assert record["passed"] and TrialFile(path, {"x": 1}).records["a"]["passed"]


@pytest.mark.parametrize("workers", [0, 1])
def test_no_trial_starts_when_the_time_is_up(tmp_path, workers):
    store = TrialFile(tmp_path / "trials.jsonl", {"x": 1})
    here = PoolOptions(workers=workers)
    run_jobs([job("bb")], store, PoolOptions(workers=0), quiet(), "")
    found = run_jobs([job("a", broken), job("bb")], store, here, quiet(), "", minutes=1e-9)
    assert [record["name"] for record in found] == ["bb"]


def test_a_line_cut_short_is_run_again(tmp_path):
    path = tmp_path / "trials.jsonl"
    store = TrialFile(path, {})
    store.add({"name": "a", "passed": True})
    with path.open("a") as file:
        file.write('{"name": "b", "pas')
    again = TrialFile(path, {})
    assert list(again.records) == ["a"]
    again.add({"name": "b", "passed": True})
    assert list(TrialFile(path, {}).records) == ["a", "b"]


def test_a_file_that_cannot_be_written_is_an_input_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="--out"):
        TrialFile(tmp_path / "file" / "trials.jsonl", {})


def test_an_error_is_a_failed_trial_with_its_traceback(tmp_path):
    store = TrialFile(tmp_path / "trials.jsonl", {})
    first, second = run_jobs([job("a", broken), job("b")], store, PoolOptions(workers=0), quiet(), "")
    assert not first["passed"]
    assert first["stage"] == "error"
    assert first["reason"] == "ValueError: no 1"
    assert "Traceback" in first["traceback"]
    assert second["passed"]


@pytest.mark.slow
def test_a_process_that_dies_fails_its_own_trial_only(tmp_path):
    store = TrialFile(tmp_path / "trials.jsonl", {})
    jobs = [job("a"), job("b", deadly), job("c"), job("d")]
    records = run_jobs(jobs, store, PoolOptions(workers=2), quiet(), "")
    assert [record["passed"] for record in records] == [True, False, True, True]
    assert records[1]["reason"] == "its process died"
