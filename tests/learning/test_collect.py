"""Collections: whatever stops one, the next call goes on, and the files are those of an uninterrupted one."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from toolkit.contacts.category import Category
from toolkit.errors import DatasetError
from toolkit.learning import collect as module
from toolkit.learning.collect import collect
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.dataset import read_shard, shard_path
from toolkit.learning.jobs import executor
from toolkit.learning.samples import Samples
from toolkit.prediction.features import feature_size
from toolkit.robot.loader import load_robot


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


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_an_interrupted_collection_goes_on_to_the_same_files(tmp_path, robot, config):
    whole, halting = tmp_path / "whole", tmp_path / "halting"
    summary = collect(whole, robot, config, InlineExecutor())
    assert len(list(whole.glob("shard-*.npz"))) == config.shards == 5
    assert summary.resumed == 0 and config.samples_per_category <= summary.fewest
    shards = [read_shard(path) for path in whole.glob("shard-*.npz")]
    assert summary.samples == sum(len(group) for shard in shards for group in shard.values())
    assert summary.labelled == sum(group.known.sum() for shard in shards for group in shard.values())
    assert summary.labelled == 10 * config.samples_per_category
    assert summary.feasible == sum(group.feasible.sum() for shard in shards for group in shard.values())
    with pytest.raises(KeyboardInterrupt):
        collect(halting, robot, config, InlineExecutor(fail_at=3), ahead=1)
    assert len(list(halting.glob("shard-*.npz"))) == 2
    shard_path(halting, 2).with_suffix(".part").write_bytes(b"killed while writing")
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


SCRIPT = """
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from toolkit.learning.collect import collect
from toolkit.learning.collect_config import CollectConfig
from toolkit.robot.loader import load_robot

if __name__ == "__main__":
    robot = load_robot(None)
    config = CollectConfig(robot=robot.name, seed=7, samples_per_category=12, per_shard=2, expansions=(40, 60))
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        collect(Path(sys.argv[1]), robot, config, pool, ahead=2)
"""


@pytest.mark.slow
def test_a_collection_killed_at_any_moment_goes_on_to_the_same_files(tmp_path):
    script, killed, whole = tmp_path / "script.py", tmp_path / "killed", tmp_path / "whole"
    script.write_text(SCRIPT)
    environment = dict(os.environ, PYTHONPATH=str(Path(module.__file__).parents[2]))
    rng = np.random.default_rng(0)
    kills = 0
    while True:
        process = subprocess.Popen([sys.executable, str(script), str(killed)], env=environment, start_new_session=True)
        patience = time.monotonic() + 600
        enough = len(list(killed.glob("shard-*.npz"))) + 1 if killed.exists() else 1
        while process.poll() is None and time.monotonic() < patience:
            if kills < 3 and killed.exists() and len(list(killed.glob("shard-*.npz"))) >= enough:
                time.sleep(rng.uniform(0.0, 1.0))
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                kills += 1
                break
            time.sleep(0.01)
        if process.returncode == 0:
            break
        assert process.returncode == -signal.SIGKILL
    assert kills >= 2
    subprocess.run([sys.executable, str(script), str(whole)], env=environment, check=True)
    assert contents(killed) == contents(whole)
    assert len(contents(whole)) == 7


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
