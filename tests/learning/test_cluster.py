"""Clusters: never unencrypted over a network unless asked for, and a worker that is killed loses nothing."""

import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest

from tests.learning.test_collect import contents
from toolkit.errors import InputError, WorkerError
from toolkit.learning.collect import collect
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.jobs import executor, run_jobs
from toolkit.robot.loader import load_robot

ROOT = Path(__file__).resolve().parents[2]
ELSEWHERE = "192.0.2.1"  # of no machine: RFC 5737


@pytest.fixture
def dask_settings(monkeypatch):
    """Dask with short waits and without certificates; gives what sets it."""
    pytest.importorskip("distributed")
    dask = pytest.importorskip("dask")
    monkeypatch.setattr("toolkit.learning.cluster._PATIENCE", "0.2s")
    return dask.config.set


@pytest.mark.filterwarnings("ignore")  # of the cluster's own
@pytest.mark.parametrize(
    ("address", "message"),
    [
        (f"tcp://{ELSEWHERE}:8786", "another machine and the connection is not encrypted.* give tls://"),
        (f"{ELSEWHERE}:8786", "another machine and the connection is not encrypted"),
        (f"ws://{ELSEWHERE}:8786", "another machine and the connection is not encrypted"),
        ("tls://127.0.0.1:8786", "no certificates; name them in dask's settings"),
        (f"tls://{ELSEWHERE}:8786", "no certificates; name them in dask's settings"),
        ("127.0.0.1", "missing port number in address '127.0.0.1'; give tls://HOST:PORT"),
        ("", "missing port number"),
        ("nobody.invalid:1", "no dask scheduler answers there"),
        ("other://127.0.0.1:1", "no dask scheduler answers there .unknown address scheme 'other'"),
    ],
)
def test_addresses_that_cannot_be_used_are_refused(address, message, dask_settings):
    with pytest.raises(InputError, match=f"--cluster .*{message}") as caught, executor(1, address):
        pass
    assert "\n" not in str(caught.value)


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_elsewhere_is_used_unencrypted_where_that_is_asked_for(dask_settings):
    with (
        pytest.raises(InputError, match="no dask scheduler answers there"),
        executor(1, f"tcp://{ELSEWHERE}:8786", unencrypted=True),
    ):
        pass


@pytest.mark.filterwarnings("ignore")
def test_tls_is_the_scheme_where_dask_is_set_so(dask_settings):
    with (
        dask_settings({"distributed.comm.default-scheme": "tls"}),
        pytest.raises(InputError, match="no certificates"),
        executor(1, f"{ELSEWHERE}:8786"),
    ):
        pass


def test_a_command_says_it_in_one_line(tmp_path):
    pytest.importorskip("distributed")
    words = ["collect", "--out", str(tmp_path / "data"), "--cluster", f"tcp://{ELSEWHERE}:8786"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", "toolkit.train", *words], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 2 and done.stdout == "", done
    assert done.stderr.startswith("error: --cluster tcp://") and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "data").exists()


def die(number):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_local_process_that_is_killed_is_one_line():
    with pytest.raises(WorkerError, match="a process that did a part of the work died .*the same command goes on"):
        with executor(1) as pool:
            run_jobs(pool, die, [(1,)], print)


def own_number(seconds):
    time.sleep(seconds)
    return os.getpid()


def alone(queue):
    with executor(1) as pool:
        queue.put(pool.submit(own_number, 0.0).result())
        pool.submit(own_number, 60.0)
        os.kill(os.getpid(), signal.SIGKILL)


def test_processes_end_with_the_one_that_started_them():
    context = multiprocessing.get_context("spawn")
    queue = context.SimpleQueue()
    process = context.Process(target=alone, args=(queue,))
    process.start()
    worker = queue.get()
    process.join()
    end = time.monotonic() + 30
    while time.monotonic() < end and Path(f"/proc/{worker}/stat").exists():
        if Path(f"/proc/{worker}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
            break
        time.sleep(0.05)
    assert time.monotonic() < end, "the worker goes on"


def certificate(folder):
    """Paths of a key and a certificate that is its own authority."""
    key, own = folder / "key.pem", folder / "certificate.pem"
    words = "req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=localhost -addext subjectAltName=DNS:localhost"
    subprocess.run(["openssl", *words.split(), "-keyout", key, "-out", own], check=True, capture_output=True)
    return str(key), str(own)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_worker_killed_on_an_encrypted_cluster_loses_nothing(tmp_path):
    distributed, dask = pytest.importorskip("distributed"), pytest.importorskip("dask")
    key, own = certificate(tmp_path)
    robot = load_robot(None)
    config = CollectConfig(robot=robot.name, seed=5, samples_per_category=20, per_shard=4)
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        collect(tmp_path / "local", robot, config, pool)
    parts = {f"distributed.comm.tls.{part}.{name}": path for part in ("scheduler", "worker", "client")
             for name, path in (("key", key), ("cert", own))}  # fmt: skip
    with dask.config.set(parts | {"distributed.comm.tls.ca-file": own, "distributed.comm.require-encryption": True}):
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, security=distributed.Security()
        ) as cluster:
            assert cluster.scheduler_address.startswith("tls://")
            killed = []

            def kill(state):
                """Kill a worker after the first shard, while it makes another."""
                if state.shards >= 1 and not killed:
                    killed.append(next(iter(cluster.workers.values())).process.pid)
                    threading.Timer(0.5, os.kill, [killed[0], signal.SIGKILL]).start()

            with executor(2, cluster.scheduler_address) as pool:
                collect(tmp_path / "cluster", robot, config, pool, kill)
            assert killed
    assert contents(tmp_path / "cluster") == contents(tmp_path / "local")
    with socket.socket() as probe:  # nothing listens any more where the scheduler was
        assert probe.connect_ex(("127.0.0.1", int(cluster.scheduler_address.rpartition(":")[2]))) != 0
