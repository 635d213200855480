"""A robot from robots/."""

from pathlib import Path

import pytest

from toolkit.robot.loader import load_robot

ROBOTS = sorted(path.parent.name for path in Path("robots").glob("*/robot.toml"))


@pytest.fixture(scope="session")
def robot():
    return load_robot(ROBOTS[0])
