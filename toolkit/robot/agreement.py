"""Whether MuJoCo, Pinocchio and placo describe the same robot."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
import pinocchio

from toolkit.errors import RobotError
from toolkit.geometry.pose import Pose
from toolkit.robot.model import RobotModel
from toolkit.robot.placo import PinocchioMap, placo_wrapper

TOLERANCE = 1e-9  # largest difference, divided by one plus the magnitude
_SAMPLES = 3  # random states that are compared


def check_agreement(robot: RobotModel) -> None:
    """Raise RobotError if MuJoCo and the Pinocchio model inside placo differ by more than the tolerance."""
    other = placo_wrapper(robot).model
    if other.nv != robot.mujoco_model.nv:
        raise RobotError(f"robot '{robot.name}': Pinocchio has {other.nv} velocities, MuJoCo {robot.mujoco_model.nv}")
    differences = compare_dynamics(robot.mujoco_model, other, samples=_SAMPLES, rng=np.random.default_rng(0))
    for what, difference in differences.items():
        if not difference <= TOLERANCE:
            raise RobotError(
                f"robot '{robot.name}': MuJoCo and Pinocchio differ in {what} by {difference:.2e} (at most "
                f"{TOLERANCE:g}); the model uses something that the URDF conversion does not know"
            )


def compare_dynamics(
    model: mujoco.MjModel, other: pinocchio.Model, *, samples: int, rng: np.random.Generator
) -> dict[str, float]:
    """Largest differences between a MuJoCo model and the Pinocchio model of its URDF.

    The mass and the joint limits are compared, and in random states the poses of bodies and sites, the CoM, the mass
    matrix, and the forces that gravity and velocities cause.

    Args:
        model: A floating tree.
        other: The same tree in Pinocchio, with the armature.
        samples: Number of random states: base anywhere, joints inside their ranges, velocities up to 1.
        rng: Source of the states.

    Returns:
        Largest absolute difference of each quantity, divided by one plus the magnitude; inf if a value is not finite.
    """
    order = PinocchioMap.of([model.joint(j).name for j in range(1, model.njnt)], other)
    worst: dict[str, float] = {}

    def compare(what: str, value: np.ndarray | float, expected: np.ndarray | float) -> None:
        difference = np.max(np.abs(np.asarray(value) - expected) / (1 + np.abs(expected)))
        worst[what] = max(worst.get(what, 0.0), float(difference) if np.isfinite(difference) else np.inf)

    limited = model.jnt_limited[1:].astype(bool)
    compare("mass", pinocchio.computeTotalMass(other), model.body_mass.sum())
    compare("lower limits", other.lowerPositionLimit[order.q_index[limited]], model.jnt_range[1:][limited, 0])
    compare("upper limits", other.upperPositionLimit[order.q_index[limited]], model.jnt_range[1:][limited, 1])
    state, data = mujoco.MjData(model), other.createData()
    for _ in range(samples):
        state.qpos[:], state.qvel[:] = _random_state(model, rng)
        mujoco.mj_forward(model, state)
        qpos, qvel = state.qpos.copy(), state.qvel.copy()
        q, v = order.q_from_qpos(qpos), order.v_from_qvel(qpos, qvel)
        pinocchio.framesForwardKinematics(other, data, q)
        for name, pose in _frames(model, state):
            frame = data.oMf[other.getFrameId(name)]
            compare(f"position of '{name}'", frame.translation, pose.position)
            compare(f"rotation of '{name}'", frame.rotation, pose.rotation)
        compare("centre of mass", pinocchio.centerOfMass(other, data, q), state.subtree_com[1])
        mass = pinocchio.crba(other, data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        compare("mass matrix", order.matrix_to_mujoco(qpos, mass), _mass_matrix(model, state))
        # The force that keeps qacc at zero is MuJoCo's bias; its frame is converted like that of a velocity.
        bias = pinocchio.rnea(other, data, q, v, order.a_from_qacc(qpos, qvel, np.zeros_like(qvel)))
        compare("bias forces", order.qvel_from_v(qpos, bias), state.qfrc_bias)
    return worst


def _random_state(model: mujoco.MjModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    quaternion = rng.standard_normal(4)
    ranges = np.where(model.jnt_limited[1:, None], model.jnt_range[1:], np.array([-1.0, 1.0]))
    joints = rng.uniform(ranges[:, 0], ranges[:, 1])
    qpos = np.concatenate([rng.uniform(-1, 1, 3), quaternion / np.linalg.norm(quaternion), joints])
    return qpos, rng.uniform(-1, 1, model.nv)


def _frames(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[tuple[str, Pose]]:
    for body in range(1, model.nbody):
        yield model.body(body).name, Pose(data.xmat[body].reshape(3, 3), data.xpos[body])
    for site in range(model.nsite):
        yield model.site(site).name, Pose(data.site_xmat[site].reshape(3, 3), data.site_xpos[site])


def _mass_matrix(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Mass matrix (nv, nv) by products with unit vectors, because mj_mulM is the same in all releases of MuJoCo."""
    matrix = np.zeros((model.nv, model.nv))
    for column, unit in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, matrix[column], unit)
    return matrix
