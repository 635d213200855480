"""The true cost of a plan: the search's own terms over its transitions, and the objective of its optimised motion.

Choice of the plan, local search, report and benchmarks judge all planners by it. Whatever a planner's own search counts
or leaves out, the plan costs the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.plan import MotionPlan
from toolkit.contacts.projected import Projected
from toolkit.contacts.sequence import ContactSequence
from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import Limb
from toolkit.robot.scale import USUAL, Scale
from toolkit.search.costs.edge_cost import CostConfig, Terms, TransitionCost
from toolkit.search.moves.candidates import Candidates
from toolkit.search.states.contact_table import ContactTable
from toolkit.world.timing import Timing
from toolkit.world.world import Goal


@dataclass(frozen=True)
class PlanCost:
    """The true cost of a plan and its terms, in the units of the search's cost; see `CostConfig`.

    Attributes:
        way: Of the way of the mean of the feet.
        step: Of the number of transitions.
        time: Of the seconds, rests included.
        steep: Of contacts that leave little friction.
        stagger: Of one foot ahead of the other in the end.
        heading: Of the way that is walked backwards.
        dynamics: Of the objective of the motion.
        seconds: s; length of the plan, rests included.
        objective: J of the motion with the weights of its problem; inf where the motion is infeasible.
    """

    way: float
    step: float
    time: float
    steep: float
    stagger: float
    heading: float
    dynamics: float
    seconds: float
    objective: float

    @property
    def total(self) -> float:
        """The true cost; inf where the motion is infeasible."""
        return sum(self.terms.values())

    @property
    def terms(self) -> dict[str, float]:
        """The terms by name, which add up to the true cost."""
        return {name: getattr(self, name) for name in (*Terms._fields, "dynamics")}


def plan_cost(plan: MotionPlan, config: CostConfig) -> PlanCost:
    """The true cost of a plan.

    Args:
        plan: Contacts, times and motion; its contacts count where the optimiser has put them.
        config: Weights of the run (`CostConfig.where`).
    """
    cost, candidates = _transitions(plan.sequence, plan.world.goal, config, plan.robot.scale)
    known = {name: float(term.sum()) for name, term in cost.terms(candidates)._asdict().items()}
    rest = plan.schedule.duration - plan.sequence.duration
    feasible = plan.motion.feasible
    return PlanCost(
        **{**known, "time": known["time"] + cost.time * rest},
        dynamics=cost.dynamics * plan.motion.objective if feasible else np.inf,
        seconds=plan.schedule.duration,
        objective=plan.motion.objective if feasible else np.inf,
    )


def known_costs(sequence: ContactSequence, goal: Goal, config: CostConfig, scale: Scale = USUAL) -> np.ndarray:
    """(transitions,) sums of the terms of a sequence that are known without its motion; no rests."""
    cost, candidates = _transitions(sequence, goal, config, scale)
    return cost.known(candidates)


def _transitions(
    sequence: ContactSequence, goal: Goal, config: CostConfig, scale: Scale
) -> tuple[TransitionCost, Candidates]:
    """The transitions of a sequence as the search has them, and their cost."""
    made = [transition.contact for transition in sequence.transitions if transition.contact is not None]
    contacts = [*sequence.start.contacts, *made]
    # Each contact stands for a surface of its own, so that none is rounded to another and each keeps its friction.
    table = ContactTable(np.array([contact.friction for contact in contacts]), scale.length)
    numbers = _entered(table, contacts)
    stances = np.full((len(sequence.transitions) + 1, 4), -1)
    for contact, number in zip(sequence.start.contacts, numbers, strict=False):
        stances[:, contact.limb] = number
    following = iter(numbers[len(sequence.start.contacts) :])
    for index, transition in enumerate(sequence.transitions):
        stances[index + 1 :, transition.limb] = -1 if transition.contact is None else next(following)
    timings: dict[Timing, int] = {}
    timing = [timings.setdefault(transition.timing, len(timings)) for transition in sequence.transitions]
    limb = np.array([transition.limb for transition in sequence.transitions], int)
    candidates = Candidates.of(table, stances[:-1], limb, stances[1:], np.array(timing, int))
    return TransitionCost(config, table, tuple(timings), goal, scale), candidates


def _entered(table: ContactTable, contacts: Sequence[Contact]) -> list[int]:
    """Numbers of contacts, entered limb by limb, each as one on a surface with its own index."""
    numbers = np.empty(len(contacts), np.int64)
    limbs = np.array([contact.limb for contact in contacts])
    position = np.array([contact.pose.position for contact in contacts])
    rotation = np.array([contact.pose.rotation for contact in contacts])
    for limb in Limb:
        (own,) = np.nonzero(limbs == limb)
        if len(own):
            numbers[own] = table.add(limb, Projected(own, position[own], rotation[own]))
    return numbers.tolist()
