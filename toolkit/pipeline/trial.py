"""Testing one contact sequence: optimiser, inverse kinematics, simulation."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from toolkit.centroidal.plan import MotionPlan, plan_motion
from toolkit.contacts.failure import Failure
from toolkit.execution.check import Result
from toolkit.execution.result import Execution
from toolkit.execution.run import execute
from toolkit.pipeline.config import PipelineConfig
from toolkit.pipeline.observer import Observer
from toolkit.robot.model import RobotModel
from toolkit.search.result import Solution
from toolkit.wholebody.plan import WholeBodyPlan, whole_body
from toolkit.wholebody.trajectory import WholeBodyTrajectory
from toolkit.world.scene import compose_scene
from toolkit.world.world import World


@dataclass(frozen=True)
class Trial:
    """One contact sequence and how far it came.

    Attributes:
        solution: The contact sequence as the search found it.
        plan: The plan of the stages so far; a `WholeBodyPlan` from the whole-body stage on.
        execution: Measurements of the simulation; None where an earlier stage rejected the plan or was the last one.
        failure: Why it did not pass; None where every wanted stage passed, and every check of the execution.
    """

    solution: Solution
    plan: MotionPlan
    execution: Execution | None = None
    failure: Failure | None = None

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
        """Prepare for a robot in a world; the observer is told of every stage."""
        self._robot, self._world, self._config, self._observer = robot, world, config, observer

    @cached_property
    def _scene(self) -> mujoco.MjModel:
        """Robot and world in one model, composed when the first sequence needs it."""
        return compose_scene(self._robot, self._world)

    def test(self, solution: Solution) -> Trial:
        """Test one sequence; stop at the first stage that fails."""
        config, observer = self._config, self._observer
        observer.started("dynamics")
        plan = plan_motion(
            self._robot,
            self._world,
            solution.sequence,
            initial_rest=config.initial_rest,
            final_rest=config.final_rest,
            landing=config.landing,
            config=config.sequence,
        )
        motion = plan.motion
        observer.finished("dynamics", motion.feasible, motion.seconds, motion.outcome)
        if not motion.feasible:
            reason = f"no feasible centroidal motion: {motion.outcome}"
            return Trial(solution, plan, failure=_because(reason, motion.failure))
        if config.until == "dynamics":
            return Trial(solution, plan)

        observer.started("wholebody")
        plan = whole_body(plan, self._scene)
        trajectory = plan.trajectory
        observer.finished("wholebody", trajectory.feasible, trajectory.seconds, trajectory.reason)
        if not trajectory.feasible:
            reason = f"no whole-body motion: {trajectory.reason}"
            return Trial(solution, plan, failure=_because(reason, trajectory.failure))
        if config.until == "wholebody":
            return Trial(solution, plan)

        observer.started("execution")
        began = time.perf_counter()
        execution = execute(
            plan,
            config=config.execution,
            rng=np.random.default_rng([config.seed, 1]),
            observer=lambda fraction, detail="": observer.progress("execution", fraction, detail),
        )
        trial = Trial(solution, plan, execution, execution.failure)
        reason = "" if trial.failure is None else trial.failure.reason
        observer.finished("execution", trial.passed, time.perf_counter() - began, reason)
        return trial


def _because(reason: str, failure: Failure | None) -> Failure:
    """A stage's failure with the reason of the verdict."""
    return Failure(reason) if failure is None else replace(failure, reason=reason)
