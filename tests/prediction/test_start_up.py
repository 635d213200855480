"""Planning with networks must not wait for torch, nor for anything else that only training needs."""

import subprocess
import sys

SCRIPT = """
import sys
from dataclasses import replace
from pathlib import Path
from tests.prediction.networks import write_random_networks
from toolkit.pipeline import make_planner
from toolkit.robot.loader import load_robot
from toolkit.search.planner import PlannerConfig
from toolkit.world.generators import rubble_field
from toolkit.world.loader import load_world
import numpy as np

robot = load_robot(None)
folder = Path(sys.argv[1])
write_random_networks(folder / "networks", robot.fingerprint)
world = load_world("world.xml", mjcf=rubble_field(np.random.default_rng(0)))
make_planner(replace(robot, folder=folder), world, "learned", PlannerConfig())
heavy = {"torch", "distributed", "dask", "matplotlib", "rerun"} & set(sys.modules)
assert not heavy, heavy
"""


def test_planning_with_networks_imports_no_torch(tmp_path):
    result = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path)], capture_output=True, text=True, timeout=300, check=False
    )
    assert result.returncode == 0, result.stderr
