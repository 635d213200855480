"""Reference: the plan sampled at every control tick, as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.contacts.stance import Contact
from toolkit.control.dynamics import RobotDynamics
from toolkit.geometry.limb import PALMS, Limb
from toolkit.geometry.pose import rotation_from_quaternion
from toolkit.wholebody.motion_dynamics import planned_wrench, posture_momentum
from toolkit.wholebody.plan import WholeBodyPlan
from toolkit.wholebody.trajectory import WholeBodyTrajectory


@dataclass(frozen=True)
class Swing:
    """A limb's planned move.

    Attributes:
        limb: The limb that moves.
        start, end: Times in s.
        transition: Index in the sequence.
        contact: The contact that it makes; None where a palm's contact is broken.
        breaks: Whether the limb was in contact before.
    """

    limb: Limb
    start: float
    end: float
    transition: int
    contact: Contact | None
    breaks: bool


@dataclass(frozen=True)
class Reference:
    """The plan at C times; MuJoCo conventions, world frame unless said otherwise.

    Attributes:
        times: (C,) s.
        com, com_velocity, com_acceleration: Each (C, 3).
        angular_momentum, angular_momentum_rate: Each (C, 3), about the CoM.
        joints, joint_velocity, joint_acceleration: Each (C, n).
        base_rotation, base_velocity, base_acceleration: (C, 3, 3) world_from_base; (C, 3) in the base, in rad and s.
        limb_position, limb_rotation: (C, 4, 3) and (C, 4, 3, 3) world_from_limb.
        limb_velocity, limb_acceleration: Each (C, 4, 6).
        authority: (C, 4) in [0, 1]; how binding a limb's pose is (0: it hangs free).
        in_contact: (C, 4) bool; the planned contacts.
        friction: (C, 4) of the contact that holds or that the limb moves to; 1 where there is none.
        half_size: (C, 4, 2) m half extents of what bears of that contact's patch.
        wrench: (C, 4, 6) planned force and moment about the patch's centre, in the contact frame.
        swings: The planned moves in order of time.
    """

    times: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    com_acceleration: np.ndarray
    angular_momentum: np.ndarray
    angular_momentum_rate: np.ndarray
    joints: np.ndarray
    joint_velocity: np.ndarray
    joint_acceleration: np.ndarray
    base_rotation: np.ndarray
    base_velocity: np.ndarray
    base_acceleration: np.ndarray
    limb_position: np.ndarray
    limb_rotation: np.ndarray
    limb_velocity: np.ndarray
    limb_acceleration: np.ndarray
    authority: np.ndarray
    in_contact: np.ndarray
    friction: np.ndarray
    half_size: np.ndarray
    wrench: np.ndarray
    swings: tuple[Swing, ...]


def sample_reference(times: np.ndarray, plan: WholeBodyPlan) -> Reference:
    """Sample a plan at increasing times (C,) in s; beyond its end it rests.

    The angular momentum is that of the postures. They follow the optimiser's only roughly. So are the poses of palms
    that swing: arms follow the palms' paths only where these have authority, and postures were found clear.
    """
    robot, motion, paths = plan.robot, plan.motion, plan.paths
    moving = times < motion.problem.times[-1]
    com = np.array([np.stack(motion.sample(float(time))) for time in times])
    com[~moving, 1:] = 0.0
    knots, problem = motion.problem.times, motion.problem
    interval = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, problem.steps - 1)
    trajectory, grid = plan.trajectory, plan.trajectory.times
    spin = posture_momentum(robot.mujoco_model, grid, trajectory.qpos, trajectory.qvel)
    momentum, rate = (np.column_stack([np.interp(times, grid, part[:, k]) for k in range(3)]) for part in spin)
    momentum, rate = momentum * moving[:, None], rate * moving[:, None]
    qpos, qvel, qacc = _posture(times, trajectory)
    position, rotation = np.zeros((len(times), 4, 3)), np.tile(np.eye(3), (len(times), 4, 1, 1))
    velocity, acceleration = np.zeros((2, len(times), 4, 6))
    authority, in_contact = np.zeros((len(times), 4)), np.zeros((len(times), 4), bool)
    for limb in sorted(robot.limbs):
        for k, time in enumerate(times):
            pose, *rates, in_contact[k, limb] = paths.sample(limb, float(time))
            if pose is not None:
                position[k, limb], rotation[k, limb] = pose.position, pose.rotation
                velocity[k, limb], acceleration[k, limb] = rates
                authority[k, limb] = paths.authority(limb, float(time))
    dynamics = RobotDynamics(robot)
    for k, palm in zip(*np.nonzero((authority[:, PALMS] > 0.0) & ~in_contact[:, PALMS]), strict=True):
        dynamics.update(qpos[k], qvel[k])
        limb = PALMS[palm]
        position[k, limb], rotation[k, limb] = dynamics.limb_position[limb], dynamics.limb_rotation[limb]
        velocity[k, limb] = dynamics.limb_velocity[limb]
        acceleration[k, limb] = dynamics.jacobian[limb] @ qacc[k] + dynamics.drift[limb]
    swings = _swings(plan.sequence, plan.schedule)
    friction, bearing = _ground(times, plan.sequence, swings)
    return Reference(
        times=times,
        com=com[:, 0],
        com_velocity=com[:, 1],
        com_acceleration=com[:, 2],
        angular_momentum=momentum,
        angular_momentum_rate=rate,
        joints=qpos[:, 7:],
        joint_velocity=qvel[:, 6:],
        joint_acceleration=qacc[:, 6:],
        base_rotation=rotation_from_quaternion(qpos[:, 3:7]),
        base_velocity=qvel[:, 3:6],
        base_acceleration=qacc[:, 3:6],
        limb_position=position,
        limb_rotation=rotation,
        limb_velocity=velocity,
        limb_acceleration=acceleration,
        authority=authority,
        in_contact=in_contact,
        friction=friction,
        half_size=np.minimum(bearing[..., None], robot.bearings),
        wrench=planned_wrench(motion)[interval],
        swings=swings,
    )


def _swings(sequence: ContactSequence, schedule: ContactSchedule) -> tuple[Swing, ...]:
    """The planned moves, in order of time."""
    stances = sequence.stances
    return tuple(
        Swing(
            limb=phase.swing,
            start=phase.start,
            end=phase.end,
            transition=phase.transition,
            contact=sequence.transitions[phase.transition].contact,
            breaks=phase.swing in stances[phase.transition],
        )
        for phase in schedule.phases
        if phase.swing is not None
    )


def _posture(times: np.ndarray, trajectory: WholeBodyTrajectory) -> tuple[np.ndarray, ...]:
    """The qpos (C, 7 + n), qvel (C, nv) and its derivative, at rest beyond the ends."""
    grid = trajectory.times
    clamped = np.clip(times, grid[0], grid[-1])
    cell = np.clip(np.searchsorted(grid, clamped, side="right") - 1, 0, len(grid) - 2) if len(grid) > 1 else 0 * clamped
    if len(grid) == 1:
        qpos, qvel = np.repeat(trajectory.qpos, len(times), 0), np.zeros((len(times), trajectory.qvel.shape[1]))
        return qpos, qvel, np.zeros_like(qvel)
    share = ((clamped - grid[cell]) / (grid[cell + 1] - grid[cell]))[:, None]
    first, second = trajectory.qpos[cell], trajectory.qpos[cell + 1]
    # Neighbouring samples are at most a few degrees apart, so normalised interpolation is as good as slerp.
    sign = np.where((first[:, 3:7] * second[:, 3:7]).sum(1, keepdims=True) < 0.0, -1.0, 1.0)
    qpos = (1.0 - share) * first + share * second
    qpos[:, 3:7] = (1.0 - share) * first[:, 3:7] + share * sign * second[:, 3:7]
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qvel = (1.0 - share) * trajectory.qvel[cell] + share * trajectory.qvel[cell + 1]
    qacc = (trajectory.qvel[cell + 1] - trajectory.qvel[cell]) / (grid[cell + 1] - grid[cell])[:, None]
    rest = (times > grid[-1])[:, None]
    return qpos, np.where(rest, 0.0, qvel), np.where(rest, 0.0, qacc)


def _ground(times: np.ndarray, sequence: ContactSequence, swings: tuple[Swing, ...]) -> tuple[np.ndarray, np.ndarray]:
    """(C, 4) friction of the contact that each limb has or moves to, and (C, 4) m how far its patch bears."""
    friction, bearing = np.ones((2, len(times), 4))
    held = [(contact, times >= times[0]) for contact in sequence.start.contacts]
    held += [(swing.contact, times >= swing.start) for swing in swings if swing.contact is not None]
    for contact, since in held:
        friction[since, contact.limb], bearing[since, contact.limb] = contact.friction, contact.bearing
    return friction, bearing
