"""Robots with one arm, or with feet only: a plan, every command of the training, and a plan judged by what it made."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import pytest

from tests.robot.samples import TOML, arm_toml, biped_mjcf, write_robot
from toolkit import plan, train
from toolkit.contacts.category import categories_of
from toolkit.learning import collect_config, fit, jobs
from toolkit.learning.collect_config import CollectConfig
from toolkit.learning.dataset import read_dataset
from toolkit.prediction.networks import load_networks
from toolkit.robot.loader import load_robot
from toolkit.robots import main as show_robots

WORLD = """<mujoco><worldbody>
  <geom type="plane" size="0 0 1" friction="0.7"/>
  <geom type="box" pos="0.3 0.62 1.1" size="1.0 0.02 0.5" friction="0.7"/>
  <geom type="box" pos="0.3 -0.62 1.1" size="1.0 0.02 0.5" friction="0.7"/>
  <site name="start" pos="0 0 0"/>
  <site name="goal" type="cylinder" pos="0.6 0 0" size="0.15 0.01"/>
</worldbody></mujoco>"""
ROBOTS = {
    "feet_only": (biped_mjcf(), TOML),
    "left_arm": (biped_mjcf("left"), arm_toml("left")),
    "right_arm": (biped_mjcf("right"), arm_toml("right")),
}


@dataclass(frozen=True)
class Small(CollectConfig):
    per_shard: int = 8
    paper_share: float = 0.8
    most_worlds: int = 30


@pytest.mark.parametrize("name", ["feet_only", "left_arm", pytest.param("right_arm", marks=pytest.mark.slow)])
def test_a_robot_goes_through_every_command(name, tmp_path, monkeypatch):
    model, toml = ROBOTS[name]
    robot = load_robot(str(write_robot(tmp_path / "robots" / name, model, toml)))
    categories = categories_of(robot)
    options = ["--robot", name, "--robots", str(tmp_path / "robots")]
    world = tmp_path / "walls.xml"
    world.write_text(WORLD)

    def planned(planner):
        out = ["--out", str(tmp_path / planner), "--no-recording"]
        return plan.main([str(world), *options, *out, "--planner", planner, "--expansions", "30"])

    def trained(command, *more):
        return train.main([command, *options, *more])

    assert show_robots([name, *options[2:]]) == 0
    assert planned("kinematic") == 0

    # Few samples, made in this process; the commands themselves are as they are.
    monkeypatch.setattr(jobs, "executor", lambda workers, cluster, unencrypted: ThreadPoolExecutor(1))
    monkeypatch.setattr(collect_config, "CollectConfig", Small)
    monkeypatch.setattr(fit, "MINIMUM", 3)
    data = str(tmp_path / "data")
    assert trained("collect", "--out", data, "--samples", "8") == 0
    samples = read_dataset(tmp_path / "data", robot.fingerprint)
    assert list(samples) == categories and min(group.known.sum() for group in samples.values()) >= 8
    assert trained("fit", "--data", data, "--epochs", "2", "--workers", "1") == 0
    assert list(load_networks(robot)) == categories
    assert trained("evaluate", "--data", data, "--count", "20", "--split", "all") == 0
    assert planned("learned") in (0, 1)  # what so little training says of a plan is open
    for group in samples.values():
        assert np.isfinite(group.features).all()
