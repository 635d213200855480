"""The controller's model against MuJoCo's own dynamics and finite differences."""

import mujoco
import numpy as np
import pytest

from tests.shipped_robots import OWN
from toolkit.control.dynamics import RobotDynamics
from toolkit.robot.loader import load_robot


@pytest.fixture(params=OWN, scope="module")
def robot(request):
    return load_robot(request.param)


def random_state(robot, rng):
    qpos = robot.home.copy()
    qpos[:3] += rng.normal(size=3)
    qpos[3:7] = rng.normal(size=4)
    qpos[3:7] /= np.linalg.norm(qpos[3:7])
    qpos[7:] = rng.uniform(robot.lower, robot.upper)
    return qpos, rng.normal(size=robot.mujoco_model.nv)


def advanced(robot, qpos, qvel, step):
    """The state `step` seconds later at constant generalised velocity."""
    later = qpos.copy()
    mujoco.mj_integratePos(robot.mujoco_model, later, qvel, step)
    return later


def test_equation_of_motion_is_that_of_mujoco(robot):
    rng = np.random.default_rng(0)
    dynamics, model = RobotDynamics(robot), robot.mujoco_model
    data = mujoco.MjData(model)
    for _ in range(5):
        qpos, qvel = random_state(robot, rng)
        qdd = rng.normal(size=model.nv)
        dynamics.update(qpos, qvel)
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos, qvel, qdd
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_passive(model, data)
        bodies = np.zeros(model.nv)
        mujoco.mj_rne(model, data, 1, bodies)  # recursive Newton-Euler of the bodies, a route without mass matrix
        expected = bodies + model.dof_armature * qdd - data.qfrc_passive
        np.testing.assert_allclose(dynamics.mass_matrix @ qdd + dynamics.bias, expected, atol=1e-9)


def test_limb_jacobians_and_drift_are_derivatives(robot):
    rng = np.random.default_rng(1)
    dynamics, step = RobotDynamics(robot), 1e-6
    for _ in range(3):
        qpos, qvel = random_state(robot, rng)

        def poses(time, qpos=qpos, qvel=qvel):
            dynamics.update(advanced(robot, qpos, qvel, time), qvel)
            return dynamics.limb_position.copy(), dynamics.limb_rotation.copy(), dynamics.limb_velocity.copy()

        (p0, r0, v0), (p1, r1, v1) = poses(-step), poses(step)
        dynamics.update(qpos, qvel)
        for limb in dynamics.limbs:
            linear = (p1[limb] - p0[limb]) / (2 * step)
            spin = (r1[limb] - r0[limb]) / (2 * step) @ dynamics.limb_rotation[limb].T
            angular = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
            # central differences of values near 10: 1e-16 * 10 / 1e-6
            np.testing.assert_allclose(dynamics.limb_velocity[limb], np.r_[linear, angular], atol=1e-7)
            np.testing.assert_allclose(dynamics.drift[limb], (v1[limb] - v0[limb]) / (2 * step), atol=1e-6)


def test_momentum_and_its_rate(robot):
    rng = np.random.default_rng(2)
    dynamics, model, step = RobotDynamics(robot), robot.mujoco_model, 1e-6
    data = mujoco.MjData(model)
    for _ in range(3):
        qpos, qvel = random_state(robot, rng)
        qdd = rng.normal(size=model.nv)

        def momentum(time, qpos=qpos, qvel=qvel, qdd=qdd):
            later = advanced(robot, qpos, qvel + 0.5 * time * qdd, time)
            dynamics.update(later, qvel + time * qdd)
            return dynamics.com_velocity.copy(), dynamics.angular_momentum.copy()

        (c0, k0), (c1, k1) = momentum(-step), momentum(step)
        dynamics.update(qpos, qvel)
        data.qpos[:], data.qvel[:] = qpos, qvel
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        base = model.body(robot.base).id
        np.testing.assert_allclose(dynamics.com_velocity, data.subtree_linvel[base], atol=1e-10)
        np.testing.assert_allclose(dynamics.angular_momentum, data.subtree_angmom[base], atol=1e-9)
        np.testing.assert_allclose(dynamics.com_jacobian @ qdd + dynamics.com_drift, (c1 - c0) / (2 * step), atol=1e-6)
        rate = dynamics.momentum_jacobian @ qdd + dynamics.momentum_drift
        np.testing.assert_allclose(rate, (k1 - k0) / (2 * step), atol=1e-5)
