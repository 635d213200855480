"""Links that are pushed against each other come near and do not touch; those that are far apart are free."""

import mujoco
import numpy as np
import pytest

from toolkit.control.clearance import RATE
from toolkit.control.dynamics import RobotDynamics
from toolkit.control.link_clearance import LinkClearance
from toolkit.control.qp import ContactQP
from toolkit.geometry.limb import FEET, Limb


@pytest.fixture
def made(robot):
    dynamics = RobotDynamics(robot)
    return dynamics, LinkClearance(robot, dynamics)


def inward(robot):
    """Velocities (6 + n,) that bring the feet together, each by the joint of its hip that moves it sideways most."""
    dynamics, qvel = RobotDynamics(robot), np.zeros(robot.mujoco_model.nv)
    dynamics.update(robot.home, qvel)
    for foot in FEET:
        hip = 6 + robot.joints_to(foot)[:3]
        sideways = dynamics.jacobian[foot, 1, hip]
        joint = np.argmax(np.abs(sideways))
        qvel[hip[joint]] = np.sign(sideways[joint]) * (-1.0 if foot is Limb.LEFT_FOOT else 1.0)
    return qvel


def deepest(robot, qpos):
    """Depth in m of the deepest contact of two links."""
    data = mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = qpos
    mujoco.mj_forward(robot.mujoco_model, data)
    return max(-data.contact.dist, default=0.0)


def test_links_are_free_at_home(robot, made):
    dynamics, clearance = made
    dynamics.update(robot.home, np.zeros(dynamics.nv))
    clearance.update(np.zeros(dynamics.nv))
    assert clearance.count == 0


def test_legs_pushed_together_as_hard_as_allowed_do_not_touch(robot, made):
    dynamics, clearance = made
    push, step = 3.0 * inward(robot), 0.002
    qpos, qvel = robot.home.copy(), np.zeros(dynamics.nv)
    counts = []
    for _ in range(500):
        dynamics.update(qpos, qvel)
        clearance.update(qvel)
        counts.append(clearance.count)
        rows, lower = clearance.rows[: clearance.count], clearance.lower[: clearance.count]
        missing = np.maximum(lower - rows @ push, 0.0)
        qacc = push + np.linalg.pinv(rows) @ missing if clearance.count else push
        qvel = qvel + step * qacc
        mujoco.mj_integratePos(robot.mujoco_model, qpos, qvel, step)
        assert deepest(robot, qpos) < 1e-3
    assert max(counts) > 0
    free = robot.home.copy()
    mujoco.mj_integratePos(robot.mujoco_model, free, push, 0.1)
    assert deepest(robot, free) > 1e-3  # which the push alone does not prevent


def test_rows_are_the_rates_of_distances(robot, made):
    dynamics, clearance = made
    qpos, towards = robot.home.copy(), inward(robot)
    while clearance.count == 0:
        mujoco.mj_integratePos(robot.mujoco_model, qpos, towards, 0.005)
        dynamics.update(qpos, np.zeros(dynamics.nv))
        clearance.update(np.zeros(dynamics.nv))
    row, room = clearance.rows[0].copy(), -clearance.lower[0]
    qvel = 1e-4 * towards
    dynamics.update(qpos, qvel)
    clearance.update(qvel)
    rate = RATE / robot.scale.time
    assert -clearance.lower[0] - room == pytest.approx(2.0 * rate * (row @ qvel), rel=1e-6)
    mujoco.mj_integratePos(robot.mujoco_model, qpos, towards, 1e-4)
    dynamics.update(qpos, np.zeros(dynamics.nv))
    clearance.update(np.zeros(dynamics.nv))
    assert (-clearance.lower[0] - room) / rate**2 == pytest.approx(row @ (1e-4 * towards), rel=0.02)


def test_the_quadratic_program_keeps_them_and_may_have_none(robot, made):
    dynamics, _ = made
    dynamics.update(robot.home, np.zeros(dynamics.nv))
    row = np.zeros((1, dynamics.nv))
    row[0, 6 + robot.joints_to(Limb.LEFT_FOOT)[0]] = 1.0
    found = []
    for pairs in (0, 3):
        qp = ContactQP(FEET, dynamics.nv, pairs=pairs)
        qp.set_dynamics(dynamics, robot.torque_limit)
        for limb in FEET:
            qp.set_cone(limb, 0.5, robot.half_sizes[limb], 0.7)
            qp.set_normal_force(limb, 0.0, 2000.0)
        qp.set_objective(dynamics.com_jacobian, np.zeros(3), np.full(qp.size, 1e-2), np.zeros(qp.size))
        found.append(qp.solve())
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)  # rows without a bound change nothing
    qp.set_clearance(row, np.array([3.0]))
    assert row[0] @ qp.solve()[: dynamics.nv] >= 3.0 - 1e-3
    qp.set_clearance(row[:0], np.zeros(0))
    np.testing.assert_allclose(qp.solve(), found[0], atol=1e-4)
