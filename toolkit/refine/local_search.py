"""LocalSearch: variants of a sequence, tried until none is truly cheaper or the budget is spent."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from toolkit.centroidal.plan import MotionPlan, keeps_margins
from toolkit.contacts.room import RoomConfig
from toolkit.contacts.sequence import ContactSequence
from toolkit.refine.foresight import Foresight
from toolkit.refine.variants import left_out, merged, swapped, without_palms
from toolkit.search.costs.edge_cost import CostConfig, arrival_radius
from toolkit.search.costs.plan_cost import PlanCost, plan_cost
from toolkit.search.sequence_screen import SequenceScreen

Optimise = Callable[[ContactSequence], MotionPlan]
"""The motion of a sequence."""
Slide = Callable[[MotionPlan, RoomConfig, Collection[int]], "MotionPlan | None"]
"""A plan with landing points moved, but for the transitions that stay; see `toolkit.centroidal.plan.slid`."""
Allowed = Callable[[ContactSequence], bool]
"""Whether a sequence may be tried at all."""

_REPAIRS = 2  # times that landing points which the screens reject are put back


@dataclass(frozen=True)
class RefineConfig:
    """Settings of the local search.

    Attributes:
        optimisations: Most motions to optimise in one run.
        starts: Number of the truly cheapest sequences from which it starts.
        batch: Motions that are optimised before the cheapest of them is taken, if it is cheaper than the sequence is.
        gain: Least part of the true cost by which a variant has to be cheaper.
        prospect: Variants whose guessed cost is higher than the sequence's by more than this part are not optimised,
            unless they only leave contacts out.
        slides: Most times in a row that landing points are moved.
        landing: How far they move each time.
    """

    optimisations: int = 60
    starts: int = 1
    batch: int = 6
    gain: float = 0.003
    prospect: float = 0.05
    slides: int = 3
    landing: RoomConfig = field(default_factory=lambda: RoomConfig(reach=(0.15, 0.1)))


class LocalSearch:
    """Searches for truly cheaper variants of the sequences of one run.

    Args:
        config: Settings.
        cost: Weights of the true cost.
        optimise: Optimises the motion of a sequence.
        slide: Moves the landing points of a plan.

    Attributes:
        spent: Number of motions that were optimised so far.
    """

    def __init__(self, config: RefineConfig, cost: CostConfig, optimise: Optimise, slide: Slide):
        self._config, self._cost, self._optimise, self._slide = config, cost, optimise, slide
        self._known: dict[bytes, tuple[MotionPlan, PlanCost]] = {}
        self.spent = 0

    def improved(self, plan: MotionPlan, screen: SequenceScreen, allowed: Allowed) -> MotionPlan:
        """The cheapest plan that is found from a plan with a feasible motion; the plan itself where none is cheaper.

        Args:
            plan: The plan.
            screen: The screens of the search that found its sequence.
            allowed: Whether a sequence may be tried.
        """
        best = plan, plan_cost(plan, self._cost)
        while True:
            best = self._descended(*best, screen, allowed)
            slid = self._slid(*best, screen, allowed)
            if slid is None:
                return best[0]
            best = slid

    def _descended(
        self, plan: MotionPlan, cost: PlanCost, screen: SequenceScreen, allowed: Allowed
    ) -> tuple[MotionPlan, PlanCost]:
        """The best of the plan's variants, the best of that one's variants, and so on, as long as they are cheaper."""
        while True:
            better = self._best_variant(plan, cost, screen, allowed)
            if better is None:
                return plan, cost
            plan, cost = better

    def _best_variant(
        self, plan: MotionPlan, cost: PlanCost, screen: SequenceScreen, allowed: Allowed
    ) -> tuple[MotionPlan, PlanCost] | None:
        """The cheapest of the first variants among which one is cheaper than the plan; None where none is."""
        best: tuple[MotionPlan, PlanCost] | None = None
        least, tried = cost.total * (1.0 - self._config.gain), 0
        for variant in self._variants(plan, cost, screen):
            if not allowed(variant) or not _arrives(variant, plan):
                continue
            if best is not None and tried >= self._config.batch:
                break
            found = self._judged(variant, plan, screen)
            tried += 1
            if found is not None and found[1].total < least:
                best, least = found, found[1].total
        return best

    def _variants(self, plan: MotionPlan, cost: PlanCost, screen: SequenceScreen) -> Iterator[ContactSequence]:
        """Variants that pass the screens, those that are guessed to be the cheapest first."""
        sequence = plan.sequence
        foresight = Foresight(sequence, cost, self._cost, plan.world.goal)
        seen = {sequence.identity}
        guesses: list[tuple[float, ContactSequence]] = []
        most = cost.total * (1.0 + self._config.prospect)
        fewer = chain(without_palms(sequence, screen), left_out(sequence, screen))
        others = chain(merged(sequence, screen), swapped(sequence, screen))
        for always, variants in ((True, fewer), (False, others)):
            for variant in variants:
                if variant.identity not in seen:
                    seen.add(variant.identity)
                    guess = foresight(variant)
                    if always or guess <= most:
                        guesses.append((guess, variant))
        for _, variant in sorted(guesses, key=lambda item: item[0]):
            yield variant

    def _judged(
        self, sequence: ContactSequence, base: MotionPlan, screen: SequenceScreen
    ) -> tuple[MotionPlan, PlanCost] | None:
        """A sequence with its motion and true cost; None where the budget is spent or the motion does not hold."""
        identity = sequence.identity
        if identity not in self._known:
            if self.spent >= self._config.optimisations:
                return None
            self.spent += 1
            plan = self._optimise(sequence)
            self._known[identity] = plan, plan_cost(plan, self._cost)
        plan, cost = self._known[identity]
        return (plan, cost) if self._holds(plan, base, screen) else None

    def _holds(self, plan: MotionPlan, base: MotionPlan, screen: SequenceScreen) -> bool:
        """Whether a plan's motion is feasible with the margins of the one before, and within the search's limits."""
        if not plan.motion.feasible or not keeps_margins(plan, base):
            return False
        return screen.passes(plan.sequence) and not screen.reach_codes(plan).any()

    def _slid(
        self, plan: MotionPlan, cost: PlanCost, screen: SequenceScreen, allowed: Allowed
    ) -> tuple[MotionPlan, PlanCost] | None:
        """The plan with its landing points moved as long as that helps; None where it does not."""
        best: tuple[MotionPlan, PlanCost] | None = None
        for _ in range(self._config.slides):
            found = self._slid_once(plan, screen, allowed)
            if found is None or found[1].total > cost.total * (1.0 - self._config.gain):
                break
            best = plan, cost = found
        return best

    def _slid_once(
        self, plan: MotionPlan, screen: SequenceScreen, allowed: Allowed
    ) -> tuple[MotionPlan, PlanCost] | None:
        """The plan with its landing points moved; those that the screens reject stay, with those just before."""
        fixed: set[int] = set()
        for _ in range(1 + _REPAIRS):
            if self.spent >= self._config.optimisations:
                return None
            self.spent += 1
            moved = self._slide(plan, self._config.landing, fixed)
            if moved is None or not moved.motion.feasible or not keeps_margins(moved, plan):
                return None
            wrong = np.flatnonzero(screen.codes(moved.sequence) | screen.reach_codes(moved))
            if not len(wrong):
                return (moved, plan_cost(moved, self._cost)) if allowed(moved.sequence) else None
            fixed |= {index for item in wrong.tolist() for index in (item - 1, item) if index >= 0}
        return None


def _arrives(sequence: ContactSequence, base: MotionPlan) -> bool:
    """Whether a sequence ends where plans may end, or no farther from the goal than a given plan."""
    goal = base.world.goal

    def distance(each: ContactSequence) -> float:
        return float(np.hypot(*(each.stances[-1].mean_feet.position - goal.position)[:2]))

    return distance(sequence) <= max(arrival_radius(goal), distance(base.sequence))
