"""What sequences truly cost: each is optimised as the pipeline does it, and priced by the true cost."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from toolkit.centroidal.plan import MotionPlan
from toolkit.centroidal.problem import Weights
from toolkit.centroidal.residual import objective
from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import PlanningError
from toolkit.pipeline.config import PipelineConfig
from toolkit.pipeline.observer import Observer
from toolkit.pipeline.trial import Tester
from toolkit.refine import LocalSearch, RefineConfig
from toolkit.robot.model import RobotModel
from toolkit.search.costs.plan_cost import PlanCost, plan_cost
from toolkit.search.ground import Ground
from toolkit.search.planner_config import PlannerConfig
from toolkit.search.sequence_screen import SequenceScreen
from toolkit.world.timing import Timings, given_timings
from toolkit.world.world import World
from validation.motion_figures import motion_figures


@dataclass(frozen=True)
class Outcome:
    """An optimised sequence.

    Attributes:
        plan: The plan.
        cost: Its true cost, inf where it is infeasible.
        paper_objective: J with the paper's weights; inf where it is infeasible.
        seconds: s; wall-clock time of the optimisation.
        processor_seconds: s; processor time of it.
    """

    plan: MotionPlan
    cost: PlanCost
    paper_objective: float
    seconds: float
    processor_seconds: float

    @property
    def feasible(self) -> bool:
        """Whether there is a motion."""
        return self.plan.motion.feasible

    def record(self) -> dict[str, Any]:
        """The figures, as JSON can hold them; those of the motion are None where there is none."""
        transitions = self.plan.sequence.transitions
        found: dict[str, Any] = {
            "feasible": self.feasible,
            "reason": "" if self.feasible else self.plan.motion.outcome,
            "optimiser_seconds": self.seconds,
            "optimiser_processor_seconds": self.processor_seconds,
            "transitions": len(transitions),
            "palm_contacts": sum(not t.limb.is_foot and t.contact is not None for t in transitions),
            "walking_seconds": self.plan.schedule.duration,
        }
        if not self.feasible:
            return found
        return found | {
            "true_cost": self.cost.total,
            "terms": self.cost.terms,
            "objective": self.cost.objective,
            "paper_objective": self.paper_objective,
            "figures": asdict(motion_figures(self.plan.motion)),
        }


class Truth:
    """Optimises the sequences of one world, each of them once.

    Args:
        robot: The robot.
        world: The world.
        timings: That all planners are asked for.

    Attributes:
        cost: Weights of the true cost on this ground and at this timing, the same for all planners.
    """

    def __init__(self, robot: RobotModel, world: World, timings: Timings):
        config = PipelineConfig()
        self._tester = Tester(robot, world, config, Observer())
        self.cost = config.cost.where(slides=slides(robot, world), paced=not given_timings(timings, world.timing))
        self._known: dict[bytes, Outcome] = {}

    def __call__(self, sequence: ContactSequence, plan: MotionPlan | None = None) -> Outcome:
        """The outcome of a sequence, of which a search may have made the plan already."""
        key = sequence.identity
        if key not in self._known:
            self._known[key] = self._timed(lambda: self._motion_of(sequence, plan))
        return self._known[key]

    def improved(self, plan: MotionPlan, origin: ContactSequence, screen: SequenceScreen, motions: int) -> Outcome:
        """What the local search of the pipeline makes of a plan with a feasible motion.

        Args:
            plan: The plan.
            origin: Its sequence as the search found it.
            screen: The screens of the search that found its sequence.
            motions: Most motions that it may optimise.
        """
        config = RefineConfig(optimisations=motions)
        local = LocalSearch(config, self.cost, self._motion_of, self._tester.slide, self._tester.part)
        return self._timed(lambda: local.improved(plan, origin, screen, lambda sequence: True))

    def _motion_of(self, sequence: ContactSequence, known: MotionPlan | None = None) -> MotionPlan:
        """The motion of a sequence, feasible or not; that of a search where it is known."""
        return self._tester.optimise(sequence, known)[0]

    def _timed(self, make: Callable[[], MotionPlan]) -> Outcome:
        """The plan that is made, its price, and how long making it took."""
        began, worked = time.perf_counter(), time.process_time()
        plan = make()
        seconds, processor = time.perf_counter() - began, time.process_time() - worked
        paper = objective(plan.motion, Weights()) if plan.motion.feasible else np.inf
        return Outcome(plan, plan_cost(plan, self.cost), paper, seconds, processor)


def slides(robot: RobotModel, world: World) -> bool:
    """Whether no way leads over resting ground alone; where none leads to the goal at all, nothing slides."""
    ground = Ground(robot, world, PlannerConfig())
    try:
        return ground.way(ground.start_stance()).slides
    except PlanningError:
        return False
