"""A robot from robots/."""

import pytest

from tests.shipped_robots import OWN
from toolkit.robot.loader import load_robot


@pytest.fixture(scope="session")
def robot():
    return load_robot(OWN[0])
