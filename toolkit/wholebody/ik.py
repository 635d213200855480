"""Inverse kinematics of the whole body along a centroidal motion, with placo.

At every tick one quadratic program over the joint displacements dq tracks, from the strongest to the weakest: the
patches, the CoM, the base's upright orientation with the heading of the feet, the planned angular momentum, and an
eased return to the home posture. Joint ranges, velocities and a least knee flexion are hard limits. Each tick starts
from the last one, so the linearisation error is of second order in the step.
"""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.arm_map import ArmMap
from toolkit.errors import PlanningError
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.geometry.pose import Pose, mean_pose, rotation_exponential, rotation_vector
from toolkit.robot.model import RobotModel
from toolkit.robot.placo import pinocchio_map, placo_wrapper
from toolkit.wholebody import ik_config as weights
from toolkit.wholebody.arms_ahead import ArmsAhead
from toolkit.wholebody.avoidance import Avoidance
from toolkit.wholebody.effort import Effort
from toolkit.wholebody.lean import Lean
from toolkit.wholebody.limb_paths import LimbPaths
from toolkit.wholebody.swing import Window

OFFSET = Window(0.0, 0.6)  # the part of a palm's swing over which the palm joins its path
REACHING = Window(0.0, 0.6)  # the part over which its arm's posture goes from where it is to that of the swing's end
LEAVING, LANDING = Window(0.0, 0.2), Window(0.75, 1.0)  # the parts of a foot's swing near its contacts


class WholeBodyIK:
    """The solver with its tasks and its state, solved tick after tick."""

    def __init__(
        self,
        robot: RobotModel,
        tick: float,
        avoidance: Avoidance | None = None,
        lean: Lean | None = None,
        turning: float = 1.0,
        ahead: ArmsAhead | None = None,
    ):
        """Set up the tasks for a tick in s.

        `avoidance` keeps all links clear, `lean` turns the base, `turning` is a factor on the weight of the planned
        angular momentum about the vertical, and `ahead` lets arms give way early.
        """
        self.robot, self.tick, self.avoidance, self.lean, self.turning = robot, tick, avoidance, lean, turning
        self.ahead = ahead
        self.pace, self.per_area = robot.scale.time * robot.rotor_factor, 1.0 / robot.scale.length**2
        self.wrapper = placo_wrapper(robot)
        self.order = pinocchio_map(robot, self.wrapper.model)
        self.solver = self.wrapper.make_solver()
        self.solver.dt = tick
        self.maps: dict[Limb, ArmMap] = {}
        self.reaching: dict[Limb, tuple] = {}
        self.arm_joints, self.effort = robot.arm_sides, Effort(robot, tick)
        self.home = dict(zip(robot.joint_names, robot.home[7:], strict=True))
        self._set_limits()
        self._add_tasks()

    def _set_limits(self) -> None:
        robot = self.robot
        lower = np.minimum(robot.lower + weights.RANGE_MARGIN, np.maximum(robot.lower, robot.home[7:]))
        upper = np.maximum(robot.upper - weights.RANGE_MARGIN, np.minimum(robot.upper, robot.home[7:]))
        for foot in FEET:
            knee, least, most = knee_range(robot, foot)
            lower[knee], upper[knee] = max(lower[knee], least), min(upper[knee], most)
        self.lower, self.upper = lower, upper
        for index, name in enumerate(robot.joint_names):
            self.wrapper.set_joint_limits(name, float(lower[index]), float(upper[index]))
            self.wrapper.set_velocity_limit(name, float(weights.VELOCITY_FRACTION * robot.velocity_limit[index]))
        self.solver.enable_joint_limits(True)

    def _add_tasks(self) -> None:
        robot, solver = self.robot, self.solver
        self.com = solver.add_com_task(np.zeros(3))
        self.com.configure("com", "soft", self.per_area * weights.COM)
        self.feet, self.palms, self.offsets = {}, {}, {}
        for foot in FEET:
            task = solver.add_frame_task(robot.limbs[foot].site, np.eye(4))
            position = self.per_area * weights.FOOT_POSITION
            task.configure(foot.label, "soft", position, weights.FOOT_ORIENTATION)
            if robot.limbs[foot].rolls:
                task.orientation().mask.set_axises("yz", "local")
            self.feet[foot] = task
        for palm in (limb for limb in PALMS if limb in robot.limbs):
            site, z = robot.limbs[palm].site, np.array([0.0, 0.0, 1.0])
            position = solver.add_position_task(site, np.zeros(3))
            normal = solver.add_axisalign_task(site, z, z)
            twist = solver.add_orientation_task(site, np.eye(3))
            self.palms[palm] = (position, normal, twist)
        self.base = solver.add_orientation_task(robot.base, np.eye(3))
        self.base.configure("base", "soft", weights.BASE)
        self.steady = solver.add_orientation_task(robot.base, np.eye(3))
        self.postures = []
        for joints, weight in self._groups():
            task = solver.add_joints_task()
            self.postures.append((task, {name: self.home[name] for name in joints}, weight))
        self.momentum, self.spin = (solver.add_centroidal_momentum_task(np.zeros(3)) for _ in range(2))
        self.spin.mask.set_axises("z", "task")
        solver.add_regularization_task(1e-6)
        self.dampers = self.limits = None

    def _groups(self) -> list[tuple[list[str], float]]:
        """Joint names with the weight of their posture: arms, trunk, legs."""
        robot = self.robot
        legs, trunk, arms = robot.carrying(FEET), robot.trunk_joints, np.zeros(len(robot.joint_names), bool)
        for joints in self.arm_joints.values():
            arms[joints] = True
        groups: dict[float, list[str]] = {}
        for joint, name in enumerate(robot.joint_names):
            if legs[joint]:
                weight = weights.LEGS
            elif trunk[joint]:
                weight = weights.TRUNK
            else:
                weight = weights.ARMS if arms[joint] else weights.REST
            groups.setdefault(weight, []).append(name)
        return [(names, weight) for weight, names in groups.items()]

    def start(self, qpos: np.ndarray, paths: LimbPaths, motion: CentroidalMotion) -> np.ndarray:
        """(7 + n,) qpos at time 0, settled from a first guess (7 + n,) and clear of the world."""
        guess = qpos.copy()
        for palm in self.palms:
            segment = paths.segment(palm, 0.0)
            if segment.pose is not None:  # in contact from the start
                held = self._arm_posture(palm, 0.0, guess[7:], paths, motion)
                self.reaching[palm] = segment, held, held
                guess[7 + self.arm_joints[palm]] = held
        guess[7:] = np.clip(guess[7:], self.lower, self.upper)
        self.wrapper.state.q = self.order.q_from_qpos(guess)
        self.wrapper.update_kinematics()
        self.solver.enable_velocity_limits(False)
        self._set_targets(0.0, paths, motion)
        self.momentum.configure("momentum", "soft", 0.0)
        self.spin.configure("spin", "soft", 0.0)
        self.steady.configure("steady", "soft", 0.0)
        # At rest, an eased posture task of weight w weighs as much as a plain one of weight w * ease.
        posture = dict(zip(self.robot.joint_names, self._posture(0.0, guess[7:], paths, motion), strict=True))
        for task, names, weight in self.postures:
            task.set_joints({name: posture[name] for name in names})
            task.configure("posture", "soft", weight * self._ease)
        self.drift, self.last_step = np.zeros(self.robot.mujoco_model.nv), np.zeros(len(self.robot.joint_names))
        standing = self._standing(0.0, paths)
        for _ in range(weights.SETTLE):
            state = self.order.qpos_from_q(self.wrapper.state.q)
            self._set_dampers(state, self.joints, 0.0, paths, standing)
            if np.abs(self._solve(0.0)).max() < 1e-7:
                break
        for task, _, weight in self.postures:
            task.configure("posture", "soft", weight)
        # placo's task is in kg m^2/s: over a tick, and divided by an inertia, it is an angle.
        angle = self.tick / (self.robot.mass * self.robot.com_height**2)
        self.momentum.configure("momentum", "soft", weights.ANGULAR_MOMENTUM * angle**2)
        self.spin.configure("spin", "soft", (self.turning - 1.0) * weights.ANGULAR_MOMENTUM * angle**2)
        self.steady.configure("steady", "soft", weights.STEADY)
        self.solver.enable_velocity_limits(True)
        return self.order.qpos_from_q(self.wrapper.state.q)

    def advance(self, time: float, paths: LimbPaths, motion: CentroidalMotion) -> np.ndarray:
        """Advance by one tick to a time in s; returns (7 + n,) qpos.

        Raises:
            PlanningError: The quadratic program has no solution.
        """
        angles, upright = self.joints, np.array(self.base.R_world_frame)
        self._set_targets(time, paths, motion)
        step = self._ease * (self._posture(time, angles, paths, motion) - angles)
        step = (step + weights.INERTIA * self.last_step) / (1.0 + weights.INERTIA)
        targets = dict(zip(self.robot.joint_names, angles + step, strict=True))
        for task, names, _ in self.postures:
            for name in names:
                task.set_joint(name, targets[name])
        before = self.order.qpos_from_q(self.wrapper.state.q)
        wanted = rotation_vector(upright.T @ self.base.R_world_frame)
        turn = wanted + weights.KEPT_TURN * (self.drift[3:6] - wanted)
        self.steady.R_world_frame = self.wrapper.get_T_world_frame(self.robot.base)[:3, :3] @ rotation_exponential(turn)
        swinging = next((foot for foot in FEET if paths.segment(foot, time).path is not None), None)
        standing = self._standing(time, paths)
        pushed = self._set_dampers(before, angles, time, paths, standing)
        free = [arm for arm in self.arm_joints if paths.authority(arm, time) == 0.0]
        self._set_ranges(angles, free, pushed)
        self._solve(time)
        self._spare_motors(time, before, motion, swinging, standing)
        self.drift, self.last_step = self._motion(before), self.joints - angles
        return self.order.qpos_from_q(self.wrapper.state.q)

    def _posture(self, time: float, angles: np.ndarray, paths: LimbPaths, motion: CentroidalMotion) -> np.ndarray:
        """(n,) rad; posture that joints tend to: home, or what fits the contact that an arm has; in a swing in between.

        An arm that tended at once to where its swing ends would be there long before its path.
        """
        posture = self.robot.home[7:].copy()
        for palm in self.palms:
            segment, joints = paths.segment(palm, time), self.arm_joints[palm]
            if segment.path is None and segment.pose is None:
                self.reaching.pop(palm, None)
                continue
            if segment.path is not None and self.reaching.get(palm, (None,))[0] is not segment:
                end = posture[joints]
                if not segment.free_end:
                    end = self._arm_posture(palm, segment.end, angles, paths, motion)
                self.reaching[palm] = segment, angles[joints], end
            if palm in self.reaching:
                _, begin, end = self.reaching[palm]
                share = 1.0 if segment.path is None else REACHING.step(segment.share(time))[0]
                posture[joints] = begin + share * (end - begin)
        return posture

    def _arm_posture(
        self, palm: Limb, time: float, angles: np.ndarray, paths: LimbPaths, motion: CentroidalMotion
    ) -> np.ndarray:
        """(k,) rad; joints of an arm that make the contact at a time in s, with the trunk upright."""
        pose = paths.sample(palm, time).pose
        assert pose is not None
        turn = paths.mean_feet(time).rotation
        if palm not in self.maps:
            self.maps[palm] = ArmMap.of(self.robot, palm)
        relative = turn.T @ (pose.position - motion.sample(time)[0]) - self.robot.arms[palm].shoulder_in_com
        return self.maps[palm].posture(relative, turn.T @ pose.normal, angles[self.arm_joints[palm]])

    @property
    def joints(self) -> np.ndarray:
        """(n,) rad; present joint angles."""
        return self.wrapper.state.q[self.order.q_index]

    @property
    def _ease(self) -> float:
        return min(self.tick / (self.pace * weights.POSTURE_TIME), 1.0)

    def _solve(self, time: float) -> np.ndarray:
        try:
            step = self.solver.solve(True)
        except RuntimeError as error:
            raise PlanningError(f"the inverse kinematics has no solution at {time:.2f} s: {error}") from error
        self.wrapper.update_kinematics()
        return step

    def _set_targets(self, time: float, paths: LimbPaths, motion: CentroidalMotion) -> None:
        self.com.target_world = motion.sample(time)[0]
        self.momentum.L_world = self.spin.L_world = momentum_at(motion, time)
        feet = []
        for foot, task in self.feet.items():
            pose = paths.sample(foot, time).pose
            assert pose is not None
            task.T_world_frame = pose.matrix
            air = self._air(foot, time, paths)
            position = self.per_area * weights.FOOT_POSITION * (weights.AIR_POSITION / weights.FOOT_POSITION) ** air
            orientation = weights.FOOT_ORIENTATION * (weights.AIR_ORIENTATION / weights.FOOT_ORIENTATION) ** air
            task.configure(foot.label, "soft", position, orientation)
            feet.append(pose)
        turn = np.eye(3) if self.lean is None else rotation_exponential(self.lean.at(time))
        self.base.R_world_frame = mean_pose(*feet).rotation @ turn
        for palm, tasks in self.palms.items():
            self._set_palm(palm, tasks, time, paths)

    @staticmethod
    def _standing(time: float, paths: LimbPaths) -> Limb | None:
        """A foot that stands at a time in s; None where there is none."""
        return next((foot for foot in FEET if paths.segment(foot, time).path is None), None)

    @staticmethod
    def _air(foot: Limb, time: float, paths: LimbPaths) -> float:
        """How far a foot is from its contacts, in [0, 1]: 0 at both ends of a swing, 1 in the middle."""
        segment = paths.segment(foot, time)
        if segment.path is None:
            return 0.0
        u = segment.share(time)
        return LEAVING.step(u)[0] - LANDING.step(u)[0]

    def _set_dampers(
        self, qpos: np.ndarray, angles: np.ndarray, time: float, paths: LimbPaths, standing: Limb | None
    ) -> set[Limb]:
        """Keep all links clear of the world and of each other; returns the arms that have to give way now."""
        if self.dampers is not None:
            self.solver.remove_constraint(self.dampers)  # pyright: ignore[reportArgumentType]
            self.dampers = None
        if self.avoidance is None:
            return set()
        touching = {palm for palm in self.palms if paths.at_surface(palm, time)}
        found = self.avoidance.dampers(qpos, self.drift, self.tick, touching, standing)
        if self.ahead is not None:
            reaching = {palm for palm in self.palms if paths.authority(palm, time) > 0.0}
            found = found.joined(self.ahead.dampers(time, angles, self.tick, reaching))
        if len(found.bound):
            matrix, share = np.zeros((len(found.bound), len(qpos))), np.sqrt(found.weight)
            matrix[:, self.order.q_index] = share[:, None] * found.matrix
            bound = share * (found.bound + found.matrix @ angles)
            self.dampers = self.solver.add_joint_space_half_spaces_constraint(matrix, bound)
            self.dampers.configure("dampers", "soft", 1.0)
        pushed = found.matrix[found.bound < 0.0]
        return {arm for arm, joints in self.arm_joints.items() if pushed[:, joints].any()}

    def _spare_motors(
        self, time: float, before: np.ndarray, motion: CentroidalMotion, swinging: Limb | None, standing: Limb | None
    ) -> None:
        """Solve a tick from a state (7 + n,) again while motors that carry no foot would have to give too much."""
        for _ in range(weights.EASING):
            step = self._motion(before)
            torque = self.effort.torques(time, before, self.drift, step, motion)
            if not self.effort.exceeded(torque, swinging):
                break
            self._drop_limits()
            rows, bound = self.effort.rows(torque, step, swinging, standing)
            matrix = np.zeros((len(rows), len(before)))
            matrix[:, self.order.q_index] = rows
            self.limits = self.solver.add_joint_space_half_spaces_constraint(matrix, bound + rows @ before[7:])
            self.limits.configure("limits", "soft", weights.EFFORT)
            self.wrapper.state.q = self.order.q_from_qpos(before)
            self.wrapper.update_kinematics()
            self._solve(time)
        self._drop_limits()

    def _drop_limits(self) -> None:
        if self.limits is not None:
            self.solver.remove_constraint(self.limits)  # pyright: ignore[reportArgumentType]
            self.limits = None

    def _motion(self, before: np.ndarray) -> np.ndarray:
        """(6 + n,) displacement since a state (7 + n,), as MuJoCo's qvel times the tick."""
        after = self.order.qpos_from_q(self.wrapper.state.q)
        change = np.zeros(self.robot.mujoco_model.nv)
        mujoco.mj_differentiatePos(self.robot.mujoco_model, change, 1.0, before, after)
        return change

    def _set_ranges(self, angles: np.ndarray, free: list[Limb], pushed: set[Limb]) -> None:
        """Set the ranges of this tick, whose ends joints approach ever more slowly.

        They are narrow for arms that hang free, which the momentum task alone would swing wider than people do, and
        wider for those that something pushes.
        """
        lower, upper = self.lower.copy(), self.upper.copy()
        share = np.full(len(angles), min(weights.RANGE_RATE * self.tick / self.pace, 1.0))
        for arm in free:
            joints = self.arm_joints[arm]
            home, swing = self.robot.home[7:][joints], weights.GIVING_WAY if arm in pushed else weights.ARM_SWING
            lower[joints] = np.maximum(lower[joints], np.minimum(home - swing, angles[joints]))
            upper[joints] = np.minimum(upper[joints], np.maximum(home + swing, angles[joints]))
            share[joints] = min(weights.SWING_RATE * self.tick / self.pace, 1.0)
        lower = np.minimum(angles + share * (lower - angles), angles)
        upper = np.maximum(angles + share * (upper - angles), angles)
        for name, low, high in zip(self.robot.joint_names, lower.tolist(), upper.tolist(), strict=True):
            self.wrapper.set_joint_limits(name, low, high)

    def _set_palm(self, palm: Limb, tasks: tuple, time: float, paths: LimbPaths) -> None:
        """Set a palm's targets: its path, at first shifted to where the free arm is."""
        position, normal, twist = tasks
        pose, authority = paths.sample(palm, time).pose, paths.authority(palm, time)
        if pose is not None:
            pose = self._from_free(palm, pose, time, paths)
            position.target_world = pose.position
            normal.targetAxis_world = pose.normal
            twist.R_world_frame = pose.rotation
        # Weights span many orders of magnitude, so they grow geometrically with the authority.
        share = 10.0 ** (-7.0 * (1.0 - authority)) if authority > 0.0 else 0.0
        position.configure(f"{palm.label}_position", "soft", share * self.per_area * weights.PALM_POSITION)
        normal.configure(f"{palm.label}_normal", "soft", share * weights.PALM_NORMAL)
        twist.configure(f"{palm.label}_twist", "soft", share * weights.PALM_TWIST)

    def _from_free(self, palm: Limb, pose: Pose, time: float, paths: LimbPaths) -> Pose:
        """The pose on a path; one from the free posture starts where the palm is, and the difference fades."""
        segment = paths.segment(palm, time)
        if not segment.free_start or segment.path is None:
            return pose
        if self.offsets.get(palm, (None,))[0] is not segment:
            actual = self.wrapper.get_T_world_frame(self.robot.limbs[palm].site)
            start = segment.path.start
            turn = rotation_vector(actual[:3, :3] @ start.rotation.T)
            self.offsets[palm] = segment, actual[:3, 3] - start.position, turn
        _, shift, turn = self.offsets[palm]
        left = 1.0 - OFFSET.step(segment.share(time))[0]
        return pose.moved(left * shift, left * turn)


def momentum_at(motion: CentroidalMotion, time: float) -> np.ndarray:
    """(3,) kg m^2/s; planned angular momentum about the CoM in the world at a time in s, linear between knots."""
    times = motion.problem.times
    step = min(max(int(np.searchsorted(times, time, side="right")) - 1, 0), motion.problem.steps - 1)
    share = min(max((time - times[step]) / (times[step + 1] - times[step]), 0.0), 1.0)
    return (1.0 - share) * motion.angular_momentum[step] + share * motion.angular_momentum[step + 1]


def first_guess(robot: RobotModel, paths: LimbPaths, motion: CentroidalMotion) -> np.ndarray:
    """(7 + n,) qpos: the home posture above the feet's first contacts, shifted so that its CoM is as planned."""
    feet = paths.mean_feet(0.0)
    base = feet @ Pose.from_quaternion(robot.home[:3], robot.home[3:7])
    rise = motion.com[0, 2] - feet.position[2] - robot.com_height
    qpos = robot.home.copy()
    qpos[:3], qpos[3:7] = base.position + np.array([0.0, 0.0, rise]), base.quaternion_wxyz
    return qpos


def knee_range(robot: RobotModel, foot: Limb, least_flexion: float = weights.MIN_KNEE) -> tuple[int, float, float]:
    """Index of a leg's knee joint, and its lower and upper limit in rad that keep a least flexion (0 is straight)."""
    joint = int(robot.joints_to(foot)[3])  # after the three of the hip, as in every leg that can be loaded
    model = robot.mujoco_model
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(model, data)
    lower, upper = float(robot.lower[joint]), float(robot.upper[joint])
    missing = least_flexion - robot.legs[foot].ranges["knee"][0]  # from the joint's straight end to enough flexion
    if data.xaxis[joint + 1] @ data.xmat[1].reshape(3, 3)[:, 1] > 0.0:  # flexing is positive; joint 0 is the free one
        return joint, min(max(lower, lower + missing), upper), upper
    return joint, lower, max(min(upper, upper - missing), lower)
