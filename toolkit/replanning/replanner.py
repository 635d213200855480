"""Replanner: the centroidal motion of the next contacts, optimised again from the measured state."""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

import numpy as np

from toolkit.centroidal.problem import STANDARD_GRAVITY
from toolkit.control.corrector import PENDULUM_RATE, Cones, MotionTarget
from toolkit.control.dynamics import RobotDynamics
from toolkit.control.limb_target import LimbTargets
from toolkit.control.sampled_plan import Reference, Swing
from toolkit.control.touchdown import ContactTracker, LimbState
from toolkit.geometry.limb import FEET, Limb
from toolkit.replanning.nominal import Nominal
from toolkit.replanning.replan import Replan, ReplanProblem
from toolkit.replanning.situation import Situation
from toolkit.wholebody.plan import WholeBodyPlan

PERIOD = 0.04  # s; time between replans. The following are those of a body of the usual size
PACE = 1.9  # largest pace, relative to the plan, of a swing whose contact is needed earlier
PACE_RATE = 12.0  # 1/s; rate at which the pace changes
SHORTEST = 0.3  # s; least duration of a whole swing at that pace
SOONEST = 0.02  # s; a swing under way that ends earlier ends so much after the time that its fastest pace needs
SETTLED_BEFORE, LEAST_LEFT = 0.03, 0.05  # s before a foot comes down, when it is where it lands, and least time left
KEPT_FROM = 0.75  # part of the swing after which the landing point is kept, because the foot comes down


@dataclass(frozen=True)
class ReplanCounts:
    """How a run was replanned.

    Attributes:
        replans: Number of replans.
        replan_failures: Replans that gave no answer, so that the one before went on.
        replan_departures: Replans that had to leave the plan.
        replan_landings: Replans that moved a landing point.
        replan_seconds: Mean processor time in s of one that departs. It decides nothing.
    """

    replans: int = 0
    replan_failures: int = 0
    replan_departures: int = 0
    replan_landings: int = 0
    replan_seconds: float = 0.0


class Replanner:
    """Solves a tracking problem over the next contacts at a fixed rate and moves what the controller tracks.

    Where the robot is within the deadband of its plan and its feet are in their places, the plan itself is the
    optimum, and nothing is solved.

    Attributes:
        com_shift: (3,) m; shift of the plan with the feet that bear it, where they are off by more than the deadband.
    """

    def __init__(self, reference: Reference, plan: WholeBodyPlan):
        """Prepare for a run of a plan, whose reference is sampled at the control ticks."""
        self._reference = reference
        self._period = float(reference.times[1] - reference.times[0])
        self._nominal = nominal = Nominal.of(plan.motion, reference, plan.robot.scale)
        self._problem = ReplanProblem(nominal, plan.robot, plan.world.surfaces)
        self._mass = nominal.problem.mass
        self._weight = self._mass * STANDARD_GRAVITY
        scale = plan.robot.scale
        self._rate, self._deadband = PENDULUM_RATE / scale.time, self._problem.deadband
        self._time, self._pace_rate, self._shortest = scale.time, PACE_RATE / scale.time, scale.time * SHORTEST
        self._due = 0.0
        self._plan: Replan | None = None
        self._made: dict[Limb, int] = {}
        self._goal: dict[int, np.ndarray] = {}
        self._ends: dict[int, float] = {}
        self._shift, self._shift_rate, self._moved = np.zeros((3, 4, 3))
        self._replans = self._departures = self._failures = self._landings = 0
        self._seconds = 0.0
        self.com_shift = np.zeros(3)

    def update(
        self, index: int, dynamics: RobotDynamics, targets: LimbTargets, cones: Cones, aim: MotionTarget
    ) -> None:
        """Replan where it is due, then move what to track.

        Args:
            index: Row of the reference.
            dynamics: The measured state.
            targets: Contact states at this tick, and the landing points to move.
            cones: What the controller allows now.
            aim: The plan at this row; it is moved by the last replan.
        """
        time, period, tracker = float(self._reference.times[index]), self._period, targets.tracker
        for limb in dynamics.limbs:
            if tracker.made[limb]:
                swing = tracker.current[limb]
                self._made[limb] = self._nominal.swings.index(swing) if swing is not None else -1
                if swing is not None and swing.contact is not None:
                    off = dynamics.limb_position[limb] - swing.contact.pose.position
                    self._moved[limb] = off if np.linalg.norm(off) > self._deadband else 0.0
        if time >= self._due - 1e-9:
            self._due = time + PERIOD
            self._replan(index, dynamics, tracker, cones)
        self._follow_feet(index, period)
        self._track(time, aim)
        self._move_landings(time, period, tracker, targets)

    def _replan(self, index: int, dynamics: RobotDynamics, tracker: ContactTracker, cones: Cones) -> None:
        """Solve once where the plan is left; where that fails the last answer goes on."""
        time, displaced = float(self._reference.times[index]), self._displaced(tracker)
        if time >= self._nominal.times[-1] - self._nominal.horizon:
            return
        self._replans += 1
        if not displaced and self._divergence(index, dynamics) <= self._deadband:
            self._plan, self._ends = None, {}
            self._goal.clear()
            return
        began = process_time()
        plan = self._problem.solve(self._situation(time, displaced, dynamics, tracker, cones))
        self._departures += 1
        if plan is None:
            self._failures += 1
        else:
            self._plan = plan
            self._goal.update(plan.landing)
            self._ends = plan.ends
            self._landings += bool(plan.landing)
        self._seconds += process_time() - began

    def _displaced(self, tracker: ContactTracker) -> bool:
        """Whether feet stand elsewhere than planned, are on their way elsewhere, or are to land earlier."""
        if self._ends or np.linalg.norm(self._moved[:2], axis=1).any():
            return True
        for foot in FEET:
            swing = tracker.current[foot]
            if swing is None or tracker.state[foot] is not LimbState.SWING:
                continue
            shift: np.ndarray = self._shift[foot]
            goal: np.ndarray = self._goal.get(self._nominal.swings.index(swing), shift)
            if max(np.linalg.norm(goal), np.linalg.norm(shift)) > self._deadband:
                return True
        return bool(np.linalg.norm(self.com_shift) > self._deadband)

    def _divergence(self, index: int, dynamics: RobotDynamics) -> float:
        """Divergence in m from the plan moved with the feet that bear it."""
        off = dynamics.com - self._reference.com[index] - self.com_shift
        speed = dynamics.com_velocity - self._reference.com_velocity[index]
        return float(np.linalg.norm(off + speed / self._rate))

    def _follow_feet(self, index: int, period: float) -> None:
        """Move the plan's shift towards that of the feet that bear it."""
        load = np.maximum(self._reference.wrench[index, :2, 2], 0.0)
        total = float(load.sum())
        if total > 0.0:
            wanted = load @ self._moved[:2] / total
            self.com_shift += period * self._rate * (wanted - self.com_shift)

    @property
    def counts(self) -> ReplanCounts:
        """How the run was replanned so far."""
        mean = self._seconds / max(self._departures, 1)
        return ReplanCounts(self._replans, self._failures, self._departures, self._landings, mean)

    def _situation(
        self, time: float, displaced: bool, dynamics: RobotDynamics, tracker: ContactTracker, cones: Cones
    ) -> Situation:
        """The measured situation."""
        standing, fixed, moving, landing, earliest = {}, {}, {}, {}, {}
        for limb in dynamics.limbs:
            if tracker.in_contact[limb]:
                pose = dynamics.limb_position[limb].copy(), dynamics.limb_rotation[limb].copy()
                standing[limb] = (self._made.get(limb, -1), *pose)
                continue
            swing = tracker.current[limb]
            if swing is None or swing.contact is None:
                continue
            index = self._nominal.swings.index(swing)
            lead = float(tracker.lead[limb])
            over = (time + lead - swing.start) / (swing.end - swing.start)
            if tracker.state[limb] is LimbState.SWING and limb.is_foot:
                earliest[index] = time + (swing.end - time - lead) / self._most(swing) + self._time * SOONEST
                landing[index] = min(max(self._ends.get(index, np.inf), earliest[index]), swing.end - lead)
            if tracker.state[limb] is not LimbState.SWING or over > KEPT_FROM:
                fixed[index] = self._goal.get(index, np.zeros(3))
            else:
                moving[index] = self._shift[limb].copy()
        return Situation(
            time=time,
            com=dynamics.com.copy(),
            velocity=dynamics.com_velocity.copy(),
            spin=dynamics.angular_momentum / self._mass,
            standing=standing,
            fixed=fixed,
            moving=moving,
            goal=self._goal,
            landing=landing,
            earliest=earliest,
            com_shift=self.com_shift.copy(),
            displaced=displaced,
            cones=cones,
        )

    def _most(self, swing: Swing) -> float:
        """Fastest pace of a swing."""
        return min(max((swing.end - swing.start) / self._shortest, 1.0), PACE)

    def _track(self, time: float, target: MotionTarget) -> None:
        """Move the target by the last replan, or beyond its horizon with the feet that bear the plan."""
        plan = self._plan
        if plan is None or time >= plan.times[-1]:
            target.com += self.com_shift
            return
        k = int(np.searchsorted(plan.times, time + 1e-9, side="right")) - 1
        tau = time - plan.times[k]
        acceleration = plan.acceleration[k]
        target.com += plan.com[k] + tau * plan.velocity[k] + 0.5 * tau * tau * acceleration
        target.com_velocity += plan.velocity[k] + tau * acceleration
        target.com_acceleration += acceleration
        target.angular_momentum_rate += self._mass * plan.spin_rate[k]
        target.angular_momentum += self._mass * (plan.spin[k] + tau * plan.spin_rate[k])
        target.wrench[:] = self._weight * plan.wrench[k]

    def _move_landings(self, time: float, period: float, tracker: ContactTracker, targets: LimbTargets) -> None:
        """Move landing points and paces of feet in the air smoothly to those of the last replan."""
        for foot in FEET:
            if tracker.begun[foot]:
                self._shift[foot] = self._shift_rate[foot] = 0.0
            swing = tracker.current[foot]
            if swing is None or tracker.state[foot] is not LimbState.SWING or tracker.begun[foot]:
                self._shift_rate[foot] = 0.0
                targets.shift_velocity[foot] = 0.0
                continue
            event = self._nominal.swings.index(swing)
            end = self._ends.get(event, swing.end)
            left = max(end - time, self._time * SOONEST)
            pace = (swing.end - time - tracker.lead[foot]) / left if end < swing.end else 1.0
            pace = min(max(pace, 1.0), self._most(swing))
            change = self._pace_rate * period
            tracker.pace[foot] += min(max(pace - tracker.pace[foot], -change), change)
            goal = self._goal.get(event, self._shift[foot])
            last = min(end, swing.start + 0.9 * (swing.end - swing.start)) - self._time * SETTLED_BEFORE
            left = max(last - time, self._time * LEAST_LEFT)
            pull = 6.0 * (goal - self._shift[foot]) / left**2 - 4.0 * self._shift_rate[foot] / left
            self._shift_rate[foot] += period * pull
            self._shift[foot] += period * self._shift_rate[foot]
            targets.shift[foot], targets.shift_velocity[foot] = self._shift[foot], self._shift_rate[foot]
