"""Damaged worlds and robots are refused in one line, or are what MuJoCo says they are.

A few cases run by default. For a long run see `tests/fuzz/budget.py`.
"""

import faulthandler
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

from tests.fuzz.budget import SEED, seconds
from tests.fuzz.children import run_in_child
from tests.fuzz.mutation import ROOT, damaged_toml, damaged_xml
from tests.shipped_robots import OWN
from tests.world.probe import random_points, ray_gap
from toolkit.errors import RobotError, WorldError
from toolkit.robot.loader import load_robot
from toolkit.world.loader import load_world

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
    original = ROOT / "robots" / OWN[0]
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


@pytest.mark.slow
@pytest.mark.parametrize("check", [check_world, check_robot])
def test_many_damaged_models(check, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    time_given = seconds("worlds" if check is check_world else "robots")
    began, seed, accepted = time.monotonic(), SEED * 1_000_000, 0
    while time.monotonic() - began < time_given:
        block = range(seed, seed + BLOCK)

        def work(block=block) -> int:
            return sum(run_case(check, number, tmp_path, capfd) for number in block)

        accepted += run_in_child(work, BLOCK * LIMIT)
        seed += BLOCK
    with capfd.disabled():
        count = seed - SEED * 1_000_000
        print(f"\n{check.__name__}: {count} cases, {accepted} accepted, seed {SEED}")  # noqa: T201
    assert accepted
