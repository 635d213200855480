"""Candidates: the contact sequences of a run, each with its optimised motion and its true cost."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from toolkit.centroidal.plan import MotionPlan
from toolkit.contacts.failure import Failure
from toolkit.search.costs.plan_cost import PlanCost
from toolkit.search.result import Solution


class Source(StrEnum):
    """What found a sequence."""

    SEARCH = "search"
    LOCAL = "local search"
    TIMED = "a calmer timing"


def refined_solution(plan: MotionPlan, cost: PlanCost, seconds: float) -> Solution:
    """The sequence of an optimised plan as a solution whose prediction is its motion; `seconds` as in `Solution`."""
    samples = map(plan.motion.sample, plan.schedule.stance_times)
    com, velocity = (np.array(part) for part in list(zip(*samples, strict=True))[:2])
    unknown = np.full(len(plan.sequence.transitions), np.nan)
    return Solution(plan.sequence, cost.total, np.inf, seconds, com, velocity, unknown)


@dataclass(frozen=True)
class Candidate:
    """A contact sequence with its optimised motion.

    Attributes:
        number: Its number in the run, from 0 on, in the order in which the sequences were optimised.
        source: What found it.
        search: The search that it comes from, the first one being 0.
        seconds: s; time of all searches until it was found.
        solution: The sequence as it was found, with its predicted cost.
        plan: Its motion, and its contacts where the optimiser put them.
        cost: Its true cost.
        failure: Why there is no feasible motion; None where there is one.
    """

    number: int
    source: Source
    search: int
    seconds: float
    solution: Solution
    plan: MotionPlan
    cost: PlanCost
    failure: Failure | None

    @property
    def feasible(self) -> bool:
        """Whether the optimiser found a motion."""
        return self.failure is None

    @property
    def uses_palms(self) -> bool:
        """Whether palms are in contact later than the transitions that could end the start's palm contacts."""
        sequence = self.solution.sequence
        return any(stance.palms for stance in sequence.stances[len(sequence.start.palms) :])

    @property
    def palm_contacts(self) -> int:
        """Number of contacts that palms make."""
        return sum(not t.limb.is_foot and t.contact is not None for t in self.solution.sequence.transitions)
