"""The folder of a short walk with the robot's whole chain of stages, and of one that was planned alone."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import FLAT, FRICTION, walk
from toolkit.errors import ToolkitError
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.disturbance import Disturbance
from toolkit.pipeline import PipelineConfig, carry_out
from toolkit.report.run import RunOptions, write_run
from toolkit.search.result import Solution
from toolkit.world.loader import load_world

SETTINGS = {"push": 0.0, "mass_error": 0.02, "terrain_error": (0.001, 0.1), "replanning": True}


def called(main, *words) -> tuple[int, str]:
    """Exit code of a command, and its line of error or ""."""
    try:
        return main([str(word) for word in words]), ""
    except ToolkitError as error:
        return error.exit_code, str(error)


@pytest.fixture(scope="session")
def walk_world(robot, tmp_path_factory):
    """The file of a flat world whose goal the walk reaches."""
    path = tmp_path_factory.mktemp("world") / "flat.xml"
    path.write_text(FLAT.format(friction=FRICTION, goal=0.2 * robot.com_height))
    return path


@pytest.fixture(scope="session")
def walk_folder(robot, walk_world, tmp_path_factory):
    """The folder of a run of two steps, with a heavier robot and uneven terrain."""
    folder = tmp_path_factory.mktemp("runs") / "walk"
    folder.mkdir()
    sequence = walk(robot, 2, 0.2 * robot.com_height)
    com = np.array([[*stance.mean_feet.position[:2], robot.com_height] for stance in sequence.stances])
    solution = Solution(sequence, 7.0, 1.5, 0.1, com, 0.0 * com, np.ones(2))
    disturbance = Disturbance(mass_error=0.02, terrain_offset=0.001, terrain_tilt=np.radians(0.1))
    config = PipelineConfig(seed=5, execution=ExecutionConfig(disturbance=disturbance))
    result = carry_out(robot, load_world(walk_world), solution, config)
    assert result.passed, result.reason
    settings = {"world": walk_world, **SETTINGS}
    write_run(folder, result, RunOptions(recording=False, settings=settings))
    planned = folder.with_name("planned")
    planned.mkdir()
    trial = replace(result.trial, execution=None)
    write_run(planned, replace(result, trial=trial), RunOptions(recording=False, settings=settings))
    return folder


@pytest.fixture
def copy(walk_folder, tmp_path):
    """A copy of the folder that a test may damage."""
    return shutil.copytree(walk_folder, tmp_path / "copy")


@pytest.fixture(scope="session")
def planned_folder(walk_folder):
    """The folder of a run that came no further than its joint trajectory."""
    return walk_folder.with_name("planned")
