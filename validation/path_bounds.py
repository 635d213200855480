"""Whether the search's h is a lower bound: at every state of a path it may not exceed what the rest of the way cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.intervals import intervals
from toolkit.contacts.sequence import ContactSequence
from toolkit.search.costs.edge_cost import EdgeCost
from toolkit.search.costs.plan_cost import known_costs
from toolkit.search.planner import ContactPlanner
from validation.searched import Tested

ROUNDING = 1e-2  # of the cost to go; states are rounded to 1 mm and 0.1 degree, the contacts of a sequence are not


@dataclass(frozen=True)
class PathBounds:
    """h and the cost to go at the n states of a path that are not its end.

    Attributes:
        h: (n,) the search's lower bound.
        predicted: (n,) cost to go as the search counts it.
        h_of_plan: (n,) the lower bound where the optimiser put the contacts.
        true: (n,) true cost to go of the plan with the search's weights, infinite where it is infeasible.
    """

    h: np.ndarray
    predicted: np.ndarray
    h_of_plan: np.ndarray
    true: np.ndarray

    @property
    def largest_part(self) -> float:
        """Largest ratio of h to the predicted cost to go."""
        return float(np.max(self.h / self.predicted, initial=0.0))

    @property
    def largest_true_part(self) -> float:
        """Largest ratio of h to the true cost to go."""
        return float(np.max(self.h_of_plan / self.true, initial=0.0))

    @property
    def violations(self) -> int:
        """Number of states with h above the predicted or above the true cost to go."""
        above = self.h > self.predicted * (1 + ROUNDING)
        return int((above | (self.h_of_plan > self.true * (1 + ROUNDING))).sum())


class BoundCheck:
    """Compares the h of one planner with the cost to go on its paths.

    Args:
        planner: The planner that found them.

    Raises:
        PlanningError: See `toolkit.search.ground.Ground.way`.
    """

    def __init__(self, planner: ContactPlanner):
        config, ground = planner.config, planner.ground
        way = ground.way(ground.start_stance())
        weights = config.cost.where(slides=way.slides, paced=planner.paced)
        self._usual, self._scale = weights, planner.robot.scale
        self._weights = weights.scaled(self._scale)
        table, timings = ground.moves(way).table, planner.timings(slides=way.slides)
        self._goal = planner.world.goal
        self._cost = EdgeCost(
            weights,
            table,
            timings,
            self._goal,
            way.distance,
            way.longest,
            planner.robot.mass,
            planner.robot.scale,
        )

    def __call__(self, tested: Tested) -> PathBounds:
        """The h and the cost to go along a sequence of the planner."""
        solution, plan = tested.solution, tested.outcome.plan
        predicted = self._known(solution.sequence) + self._weights.dynamics * _from_here(solution.objective)
        true = np.full(len(predicted), np.inf)
        if plan.motion.feasible:
            rest = plan.schedule.phases[-1]
            after = rest.duration if rest.swing is None else 0.0
            true = self._known(plan.sequence) + self._weights.time * after
            true += self._weights.dynamics * _from_here(intervals(plan.motion, plan.schedule).objective)
        return PathBounds(self._h(solution.sequence), predicted, self._h(plan.sequence), true)

    def _h(self, sequence: ContactSequence) -> np.ndarray:
        """(n,) h of the stances before each transition."""
        feet = [stance.mean_feet for stance in sequence.stances[:-1]]
        if not feet:
            return np.zeros(0)
        return self._cost.to_go(np.array([pose.position for pose in feet]), np.array([pose.yaw for pose in feet]))

    def _known(self, sequence: ContactSequence) -> np.ndarray:
        """(n,) what the transitions from each one on cost without their dynamics."""
        return _from_here(known_costs(sequence, self._goal, self._usual, self._scale))


def _from_here(terms: np.ndarray) -> np.ndarray:
    """(n,) sums of a term (n,) of the transitions from each one on."""
    return np.cumsum(terms[::-1])[::-1]
