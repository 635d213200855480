"""Arms give way in time to walls that they have not reached yet."""

import numpy as np
import pytest

from tests.wholebody.conftest import world_of
from tests.wholebody.test_avoidance import outermost
from toolkit.geometry.limb import PALMS
from toolkit.wholebody.arms_ahead import AHEAD, ArmsAhead
from toolkit.world.scene import compose_scene

TICK = 0.01  # s
OVERLAP = 0.03  # m; of the left hand's middle with a wall that stands farther ahead


@pytest.fixture
def walk(robot):
    """Times and states of a robot that is carried 1 m ahead in 4 s."""
    times = np.linspace(0.0, 4.0, 401)
    qpos = np.tile(robot.home, (len(times), 1))
    qpos[:, 0] += 0.25 * times
    return times, qpos


@pytest.fixture
def ahead(robot, walk, hand):
    front, side = hand[0] + 0.4, hand[1] - OVERLAP
    wall = f'<geom name="wall" type="box" size="1 0.5 1.5" pos="{front + 1.0} {side + 0.5} 1.5"/>'
    return ArmsAhead(robot, compose_scene(robot, world_of(wall)), *walk)


def test_nothing_pushes_in_the_open(robot, walk):
    ahead = ArmsAhead(robot, compose_scene(robot, world_of("")), *walk)
    assert not ahead.touch
    assert not len(ahead.dampers(0.0, robot.home[7:], TICK, set()).bound)


def test_an_arm_is_led_in_before_it_is_at_a_wall(robot, ahead):
    """The front of the wall is what is near; what the dampers ask for is to leave its side."""
    assert ahead.touch
    assert not len(ahead.dampers(0.0, robot.home[7:], TICK, set()).bound)  # it is too far away yet
    found = ahead.dampers(1.0, robot.home[7:], TICK, set())
    row = found.matrix[np.argmin(found.bound)]
    assert found.bound.min() < 0.0 and np.linalg.norm(row) > 0.1
    step = robot.home.copy()
    step[7:] -= 0.01 * row / np.linalg.norm(row)
    assert outermost(robot, step) < outermost(robot, robot.home) - 1e-3


def test_rows_are_derivatives_of_the_distance(robot, ahead):
    h, direction = 1e-6, np.random.default_rng(0).normal(size=len(robot.joint_names))
    before, after = (ahead.dampers(1.0, robot.home[7:] + x * direction, TICK, set()) for x in (0.0, h))
    deepest = int(np.argmin(before.bound))
    change = (after.bound - before.bound)[deepest] * ahead._damper.time / TICK / h
    np.testing.assert_allclose(change, -before.matrix[deepest] @ direction, rtol=0.05, atol=1e-3)


def test_an_arm_that_reaches_for_the_wall_may_come_near(robot, ahead):
    found = ahead.dampers(1.0, robot.home[7:], TICK, set(PALMS))
    assert not len(found.bound)
    assert AHEAD.room == 0.0  # nothing that is clear is noticed
