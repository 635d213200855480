"""MotionFrames: a run at a uniform rate, with all that MuJoCo derives from its states."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from toolkit.exchange.record import RunRecord, robot_bodies
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import quaternion_from_rotation, rotation_from_quaternion
from toolkit.robot.model import RobotModel

TOUCH = 1.0  # N; more than this along a patch's normal is a contact, so that palms that hardly press count too
_NEAR = 1e-6  # in samples; a frame so near to a sample is the sample


@dataclass(frozen=True)
class MotionFrames:
    """T frames of a motion of n joints and b bodies; world frame, SI units, quaternions scalar first.

    Joints and bodies are in MuJoCo's order of the robot compiled alone.

    Attributes:
        fps: Frames per second.
        times: (T,) s.
        qpos: (T, 7 + n); base position, base quaternion wxyz, joints.
        qvel: (T, 6 + n); base linear velocity in the world, base angular velocity in the base, joint velocities.
        torque: (T, n) N m.
        target: (T, n) rad; from these joint positions a controller `kp (target - q) - kd v` with the robot's gains
            makes the torques. NaN for a joint without kp.
        body_position, body_quaternion_wxyz: (T, b, 3) m and (T, b, 4); frames of the bodies.
        body_velocity, body_spin: Each (T, b, 3); linear velocity of the frame's origin and angular velocity.
        com, linear_momentum, angular_momentum: Each (T, 3); the angular momentum is about the CoM.
        limb_pose: (T, 4, 7); position and quaternion wxyz of each limb's patch, NaN for a limb that the robot lacks.
        force, moment: Each (T, 4, 3); on each limb's patch, about its centre. NaN where the run knows none.
        contact, planned_contact: Each (T, 4) bool. A measured contact bears more than `TOUCH`; in frames of the plan
            the two are the same.
    """

    fps: float
    times: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    torque: np.ndarray
    target: np.ndarray
    body_position: np.ndarray
    body_quaternion_wxyz: np.ndarray
    body_velocity: np.ndarray
    body_spin: np.ndarray
    com: np.ndarray
    linear_momentum: np.ndarray
    angular_momentum: np.ndarray
    limb_pose: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    contact: np.ndarray
    planned_contact: np.ndarray


@dataclass(frozen=True)
class _Grid:
    """Where T frames lie between samples: at the share (T,) of the way from sample `first` (T,) to the next one."""

    first: np.ndarray
    share: np.ndarray

    @classmethod
    def of(cls, samples: np.ndarray, times: np.ndarray) -> _Grid:
        """Frames at times (T,) among samples at increasing times (S,), both in s."""
        place = np.interp(times, samples, np.arange(len(samples)))
        nearest = np.round(place)
        place = np.where(np.abs(place - nearest) < _NEAR, nearest, place)
        first = np.floor(place).astype(int)
        return cls(first, place - first)

    def linear(self, values: np.ndarray) -> np.ndarray:
        """(T, ...) of values (S, ...); those of a sample exactly where a frame is on it."""
        after = np.minimum(self.first + 1, len(values) - 1)
        share = self.share.reshape(-1, *[1] * (values.ndim - 1))
        mixed = (1.0 - share) * values[self.first] + share * values[after]
        return np.where(share > 0.0, mixed, values[self.first])

    def turned(self, quaternions_wxyz: np.ndarray) -> np.ndarray:
        """(T, 4) of quaternions (S, 4), by slerp between samples; signs do not jump from frame to frame."""
        between = self.share > 0.0
        result = quaternions_wxyz[self.first]
        if between.any():
            rotations = Rotation.from_quat(quaternions_wxyz, scalar_first=True)
            way = Slerp(np.arange(len(quaternions_wxyz)), rotations)
            place = self.first[between] + self.share[between]
            result[between] = way(place).as_quat(scalar_first=True)
        flips = np.cumprod(np.where((result[1:] * result[:-1]).sum(1) < 0.0, -1.0, 1.0))
        result[1:] *= flips[:, None]
        return result


def frames_of(record: RunRecord, robot: RobotModel, fps: float, *, planned: bool = False) -> MotionFrames:
    """Frames of a run.

    Frames that do not fall on a recorded sample are interpolated: base orientations by slerp, all else linearly.

    Args:
        record: The run.
        robot: Its robot.
        fps: Frames per second, above zero.
        planned: Whether to take the planned states and torques; else those of the simulated run.
    """
    execution, motion = record.execution, record.motion
    ticks = execution["tick_times"]
    if planned:
        samples = motion["wholebody_times"]
        qpos, qvel, torque = (motion[f"wholebody_{name}"] for name in ("qpos", "qvel", "torque"))
        held = np.clip(np.searchsorted(ticks, samples + 1e-9, side="right") - 1, 0, len(ticks) - 1)
        wrench = np.where((samples <= ticks[-1] + 1e-9)[:, None, None], execution["wrench_planned"][held], np.nan)
    else:
        samples, qpos, qvel = ticks, execution["qpos"], execution["qvel"]
        torque, wrench = execution["torque"], execution["wrench"]
    count = int(np.floor((samples[-1] - samples[0]) * fps + _NEAR)) + 1
    times = samples[0] + np.arange(count) / fps
    grid = _Grid.of(samples, times)
    states = grid.linear(qpos)
    states[:, 3:7] = grid.turned(qpos[:, 3:7])
    velocities, torques, wrenches = grid.linear(qvel), grid.linear(torque), grid.linear(wrench)
    derived = _derived(record.scene, robot, states, velocities)
    schedule = [record.schedule.phase_at(float(time)) for time in times]
    expected = np.array([[any(c.limb == limb for c in phase.contacts) for limb in Limb] for phase in schedule])
    contact = expected if planned else _touching(execution)[grid.first]
    return MotionFrames(
        fps=fps,
        times=times,
        qpos=states,
        qvel=velocities,
        torque=torques,
        target=states[:, 7:] + (torques + robot.kd * velocities[:, 6:]) / np.where(robot.kp > 0.0, robot.kp, np.nan),
        force=wrenches[..., :3],
        moment=wrenches[..., 3:],
        contact=contact,
        planned_contact=expected,
        **derived,
    )


def _touching(execution: dict[str, np.ndarray]) -> np.ndarray:
    """(C, 4) bool; whether the force on each patch has more than `TOUCH` along the patch's normal."""
    quaternions = execution["limb_pose"][..., 3:]
    there = np.isfinite(quaternions).all(axis=-1)
    normals = rotation_from_quaternion(np.where(np.expand_dims(there, -1), quaternions, [1.0, 0.0, 0.0, 0.0]))[..., 2]
    return there & (np.einsum("clk,clk->cl", execution["wrench"][..., :3], normals) > TOUCH)


def _derived(scene: mujoco.MjModel, robot: RobotModel, qpos: np.ndarray, qvel: np.ndarray) -> dict[str, np.ndarray]:
    """Fields of `MotionFrames` that follow from states (T, nq) and velocities (T, nv)."""
    data, bodies, count = mujoco.MjData(scene), robot_bodies(scene), len(qpos)
    base, mass = int(bodies[0]), float(scene.body_subtreemass[bodies[0]])
    result = {
        "body_position": np.zeros((count, len(bodies), 3)),
        "body_quaternion_wxyz": np.zeros((count, len(bodies), 4)),
        "body_velocity": np.zeros((count, len(bodies), 3)),
        "body_spin": np.zeros((count, len(bodies), 3)),
        "com": np.zeros((count, 3)),
        "linear_momentum": np.zeros((count, 3)),
        "angular_momentum": np.zeros((count, 3)),
        "limb_pose": np.full((count, 4, 7), np.nan),
    }
    sites = {limb: scene.site(model.site).id for limb, model in robot.limbs.items()}
    velocity = np.zeros(6)
    for row in range(count):
        data.qpos[:], data.qvel[:] = qpos[row], qvel[row]
        mujoco.mj_kinematics(scene, data)
        mujoco.mj_comPos(scene, data)
        mujoco.mj_comVel(scene, data)
        mujoco.mj_subtreeVel(scene, data)
        result["body_position"][row] = data.xpos[bodies]
        result["body_quaternion_wxyz"][row] = data.xquat[bodies]
        for index, body in enumerate(bodies):
            mujoco.mj_objectVelocity(scene, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
            result["body_spin"][row, index], result["body_velocity"][row, index] = velocity[:3], velocity[3:]
        result["com"][row] = data.subtree_com[base]
        result["linear_momentum"][row] = mass * data.subtree_linvel[base]
        result["angular_momentum"][row] = data.subtree_angmom[base]
        for limb, site in sites.items():
            rotation = data.site_xmat[site].reshape(3, 3)
            result["limb_pose"][row, limb] = [*data.site_xpos[site], *quaternion_from_rotation(rotation)]
    return result
