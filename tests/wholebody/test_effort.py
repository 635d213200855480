"""Torques of trunk, head and arms during inverse kinematics."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.wholebody.conftest import world_of
from toolkit.geometry.limb import FEET, Limb
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
    joints = effort.joints[None]
    np.testing.assert_allclose(found[joints], expected[joints], rtol=0.05, atol=0.5)


@pytest.mark.parametrize("swinging", [None, Limb.LEFT_FOOT, Limb.RIGHT_FOOT])
@pytest.mark.parametrize("standing", [None, Limb.LEFT_FOOT])
def test_rows_hold_torques_at_their_limits(robot, flat_walk, swinging, standing):
    """A displacement at the bound of a row needs exactly the limit, while the standing foot carries the base."""
    if swinging is not None and swinging == standing:
        pytest.skip("a foot does not do both")
    effort, rng = Effort(robot, TICK), np.random.default_rng(1)
    nv, joints = 6 + len(robot.joint_names), effort.joints[swinging]
    step = np.zeros(nv)
    step[6 + joints] = rng.choice([-1.0, 1.0], len(joints)) * 0.02
    torque = effort.torques(0.0, robot.home, np.zeros(nv), step, flat_walk.motion)
    assert effort.exceeded(torque, swinging)
    rows, bound = effort.rows(torque, step, swinging, standing)
    assert (rows @ step[6:] > bound).any()
    changed = step.copy()
    changed[6:] += np.linalg.lstsq(rows, bound - rows @ step[6:])[0]
    if standing is not None:
        jacobian = np.zeros((6, nv))
        mujoco.mj_jacSite(effort.model, effort.data, jacobian[:3], jacobian[3:], effort.sites[standing])
        changed[:6] -= np.linalg.solve(jacobian[:, :6], jacobian[:, 6:] @ (changed - step)[6:])
        np.testing.assert_allclose(jacobian @ changed, jacobian @ step, atol=1e-9)
    after = effort.torques(0.0, robot.home, np.zeros(nv), changed, flat_walk.motion)
    near = joints[np.abs(torque[joints]) > 0.7 * effort.limit[joints]]
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
