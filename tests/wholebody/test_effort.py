"""Torques of trunk, head and arms during inverse kinematics."""

from dataclasses import replace

import numpy as np
import pytest

from tests.wholebody.conftest import world_of
from toolkit.geometry.limb import FEET
from toolkit.wholebody.effort import SHARE, Effort
from toolkit.wholebody.limb_paths import limb_paths
from toolkit.wholebody.motion_dynamics import inverse_dynamics
from toolkit.wholebody.plan import solve_ik

TICK = 0.01


def test_torques_are_those_of_the_inverse_dynamics(robot, flat_walk):
    """Along a trajectory the same torques come out as from the check's differences."""
    rng = np.random.default_rng(0)
    times = TICK * np.arange(3)
    step = 1e-3 * rng.normal(size=(2, 6 + len(robot.joint_names)))
    step[:, 3:6] = 0.0  # a turning base adds differences of second order
    qpos = np.stack([robot.home] * 3)
    for index in range(2):
        qpos[index + 1] = qpos[index]
        qpos[index + 1, :3] += step[index, :3]
        qpos[index + 1, 7:] += step[index, 6:]
    expected = inverse_dynamics(robot, flat_walk.motion, times, qpos)[1, 6:]
    effort = Effort(robot, TICK)
    before = step[0].copy()
    found = effort.torques(times[1], qpos[1], before, step[1], flat_walk.motion)
    # velocities are means of both ticks there and those of the tick before here: they only enter Coriolis forces
    np.testing.assert_allclose(found, expected[effort.joints], rtol=0.05, atol=0.5)


def test_rows_hold_torques_at_their_limits(robot, flat_walk):
    """A displacement at the bound of a row needs exactly the limit."""
    effort, rng = Effort(robot, TICK), np.random.default_rng(1)
    nv = 6 + len(robot.joint_names)
    step = np.zeros(nv)
    step[6 + effort.joints] = rng.choice([-1.0, 1.0], len(effort.joints)) * 0.02
    torque = effort.torques(0.0, robot.home, np.zeros(nv), step, flat_walk.motion)
    assert effort.exceeded(torque)
    rows, bound = effort.rows(torque, step)
    assert (rows @ step[6:] > bound).any()
    changed = step.copy()
    changed[6:] += np.linalg.lstsq(rows, bound - rows @ step[6:])[0]
    after = effort.torques(0.0, robot.home, np.zeros(nv), changed, flat_walk.motion)
    near = np.abs(torque) > 0.7 * effort.limit
    np.testing.assert_allclose(np.abs(after[near]), effort.limit[near], rtol=1e-6)


@pytest.mark.parametrize("share", [1.0, 0.1])
def test_weak_motors_are_spared(robot, flat_walk, share):
    """Trunk and arms swing no more than their motors allow, which costs nothing but momentum."""
    above = ~robot.carrying(FEET)
    rest = np.abs(inverse_dynamics(robot, flat_walk.motion, np.array([0.0, 0.1]), np.stack([robot.home] * 2))[0, 6:])
    limit = np.where(above, share * robot.torque_limit + 2.0 * rest, robot.torque_limit)
    weak = replace(robot, torque_limit=limit)
    paths = limb_paths(weak, world_of(""), flat_walk.schedule, flat_walk.motion)
    times = np.arange(0.0, flat_walk.schedule.duration, 0.02)
    qpos = solve_ik(weak, paths, flat_walk.motion, times)
    torque = np.abs(inverse_dynamics(weak, flat_walk.motion, times, qpos)[:, 6:])
    assert (torque[:, above] <= (1.0 + (1.0 - SHARE)) * limit[above]).all()
