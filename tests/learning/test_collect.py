"""Collections: whatever stops one, the next call goes on, and the files are those of an uninterrupted one."""

import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from toolkit.contacts.category import Category
from toolkit.drafts import draft_in
from toolkit.errors import DatasetError
from toolkit.learning import collect as module
from toolkit.learning.collect import collect
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.dataset import read_shard, shard_path, write_shard
from toolkit.learning.jobs import executor
from toolkit.learning.samples import Samples
from toolkit.prediction.features import feature_size
from toolkit.robot.loader import load_robot
from toolkit.train import main


class InlineExecutor(Executor):
    """Does the work at once, and fails at the job with a given number."""

    def __init__(self, fail_at=None):
        self.jobs, self.fail_at = 0, fail_at

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        self.jobs += 1
        if self.jobs == self.fail_at:
            future.set_exception(KeyboardInterrupt())
        else:
            future.set_result(fn(*args, **kwargs))
        return future


def quick_shard(config, index):
    """A shard of random numbers instead of labels."""
    rng = np.random.default_rng([config.seed, index])
    n = 2 * config.per_shard + int(rng.integers(3))
    labelled = np.arange(n) < config.per_shard
    return {
        category: Samples(
            rng.normal(size=(n, feature_size(category))).astype(np.float32),
            labelled | (rng.random(n) < 0.3),
            np.where(labelled[:, None], rng.normal(size=(n, 7)), np.nan).astype(np.float32),
            rng.normal(size=(n, 3)).astype(np.float32),
            np.full(n, index, np.int32),
        )
        for category in Category
    }


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


@pytest.fixture
def config(robot, monkeypatch):
    monkeypatch.setattr(module, "collect_shard", quick_shard)
    return CollectConfig(robot=robot.name, seed=1, samples_per_category=50, per_shard=10)


def left_by_a_killed_process(folder):
    """A draft of a process that has ended."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    draft = draft_in(folder).name.replace(f".{os.getpid()}-", f".{ended.pid}-")
    (folder / draft).write_bytes(b"killed while writing")


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_an_interrupted_collection_goes_on_to_the_same_files(tmp_path, robot, config):
    whole, halting = tmp_path / "whole", tmp_path / "halting"
    summary = collect(whole, robot, config, InlineExecutor())
    assert len(list(whole.glob("shard-*.npz"))) == config.shards == 5
    assert summary.resumed == 0 and config.samples_per_category <= min(summary.labels.values())
    shards = [read_shard(path) for path in whole.glob("shard-*.npz")]
    assert summary.samples == sum(len(group) for shard in shards for group in shard.values())
    assert summary.labelled == sum(group.known.sum() for shard in shards for group in shard.values())
    assert summary.labelled == 10 * config.samples_per_category
    assert summary.feasible == sum(group.feasible.sum() for shard in shards for group in shard.values())
    with pytest.raises(KeyboardInterrupt):
        collect(halting, robot, config, InlineExecutor(fail_at=3), ahead=1)
    assert len(list(halting.glob("shard-*.npz"))) == 2
    left_by_a_killed_process(halting)
    before = {path.name: path.stat().st_mtime_ns for path in halting.glob("shard-*.npz")}
    seen = []
    executor = InlineExecutor()
    again = collect(halting, robot, config, executor, seen.append)
    assert executor.jobs == 3  # nothing is made twice
    assert all((halting / name).stat().st_mtime_ns == time for name, time in before.items())
    assert again.labelled == summary.labelled and 0 < again.resumed < again.labelled
    assert [state.shards for state in seen] == [2, 3, 4, 5]
    assert contents(halting) == contents(whole)
    # A larger collection keeps what there is.
    more = InlineExecutor()
    collect(halting, robot, replace(config, samples_per_category=70), more)
    assert more.jobs == 2


def test_a_broken_shard_is_refused_by_name(tmp_path, robot, config):
    collect(tmp_path, robot, config, InlineExecutor())
    path = shard_path(tmp_path, 3)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(DatasetError, match=r"shard-000003.npz: truncated or not a shard.*delete it"):
        collect(tmp_path, robot, config, InlineExecutor())


@pytest.mark.parametrize(
    ("change", "message"),
    [({"seed": 2}, "begun with seed 1, now 2"), ({"per_shard": 11}, "begun with settings")],
)
def test_other_settings_do_not_mix(tmp_path, robot, config, change, message):
    collect(tmp_path, robot, config, InlineExecutor())
    with pytest.raises(DatasetError, match=message):
        collect(tmp_path, robot, replace(config, **change), InlineExecutor())


def test_another_robot_or_a_foreign_folder_is_refused(tmp_path, robot, config):
    collect(tmp_path / "data", robot, config, InlineExecutor())
    with pytest.raises(DatasetError, match="begun with fingerprint"):
        collect(tmp_path / "data", replace(robot, fingerprint="other"), config, InlineExecutor())
    (tmp_path / "letter.txt").write_text("not a data set")
    with pytest.raises(DatasetError, match="not empty and not a data set"):
        collect(tmp_path, robot, config, InlineExecutor())


def test_a_collection_killed_before_its_manifest_was_written_begins_again(tmp_path, robot, config):
    collect(tmp_path / "whole", robot, config, InlineExecutor())
    (tmp_path / "killed").mkdir()
    left_by_a_killed_process(tmp_path / "killed")
    collect(tmp_path / "killed", robot, config, InlineExecutor())
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")


def test_shards_written_twice_at_once_are_whole(tmp_path, config):
    """Two collections into one folder make the same shards, also in threads of one process."""
    samples = quick_shard(config, 0)
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda _: write_shard(tmp_path, 0, samples), range(40)))
    assert list(contents(tmp_path)) == ["shard-000000.npz"]
    again = read_shard(shard_path(tmp_path, 0))
    assert all(np.array_equal(again[category].features, group.features) for category, group in samples.items())


def test_few_samples_make_a_small_shard_and_more_go_on_with_such_shards(tmp_path, config, monkeypatch):
    @contextmanager
    def inline(*where, **how):
        yield InlineExecutor()

    monkeypatch.setattr("toolkit.learning.jobs.executor", inline)
    words = ["collect", "--no-networks", "--out", str(tmp_path)]
    assert main([*words, "--samples", "3"]) == 0
    (shard,) = tmp_path.glob("shard-*.npz")
    assert {group.known.sum() for group in read_shard(shard).values()} == {3}
    first = contents(tmp_path)
    assert main([*words, "--samples", "100"]) == 0
    assert len(list(tmp_path.glob("shard-*.npz"))) == 34 and first.items() <= contents(tmp_path).items()


COMMAND = """
import sys
from functools import partialmethod
from toolkit import cli, train
from toolkit.learning.collect_config import CollectConfig

if __name__ == "__main__":
    CollectConfig.__init__ = partialmethod(CollectConfig.__init__, expansions=(40, 60))
    CollectConfig.per_shard = 2
    cli.run(train.main, ["collect", "--seed", "7", "--samples", "12", "--workers", "2", "--out", sys.argv[1]])
"""


@pytest.mark.slow
def test_a_collection_killed_at_any_moment_goes_on_to_the_same_files(tmp_path):
    script, whole = tmp_path / "script.py", tmp_path / "whole"
    script.write_text(COMMAND)
    environment = dict(os.environ, PYTHONPATH=str(Path(module.__file__).parents[2]))

    def begin(folder):
        words = [sys.executable, str(script), str(folder)]
        return subprocess.Popen(words, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    for _ in range(2):  # the second one takes as long as any that finds its kernels on disk
        shutil.rmtree(whole, ignore_errors=True)
        began = time.monotonic()
        process = begin(whole)
        assert process.communicate()[1] == "" and process.returncode == 0
    seconds = time.monotonic() - began
    rng = np.random.default_rng(0)
    kills = round_ = 0
    while kills < 20:
        folder, round_ = tmp_path / f"killed{round_}", round_ + 1
        while True:
            process = begin(folder)
            try:
                error = process.communicate(timeout=rng.uniform(0.0, seconds) if kills < 20 else 600)[1]
            except subprocess.TimeoutExpired:
                process.send_signal(rng.choice([signal.SIGKILL, signal.SIGTERM]))
                kills += 1
                error = process.communicate()[1]
            if process.returncode == 0:
                break
            # A signal that comes before anything is imported ends the process as any other.
            assert process.returncode in (-signal.SIGKILL, -signal.SIGTERM, 128 + signal.SIGTERM), error
            if process.returncode != -signal.SIGKILL:  # Python itself tells of what it clears up behind a killed one
                assert error == ("terminated\n" if process.returncode > 0 else ""), error
        assert contents(folder) == contents(whole), f"after {kills} kills"
    sys.stdout.write(f"\n{kills} kills in {round_} collections of {seconds:.0f} s\n")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the cluster's own
def test_a_cluster_makes_the_same_shards(tmp_path, robot):
    distributed = pytest.importorskip("distributed")
    config = CollectConfig(robot=robot.name, seed=5, samples_per_category=4, per_shard=2, expansions=(40, 60))
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        collect(tmp_path / "local", robot, config, pool)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        executor(2, cluster.scheduler_address) as pool,
    ):
        collect(tmp_path / "cluster", robot, config, pool)
    assert contents(tmp_path / "cluster") == contents(tmp_path / "local")
