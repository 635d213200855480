"""A run ends in balance where the capture point lies within the soles."""

import numpy as np
import pytest

from toolkit.execution.balance import unbalance

FEET = np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]])
LEVEL = np.stack([np.eye(3)] * 2)
HALF = np.full((2, 2), 0.1)


def found(com, velocity, half=HALF, rotations=LEVEL):
    return unbalance(np.array(com), np.array(velocity), FEET, rotations, half, 9.81)


def test_a_robot_that_stands_is_balanced():
    assert found((0.05, 0.0, 0.9), (0.0, 0.0, 0.0)) == 0.0


def test_a_com_between_feet_on_lines_is_balanced_and_one_ahead_of_them_is_not():
    lines = np.array([[0.0, 0.02], [0.0, 0.02]])
    assert found((0.0, 0.0, 0.9), (0.0, 0.0, 0.0), lines) == 0.0
    assert found((0.03, 0.0, 0.9), (0.0, 0.0, 0.0), lines) == pytest.approx(0.03)


def test_speed_counts_as_the_way_that_it_takes_to_stop():
    fast = 0.5
    way = fast * np.sqrt(0.9 / 9.81)
    assert found((0.0, 0.0, 0.9), (fast, 0.0, 0.0)) == pytest.approx(way - 0.1)
    assert found((0.0, 0.0, 0.9), (fast / 4, 0.0, 0.0)) == 0.0
    assert found((0.0, 0.0, 0.9), (0.0, 0.0, -1.0)) == 0.0


def test_soles_count_as_they_are_turned():
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    half = np.array([[0.2, 0.05], [0.2, 0.05]])
    assert found((0.1, 0.0, 0.9), (0.0, 0.0, 0.0), half) == 0.0
    assert found((0.1, 0.0, 0.9), (0.0, 0.0, 0.0), half, np.stack([turned] * 2)) == pytest.approx(0.05)
