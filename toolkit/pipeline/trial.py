"""Testing contact sequences: optimiser, inverse kinematics, simulation."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from toolkit.centroidal.part import part_motion
from toolkit.centroidal.plan import MotionConfig, MotionPlan, keeps_margins, plan_motion, slid
from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.failure import Failure
from toolkit.contacts.room import RoomConfig
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.execution.check import Result
from toolkit.execution.result import Execution
from toolkit.execution.run import execute
from toolkit.pipeline.candidate import Candidate
from toolkit.pipeline.config import PipelineConfig
from toolkit.pipeline.observer import Observer
from toolkit.robot.model import RobotModel
from toolkit.search.moves.body_room import BodyRoom
from toolkit.search.result import Solution
from toolkit.wholebody.plan import LEVEL, WIDE, Manner, WholeBodyPlan, whole_body
from toolkit.wholebody.trajectory import WholeBodyTrajectory
from toolkit.world.scene import compose_scene
from toolkit.world.world import World


@dataclass(frozen=True)
class Trial:
    """One candidate and how far it came.

    Attributes:
        candidate: The contact sequence with its optimised motion.
        plan: The plan of the stages so far; a `WholeBodyPlan` from the whole-body stage on.
        execution: Measurements of the simulation; None where an earlier stage rejected the plan or was the last one.
        failure: Why it did not pass; None where every wanted stage passed, and every check of the execution.
    """

    candidate: Candidate
    plan: MotionPlan
    execution: Execution | None = None
    failure: Failure | None = None

    @property
    def solution(self) -> Solution:
        """The contact sequence as it was found."""
        return self.candidate.solution

    @property
    def passed(self) -> bool:
        """Whether every wanted stage passed."""
        return self.failure is None

    @property
    def trajectory(self) -> WholeBodyTrajectory | None:
        """Joint trajectories; None where the whole-body stage was not reached."""
        return self.plan.trajectory if isinstance(self.plan, WholeBodyPlan) else None

    @property
    def merit(self) -> tuple[int, bool, int]:
        """How far it came, to compare failures: by stages, then by arrival, then by checks passed."""
        stages = 1 + sum(stage is not None for stage in (self.trajectory, self.execution)) + self.passed
        if self.execution is None:
            return stages, False, 0
        return stages, self.execution.goal_reached, sum(c.result == Result.PASS for c in self.execution.checks)


class Tester:
    """Puts contact sequences through optimiser, inverse kinematics and simulation."""

    def __init__(self, robot: RobotModel, world: World, config: PipelineConfig, observer: Observer):
        """Prepare for a robot in a world; the observer is told of every stage after the optimiser."""
        self._robot, self._world, self._config, self._observer = robot, world, config, observer
        self._motions = config.motions(robot.scale)

    @cached_property
    def _surroundings(self) -> BodyRoom:
        """The room that the world leaves to the body."""
        return BodyRoom(self._robot, self._world)

    @cached_property
    def _scene(self) -> mujoco.MjModel:
        """Robot and world in one model, composed when the first sequence needs it."""
        return compose_scene(self._robot, self._world)

    def optimise(self, sequence: ContactSequence, known: MotionPlan | None = None) -> tuple[MotionPlan, Failure | None]:
        """Optimise the motion of a sequence; also why there is none.

        A `known` plan of it that was made with the settings of this run is taken as it is.
        """
        plan = known
        if plan is None or plan.config != self._motions:
            plan = self._motion(sequence, self._motions)
        if plan.motion.feasible:
            return plan, None
        return plan, _because(f"no feasible centroidal motion: {plan.motion.outcome}", plan.motion.failure)

    def motion_of(self, sequence: ContactSequence) -> MotionPlan:
        """Optimise the motion of a sequence with its contacts where they are."""
        return self._motion(sequence, replace(self._motions, landing=None))

    def settled(self, plan: MotionPlan) -> MotionPlan:
        """A plan whose motion is that of its contacts where they are, so that they alone give the plan again."""
        settled = self.motion_of(plan.sequence)
        return settled if settled.motion.feasible and keeps_margins(settled, plan) else plan

    def _motion(self, sequence: ContactSequence, config: MotionConfig) -> MotionPlan:
        return plan_motion(self._robot, self._world, sequence, config, self._surroundings)

    def slide(self, plan: MotionPlan, landing: RoomConfig, share: np.ndarray) -> MotionPlan | None:
        """Move the landing points of a plan; see `toolkit.centroidal.plan.slid`."""
        return slid(plan, landing, self._config.sequence, share, self._surroundings)

    def part(
        self, plan: MotionPlan, part: ContactSequence, first: int, following: ContactTransition | None
    ) -> CentroidalMotion:
        """Optimise a part of a sequence from a plan's state; see `toolkit.centroidal.part.part_motion`."""
        return part_motion(plan, part, first, following, self._motions.optimiser, self._surroundings)

    def test(self, candidate: Candidate) -> Trial:
        """Put a candidate through the stages after the optimiser; stop at the first that fails.

        Where it touches something in execution that it should not, it is tried once more with wide clearances; where it
        slips, with trunk and arms that turn against the swinging leg.
        """
        config, plan = self._config, candidate.plan
        if candidate.failure is not None or config.until == "dynamics":
            return Trial(candidate, plan, failure=candidate.failure)

        trial = self._executed(candidate, plan, Manner())
        manner = None if trial.execution is None else _better_manner(trial.execution)
        if manner is not None:
            trial = max(trial, self._executed(candidate, plan, manner), key=lambda each: each.merit)
        return trial

    def _executed(self, candidate: Candidate, plan: MotionPlan, manner: Manner) -> Trial:
        """The whole-body motion of a plan, made in some manner, and its execution."""
        config, observer = self._config, self._observer
        observer.started("wholebody")
        plan = whole_body(plan, self._scene, manner)
        trajectory = plan.trajectory
        observer.finished("wholebody", trajectory.feasible, trajectory.seconds, trajectory.reason)
        if not trajectory.feasible:
            reason = f"no whole-body motion: {trajectory.reason}"
            return Trial(candidate, plan, failure=_because(reason, trajectory.failure))
        if config.until == "wholebody":
            return Trial(candidate, plan)

        observer.started("execution")
        began = time.perf_counter()
        execution = execute(
            plan,
            config=config.execution,
            rng=np.random.default_rng([config.seed, 1]),
            observer=lambda fraction, detail="": observer.progress("execution", fraction, detail),
        )
        trial = Trial(candidate, plan, execution, execution.failure)
        reason = _grazes(execution) if trial.failure is None else trial.failure.reason
        observer.finished("execution", trial.passed, time.perf_counter() - began, reason)
        return trial


def _better_manner(execution: Execution) -> Manner | None:
    """What may mend a run that failed because something touched the world that should not, or because a sole slipped.

    None for other failures, and for falls.
    """
    failed = {check.name for check in execution.checks if check.result is Result.FAIL}
    if execution.fell:
        return None
    if failed & {"unplanned_contacts", "scuff"}:
        return WIDE
    return LEVEL if "slip" in failed else None


def _grazes(execution: Execution) -> str:
    """What limbs touched in the midst of their swings, "" where none did."""
    if not execution.scuffs:
        return ""
    worst = max(execution.scuffs, key=lambda each: each.impulse)
    swings = f"{len(execution.scuffs)} swing{'s' if len(execution.scuffs) > 1 else ''} graze"
    return f"{swings}, worst the {worst.limb.label} at {worst.time:.2f} s: {worst.impulse:.2g} N s, {worst.peak:.0f} N"


def _because(reason: str, failure: Failure | None) -> Failure:
    """A stage's failure with the reason of the verdict."""
    return Failure(reason) if failure is None else replace(failure, reason=reason)
