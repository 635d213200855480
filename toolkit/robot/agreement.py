"""Whether MuJoCo, Pinocchio and placo describe the same robot."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio

from toolkit.errors import RobotError
from toolkit.geometry.pose import Pose
from toolkit.robot.model import RobotModel
from toolkit.robot.placo import pinocchio_map, placo_wrapper

TOLERANCE = 1e-9


def check_agreement(robot: RobotModel, samples: int = 3, seed: int = 0) -> None:
    """Compare MuJoCo with the Pinocchio model inside placo.

    Compared are the mass and the joint limits, and in random states poses of bodies and sites, the CoM, the
    mass matrix and the bias forces. Largest differences measured are about 1e-12.

    Args:
        robot: loaded robot.
        samples: number of random states.
        seed: of the states.

    Raises:
        RobotError: a difference beyond 1e-9 (relative to 1 plus the magnitude).
    """
    wrapper = placo_wrapper(robot)
    model, data = wrapper.model, wrapper.model.createData()
    order = pinocchio_map(robot, model)
    if model.nv != 6 + len(robot.joint_names):
        raise RobotError(f"robot '{robot.name}': Pinocchio has {model.nv - 6} joints, MuJoCo {len(robot.joint_names)}")
    _compare(robot, "mass", pinocchio.computeTotalMass(model), robot.mass)
    _compare(robot, "lower limits", model.lowerPositionLimit[order.q_index], robot.lower)
    _compare(robot, "upper limits", model.upperPositionLimit[order.q_index], robot.upper)

    rng = np.random.default_rng(seed)
    state = mujoco.MjData(robot.mujoco_model)
    for _ in range(samples):
        qpos, qvel = random_state(robot, rng)
        state.qpos[:], state.qvel[:] = qpos, qvel
        mujoco.mj_forward(robot.mujoco_model, state)
        q, v = order.q_from_qpos(qpos), order.v_from_qvel(qpos, qvel)
        pinocchio.framesForwardKinematics(model, data, q)
        for name, pose in _frames(robot.mujoco_model, state):
            frame = data.oMf[model.getFrameId(name)]
            _compare(robot, f"position of '{name}'", frame.translation, pose.position)
            _compare(robot, f"rotation of '{name}'", frame.rotation, pose.rotation)
        _compare(robot, "centre of mass", pinocchio.centerOfMass(model, data, q), state.subtree_com[1])
        mass = pinocchio.crba(model, data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        _compare(robot, "mass matrix", order.matrix_to_mujoco(qpos, mass), _mass_matrix(robot.mujoco_model, state))
        # Inverse dynamics of the same motion: qacc = 0 leaves MuJoCo's bias, in the space of qvel.
        bias = pinocchio.rnea(model, data, q, v, order.a_from_qacc(qpos, qvel, np.zeros_like(qvel)))
        _compare(robot, "bias forces", order.qvel_from_v(qpos, bias), state.qfrc_bias)


def random_state(robot: RobotModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A random base pose, joints inside their ranges, and velocities: qpos (7 + n,), qvel (6 + n,)."""
    quaternion = rng.standard_normal(4)
    joints = rng.uniform(robot.lower, robot.upper)
    qpos = np.concatenate([rng.uniform(-1, 1, 3), quaternion / np.linalg.norm(quaternion), joints])
    return qpos, rng.uniform(-1, 1, 6 + len(joints))


def _frames(model: mujoco.MjModel, data: mujoco.MjData) -> list[tuple[str, Pose]]:
    bodies = [(model.body(b).name, Pose(data.xmat[b].reshape(3, 3), data.xpos[b])) for b in range(1, model.nbody)]
    sites = [(model.site(s).name, Pose(data.site_xmat[s].reshape(3, 3), data.site_xpos[s])) for s in range(model.nsite)]
    return bodies + sites


def _mass_matrix(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    matrix = np.zeros((model.nv, model.nv))
    for column in range(model.nv):  # mj_mulM keeps its signature between releases, mj_fullM does not
        unit = np.zeros(model.nv)
        unit[column] = 1.0
        mujoco.mj_mulM(model, data, matrix[column], unit)
    return matrix


def _compare(
    robot: RobotModel, what: str, pinocchio_value: np.ndarray | float, mujoco_value: np.ndarray | float
) -> None:
    difference = np.abs(np.asarray(pinocchio_value) - np.asarray(mujoco_value)) / (1 + np.abs(mujoco_value))
    if not difference.max() <= TOLERANCE:
        raise RobotError(
            f"robot '{robot.name}': MuJoCo and Pinocchio differ in {what} by {difference.max():.2e} (at most "
            f"{TOLERANCE:g}); the model uses something that the URDF conversion does not know"
        )
