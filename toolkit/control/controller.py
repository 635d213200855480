"""Controller: joint torques that carry a reference out, by inverse dynamics."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from toolkit.centroidal.problem import Margins
from toolkit.control import link_clearance, world_clearance
from toolkit.control.corrector import PENDULUM_RATE, Cones, Corrector, MotionTarget
from toolkit.control.dynamics import RobotDynamics
from toolkit.control.joint_box import JointBox
from toolkit.control.limb_target import LimbTargets, rotation_sine
from toolkit.control.link_clearance import LinkClearance
from toolkit.control.qp import FORCE_UNIT, ContactQP
from toolkit.control.sampled_plan import Reference
from toolkit.control.touchdown import ContactTracker, LimbState
from toolkit.control.world_clearance import WorldClearance
from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel
from toolkit.robot.scale import Scale

_MAX_PAIRS = link_clearance.MAX_PAIRS + world_clearance.MAX_PAIRS


class TaskGains(NamedTuple):
    """A task `weight |J qdd + dJ v - a*|^2` with `a* = a_ref + kp e + kd de`, per squared m/s^2 or rad/s^2."""

    weight: float
    kp: float
    kd: float

    def linear(self, scale: Scale) -> TaskGains:
        """The gains of a linear task for a body of another size, in time with it."""
        return TaskGains(self.weight, self.kp / scale.length, self.kd / scale.time)

    def angular(self, scale: Scale) -> TaskGains:
        """The same of an angular one: the angular accelerations of a small body are large, and its weight small."""
        return TaskGains(self.weight * scale.length**2, self.kp / scale.length, self.kd / scale.time)


# Weights, gains, lengths and forces are those of a body of the usual size (`toolkit.robot.scale`); see `_Gains`.
# These gains walked on flat ground, on stones, on stairs and with a palm on a wall.
SWING, SWING_ROTATION = TaskGains(200.0, 400.0, 40.0), TaskGains(20.0, 400.0, 40.0)  # a foot in the air
HAND = TaskGains(50.0, 200.0, 28.0)  # a palm that approaches or leaves its contact
# The posture keeps arms and trunk on the way that was found clear; to follow the momentum they would leave it.
COM, BASE, POSTURE = TaskGains(1000.0, 60.0, 14.0), TaskGains(50.0, 100.0, 20.0), TaskGains(4.0, 60.0, 15.0)
SPIN = TaskGains(40.0, 5.0, 0.0)  # of the angular momentum in units of MOMENTUM_SCALE; kd is unused
# A limb in contact is held still by its velocity only, because its resting place is a measured fact. The patch of a
# palm aligns itself with the surface.
STANCE, STANCE_ROTATION = TaskGains(1e4, 0.0, 24.0), TaskGains(1e4, 0.0, 30.0)
STANCE_PALM_ROTATION = TaskGains(20.0, 0.0, 20.0)
# Along its normal a foot stops faster: one that lands fast bounces, and as long as it bears nothing it slips.
SETTLING = 100.0  # 1/s; kd of the normal velocity of a foot in contact; simulated contacts bounce alike at all sizes
LEG_POSTURE = 0.005  # factor on the posture's weight for joints that carry a foot: feet and CoM place them
ARM_POSTURE = 0.01  # the same for an arm whose palm is in contact, and not quite where it was planned to be
MOMENTUM_SCALE = 10.0  # kg m^2/s per unit of the task of angular momentum, for a body of the usual size
FORCE, MOMENT = 1e-5, 2e-4  # weights on squared N and N m of deviation from the planned wrenches: they break ties
PALM_SHARE = 100.0  # factor on the first for palms: feet do what else it takes, until the CoM diverges
ACCELERATION = 1e-4  # weight on squared accelerations of joints and base: keeps the Hessian definite
NESTING = 0.5  # where the controller's margins lie between the plan's (1) and the simulation's (0)
DIVERGENCE = 0.01  # m; divergence of the CoM that halves the weights of angular momentum and base orientation...
URGENT_NESTING = 0.05  # ... and beyond which this replaces NESTING for the CoP, which may then come nearer to the edge
MAX_FRICTION, MAX_YAW = 1.0, 0.9  # bounds on the factors on friction and yaw moment, also where the plan has no margin
TORQUE_FRACTION = 0.98  # usable part of the joint torque limits: the solver's tolerance stays within the limit


class _Gains(NamedTuple):
    """The gains for a body of some size."""

    swing: TaskGains
    swing_rotation: TaskGains
    hand: TaskGains
    hand_rotation: TaskGains
    com: TaskGains
    base: TaskGains
    posture: TaskGains
    spin: TaskGains
    stance: TaskGains
    stance_rotation: TaskGains
    stance_palm_rotation: TaskGains

    @classmethod
    def of(cls, scale: Scale) -> _Gains:
        """The gains of the constants above, scaled."""
        return cls(
            swing=SWING.linear(scale),
            swing_rotation=SWING_ROTATION.angular(scale),
            hand=HAND.linear(scale),
            hand_rotation=HAND.angular(scale),
            com=COM.linear(scale),
            base=BASE.angular(scale),
            posture=POSTURE.angular(scale),
            spin=SPIN._replace(kp=SPIN.kp / scale.time),
            stance=STANCE.linear(scale),
            stance_rotation=STANCE_ROTATION.angular(scale),
            stance_palm_rotation=STANCE_PALM_ROTATION.angular(scale),
        )


class Controller:
    """Tracks a reference with an inverse-dynamics QP, once per control tick.

    A tick evaluates the robot's dynamics at the given state, decides which limbs are in contact, and solves for joint
    accelerations and contact wrenches that follow all tasks best while respecting physics and the robot's limits.

    Attributes:
        aim: What the last tick tracked.
        failures: Ticks whose QP was not solved as posed. Each was then solved without acceleration boxes and least
            forces, or, where that failed too, held its posture with joint gains.
    """

    def __init__(
        self,
        robot: RobotModel,
        scene: mujoco.MjModel,
        reference: Reference,
        margins: Margins,
        period: float,
        corrector: Corrector | None = None,
    ):
        """Prepare for a run.

        Args:
            robot: The robot as the controller knows it.
            scene: The robot in the world as the controller knows it, which all links but the feet keep clear of.
            reference: The plan at the control ticks.
            margins: The plan's margins; the controller's lie between them and none.
            period: Time between control ticks in s.
            corrector: It optimises motion and landing points anew. Without one they stay as planned.
        """
        self._corrector, self.aim = corrector, MotionTarget.zeros()
        self._com, self._com_velocity = np.zeros(3), np.zeros(3)
        self._robot, self._reference = robot, reference
        self._period = period
        self.dynamics = RobotDynamics(robot)
        self.limbs = self.dynamics.limbs
        weight = self.dynamics.mass * float(np.linalg.norm(self.dynamics.gravity))
        limit = np.zeros(4)
        for limb, model in robot.limbs.items():
            limit[limb] = model.max_normal_force
        scale = robot.scale
        self._gains = _Gains.of(scale)
        self._momentum_scale, self._divergence = scale.moment * MOMENTUM_SCALE, scale.length * DIVERGENCE
        self._force_unit, self._rate = scale.force * FORCE_UNIT, PENDULUM_RATE / scale.time
        # Weights of contact forces and moments in the solver's unit.
        self._force_weight = FORCE * FORCE_UNIT**2
        self._moment_weight = MOMENT * FORCE_UNIT**2 / scale.length**2
        self.tracker = ContactTracker(reference, self.limbs, weight, limit, scale)
        self.targets = LimbTargets(reference, self.tracker)
        self._box = JointBox(robot)
        self._links, self._in_world = LinkClearance(robot, self.dynamics), WorldClearance(robot, scene)
        self._torque_limit = TORQUE_FRACTION * robot.torque_limit
        self._limits = {
            urgent: Cones(
                min(1.0 + NESTING * (margins.friction - 1.0), MAX_FRICTION),
                min(1.0 + NESTING * (margins.yaw - 1.0), MAX_YAW),
                margins,
                shrink,
            )
            for urgent, shrink in ((False, NESTING), (True, URGENT_NESTING))
        }
        self._urgent, self._calm = False, 1.0
        legs = robot.carrying(limb for limb in self.limbs if limb.is_foot)
        nv = self.dynamics.nv
        self._posture_weight = np.where(legs, LEG_POSTURE, 1.0) * self._gains.posture.weight
        self._arms = {limb: robot.arm_joints(limb) for limb in self.limbs if not limb.is_foot}
        self._posture = self._posture_weight.copy()
        self._acceleration = ACCELERATION * scale.length**2
        self._diagonal = np.full(nv + 18, self._acceleration)
        self._diagonal[:3] = ACCELERATION
        self._diagonal[3:6] += self._gains.base.weight
        self._diagonal[6:nv] += self._posture_weight
        self._diagonal[nv:] = self._force_weight
        self._target = np.zeros(nv + 18)
        self._tasks, self._wanted = np.zeros((6 + 24, nv)), np.zeros(6 + 24)
        self._qps: dict[tuple[tuple[Limb, ...], int], ContactQP] = {}
        self.failures = 0

    def tick(self, index: int, qpos: np.ndarray, qvel: np.ndarray, normal_force: np.ndarray) -> np.ndarray:
        """Joint torques (n,) in N m, within the limits, for a row of the reference.

        The state has qpos (7 + n,) and qvel (6 + n,) in MuJoCo's order; the forces (4,) in N were measured along the
        patches' normals.
        """
        self.dynamics.update(qpos, qvel)
        self.dynamics.roll_soles(self._reference.limb_rotation[index, :, :, 2])
        time, position = float(self._reference.times[index]), self.dynamics.limb_position
        self.tracker.update(time, self._period, normal_force, position)
        self._com[:], self._com_velocity[:] = self._reference.com[index], self._reference.com_velocity[index]
        self.aim.follow(self._reference, index)
        if self._corrector is not None:
            self._corrector.update(index, self.dynamics, self.targets, self._limits[self._urgent], self.aim)
            self._com += self._corrector.com_shift
        self.targets.update(index, self.dynamics)
        limbs = tuple(limb for limb in self.limbs if self.tracker.in_contact[limb])
        near, least = self._near(qpos, qvel)
        pairs = _MAX_PAIRS if len(least) else 0  # all others are spared these rows
        qp = self._qps.get((limbs, pairs))
        if qp is None:
            qp = self._qps[limbs, pairs] = ContactQP(limbs, self.dynamics.nv, self._force_unit, pairs)
        self._sense_urgency()
        self._constrain(qp, index, qpos, qvel)
        if pairs:
            qp.set_clearance(near, least)
        self._pursue(qp, index, qpos, qvel)
        x = qp.solve()
        if x is None:
            self.failures += 1
            x = qp.solve_relaxed()
        if x is None:
            return self._hold(index, qpos, qvel)
        torque = (qp.rows[6 : qp.nv] @ x) + self.dynamics.bias[6:]
        limit = self._robot.torque_limit
        return np.clip(torque, -limit, limit)

    def _near(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k, nv) and least accelerations (k,) of links that come near each other or near the world."""
        tracker, authority = self.tracker, self.targets.authority
        reaching = [palm for palm in self._arms if tracker.in_contact[palm] or authority[palm] > 0.0]
        self._links.update(qvel)
        self._in_world.update(qpos, qvel, reaching)
        parts = [(each.rows[: each.count], each.lower[: each.count]) for each in (self._links, self._in_world)]
        rows, lower = zip(*parts, strict=True)
        return np.concatenate(rows), np.concatenate(lower)

    def _constrain(self, qp: ContactQP, index: int, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Fill in dynamics, cones and boxes."""
        tracker = self.tracker
        friction, limits = self._reference.friction[index], self._limits[self._urgent]
        half_size = limits.within(self._reference.half_size[index])
        qp.set_dynamics(self.dynamics, self._torque_limit)
        for limb in qp.limbs:
            qp.set_cone(limb, friction[limb] * limits.friction, half_size[limb], limits.yaw)
            qp.set_normal_force(limb, tracker.min_force[limb], tracker.max_force[limb])
        self._box.update(qpos[7:], qvel[6:])
        qp.set_acceleration(self._box.lower, self._box.upper)

    def _pursue(self, qp: ContactQP, index: int, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Fill in the objective."""
        reference, dynamics, nv, gains = self._reference, self.dynamics, self.dynamics.nv, self._gains
        tasks, wanted, target, aim = self._tasks, self._wanted, self._target, self.aim
        root = gains.com.weight**0.5
        np.multiply(dynamics.com_jacobian, root, out=tasks[:3])
        error = gains.com.kp * (aim.com - dynamics.com)
        error += gains.com.kd * (aim.com_velocity - dynamics.com_velocity)
        wanted[:3] = root * (error + aim.com_acceleration - dynamics.com_drift)
        root = (gains.spin.weight * self._calm) ** 0.5 / self._momentum_scale
        np.multiply(dynamics.momentum_jacobian, root, out=tasks[3:6])
        error = gains.spin.kp * (aim.angular_momentum - dynamics.angular_momentum)
        wanted[3:6] = root * (error + aim.angular_momentum_rate - dynamics.momentum_drift)
        rows = 6
        for limb in self.limbs:
            rows = self._pursue_limb(limb, rows)
        self._orient_base(index, qvel, target)
        target[6:nv] = reference.joint_acceleration[index]
        target[6:nv] += gains.posture.kp * (reference.joints[index] - qpos[7:])
        target[6:nv] += gains.posture.kd * (reference.joint_velocity[index] - qvel[6:])
        target[6:nv] *= self._posture / self._diagonal[6:nv]
        diagonal = self._diagonal[: qp.size]
        for limb, slot in qp.slots.items():
            moments = slice(slot.start + 3, slot.stop)
            share = 1.0 if limb.is_foot else 1.0 + (PALM_SHARE - 1.0) * self._calm
            diagonal[slot] = share * self._force_weight
            diagonal[moments] = self._moment_weight  # palms have none
            target[slot] = aim.wrench[limb, : slot.stop - slot.start] / self._force_unit
        qp.set_objective(tasks[:rows], wanted[:rows], diagonal, target[: qp.size])

    def _sense_urgency(self) -> None:
        """Adapt margins and weights to how far the CoM diverges from its plan.

        A robot about to fall uses its feet to their edges and swings its body: the margins of the CoP shrink, and so do
        the weights of angular momentum, of the base's orientation and of the posture. Friction keeps its margin.
        """
        dynamics = self.dynamics
        x, y = (dynamics.com - self._com + (dynamics.com_velocity - self._com_velocity) / self._rate)[:2]
        squared = (x * x + y * y) / self._divergence**2
        self._calm = 1.0 / (1.0 + squared)
        self._urgent = squared > (0.25 if self._urgent else 1.0)
        self._diagonal[3:6] = self._acceleration + self._gains.base.weight * self._calm
        np.multiply(self._posture_weight, self._calm, out=self._posture)
        for limb, joints in self._arms.items():
            if self.tracker.in_contact[limb] and self.tracker.current[limb] is not None:
                self._posture[joints] *= ARM_POSTURE  # a palm of the start is where it was planned to be
        np.add(self._posture, self._acceleration, out=self._diagonal[6 : dynamics.nv])

    def _pursue_limb(self, limb: Limb, rows: int) -> int:
        """Append a limb's task rows after the first `rows` and return their new number."""
        dynamics, targets, gains = self.dynamics, self.targets, self._gains
        if self.tracker.in_contact[limb]:
            linear = gains.stance
            angular = gains.stance_rotation if limb.is_foot else gains.stance_palm_rotation
        elif self.tracker.state[limb] is LimbState.FREE or targets.authority[limb] <= 0.0:
            return rows
        else:
            feet, hands = (gains.swing, gains.swing_rotation), (gains.hand, gains.hand_rotation)
            linear, angular = feet if limb.is_foot else hands
        share = 1.0 if self.tracker.in_contact[limb] else targets.authority[limb]
        rows = self._append(limb, slice(0, 3), linear, share, rows)
        if limb.is_foot and self.tracker.in_contact[limb]:
            self._settle(limb, rows)
        rows = self._append(limb, slice(3, 6), angular, share, rows)
        if self._robot.limbs[limb].rolls:
            axes = slice(1, 3)  # the leg rolls the sole, in contact and in the air
        elif limb.is_foot or self.tracker.in_contact[limb]:
            return rows
        else:
            axes = slice(0, 2)  # in the air a palm may turn about the normal as its arm likes
        last, tilt = slice(rows - 3, rows), dynamics.limb_rotation[limb, :, axes].T
        self._tasks[rows - 3 : rows - 1] = tilt @ self._tasks[last]
        self._wanted[rows - 3 : rows - 1] = tilt @ self._wanted[last]
        return rows - 1

    def _append(self, limb: Limb, part: slice, task: TaskGains, share: float, rows: int) -> int:
        """Append the three rows of a limb's linear or angular task and return the new number of rows."""
        dynamics, targets = self.dynamics, self.targets
        root, here = (share * task.weight) ** 0.5, slice(rows, rows + 3)
        np.multiply(dynamics.jacobian[limb, part], root, out=self._tasks[here])
        error = task.kd * (targets.velocity[limb, part] - dynamics.limb_velocity[limb, part])
        error += task.kp * targets.error[limb, part]
        self._wanted[here] = root * (error + targets.acceleration[limb, part] - dynamics.drift[limb, part])
        return rows + 3

    def _settle(self, limb: Limb, rows: int) -> None:
        """Have a foot's linear task in contact, the last three rows, stop the foot along its normal."""
        gains, normal = self._gains, self.dynamics.limb_rotation[limb, :, 2]
        off = normal @ (self.targets.velocity[limb, :3] - self.dynamics.limb_velocity[limb, :3])
        more = gains.stance.weight**0.5 * (SETTLING - gains.stance.kd) * off
        self._wanted[rows - 3 : rows] += more * normal

    def _orient_base(self, index: int, qvel: np.ndarray, target: np.ndarray) -> None:
        """Fill in the wanted angular acceleration of the base, in the base."""
        reference, gains = self._reference, self._gains.base
        error = rotation_sine(self.dynamics.base_rotation.T @ reference.base_rotation[index])
        acceleration = reference.base_acceleration[index] + gains.kp * error
        acceleration += gains.kd * (reference.base_velocity[index] - qvel[3:6])
        target[3:6] = acceleration * (self._calm * gains.weight / self._diagonal[3:6])

    def _hold(self, index: int, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """Compensate gravity and Coriolis forces and drive the joints to the planned posture, as a last resort."""
        reference, robot = self._reference, self._robot
        torque = self.dynamics.bias[6:] + robot.kp * (reference.joints[index] - qpos[7:])
        torque += robot.kd * (reference.joint_velocity[index] - qvel[6:])
        return np.clip(torque, -robot.torque_limit, robot.torque_limit)
