"""Damaged worlds and robots are refused in one line, or are what MuJoCo says they are.

A few cases run by default. For a long run:

    FUZZ_SECONDS=3600 FUZZ_SEED=7 python -m pytest tests/fuzz -m slow -s
"""

import faulthandler
import os
import shutil
import time
import traceback
import warnings
from pathlib import Path

import numpy as np
import pytest

from tests.fuzz.mutation import ROOT, damaged_toml, damaged_xml
from tests.world.probe import random_points, ray_gap
from toolkit.errors import RobotError, WorldError
from toolkit.robot.loader import find_robots, load_robot
from toolkit.world.loader import load_world

SECONDS = float(os.environ.get("FUZZ_SECONDS", 300))
SEED = int(os.environ.get("FUZZ_SEED", 0))
LIMIT = 60  # s; a case that takes longer hangs
BLOCK = 100  # cases of one process
TOLERANCE = 1.7e-3  # m; triangles lie up to 1.5 mm off their facet's plane

WORLDS = sorted((ROOT / "worlds").glob("*.xml"))


def check_world(seed: int, folder: Path) -> bool:
    """Load one damaged world; whether it was accepted."""
    rng = np.random.default_rng([seed, 1])
    path = folder / "world.xml"
    path.write_bytes(damaged_xml(WORLDS[int(rng.integers(len(WORLDS)))].read_text(), rng))
    try:
        world = load_world(path)
    except WorldError as error:
        check_line(error, path)
        return False
    numbers = rng.permutation(len(world.surfaces))[:12]
    for surface in (world.surfaces[number] for number in numbers):
        points = random_points(surface, rng, 4, inset=1e-3)
        gaps = ray_gap(world.mujoco_model, surface, points, height=0.149)
        assert (np.abs(gaps) < TOLERANCE).all(), f"surface {surface.index} of {surface.geom}: rays meet it at {gaps}"
    return True


def check_robot(seed: int, folder: Path) -> bool:
    """Load one damaged robot; whether it was accepted."""
    rng = np.random.default_rng([seed, 2])
    original = ROOT / "robots" / find_robots(ROOT / "robots")[0]
    damaged = folder / "robot"
    shutil.rmtree(damaged, ignore_errors=True)
    damaged.mkdir()
    for file in original.iterdir():
        if file.suffix in (".toml", ".xml"):
            text = file.read_text()
            hit = (file.suffix == ".toml") == (rng.random() < 0.5)
            damage = damaged_toml if file.suffix == ".toml" else damaged_xml
            (damaged / file.name).write_bytes(damage(text, rng) if hit else text.encode())
    try:
        robot = load_robot(str(damaged))
    except RobotError as error:
        check_line(error, damaged)
        return False
    numbers = (robot.home, robot.lower, robot.upper, robot.velocity_limit, robot.torque_limit, robot.armature)
    assert all(np.isfinite(values).all() for values in numbers)
    assert 0 < robot.mass < np.inf and 0 < robot.com_height < np.inf
    return True


def check_line(error: Exception, path: Path) -> None:
    """One printable line that names the file, for exit code 2."""
    text = str(error)
    assert error.exit_code == 2 and "\n" not in text and path.name in text and len(text) < 2000, repr(text)


def run_case(check, seed: int, folder: Path, capfd) -> bool:
    """One case: no hang, nothing printed, nothing left behind."""
    faulthandler.dump_traceback_later(LIMIT, exit=True)
    try:
        accepted = check(seed, folder)
    except BaseException:
        print(f"\n{check.__name__} failed with seed {seed}; its files are in {folder}")  # noqa: T201
        raise
    finally:
        faulthandler.cancel_dump_traceback_later()
    printed = capfd.readouterr()
    assert printed.out + printed.err == "", f"{check.__name__} with seed {seed} printed {printed}"
    assert {path.name for path in folder.iterdir()} <= {"world.xml", "robot"}
    return accepted


@pytest.mark.parametrize("check", [check_world, check_robot])
def test_a_few_damaged_models(check, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for seed in range(40 if check is check_world else 8):
        run_case(check, seed, tmp_path, capfd)


def run_in_child(work, capfd) -> int:
    """The number that some work returns in a child: placo keeps about 2 MB of every robot that it has read."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of forks beside the threads of libraries, which the child does not use
        child = os.fork()
    if child == 0:
        try:
            os.write(writing, str(work()).encode())
        except BaseException:
            os.write(writing, traceback.format_exc()[-4000:].encode())
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        said = pipe.read()
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert said.isdigit(), f"ended with {status}: {said} {capfd.readouterr()}"
    return int(said)


@pytest.mark.slow
@pytest.mark.parametrize("check", [check_world, check_robot])
def test_many_damaged_models(check, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    began, seed, accepted = time.monotonic(), SEED * 1_000_000, 0
    while time.monotonic() - began < SECONDS / 2:
        block = range(seed, seed + BLOCK)
        accepted += run_in_child(lambda block=block: sum(run_case(check, n, tmp_path, capfd) for n in block), capfd)
        seed += BLOCK
    with capfd.disabled():
        count = seed - SEED * 1_000_000
        print(f"\n{check.__name__}: {count} cases, {accepted} accepted, seed {SEED}")  # noqa: T201
    assert accepted
