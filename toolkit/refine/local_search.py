"""LocalSearch: variants of a sequence, tried until none is truly cheaper or the budget is spent."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain
from operator import itemgetter

import numpy as np

from toolkit.centroidal.plan import MotionPlan, keeps_margins
from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.room import RoomConfig
from toolkit.contacts.sequence import Change, ContactSequence, ContactTransition
from toolkit.refine.chains import FootChains
from toolkit.refine.foresight import Foresight
from toolkit.refine.variants import left_out, relinked, swapped, without_palms
from toolkit.search.costs.edge_cost import CostConfig, arrival_radius
from toolkit.search.costs.plan_cost import PlanCost, known_costs, plan_cost
from toolkit.search.sequence_screen import SequenceScreen

Optimise = Callable[[ContactSequence], MotionPlan]
"""The motion of a sequence with its contacts where they are."""
Slide = Callable[[MotionPlan, RoomConfig, np.ndarray], "MotionPlan | None"]
"""A plan with landing points moved, each within a share of its room; see `toolkit.centroidal.plan.slid`."""
PartMotion = Callable[[MotionPlan, ContactSequence, int, "ContactTransition | None"], CentroidalMotion]
"""The motion of a part of a sequence from a plan's state; see `toolkit.centroidal.part.part_motion`."""
Allowed = Callable[[ContactSequence], bool]
"""Whether a sequence may be tried at all."""

_SHARES = (0.4, 0.0)  # parts of their room that landing points get after the screens rejected them once, and twice
_PART = 0.5  # of a sequence; variants whose part around what differs is longer are judged whole
_SLIDE = 1.03  # variants that lack margins but cost at most this much more than is wanted get their contacts moved


@dataclass(frozen=True)
class RefineConfig:
    """Settings of the local search.

    Attributes:
        starts: Number of the truly cheapest sequences from which it starts.
        usual: Transitions of a sequence of the usual length.
        optimisations: Most motions of whole sequences to optimise for each of them, of longer ones more in proportion.
            A quarter is kept to find out in the end whether contacts can be left out.
        batch: Motions that are optimised before the cheapest of them is taken, if it is cheaper than the sequence is.
        gain: Least part of the true cost by which a variant has to be cheaper, of longer sequences that of their usual
            part: a variant differs in a few transitions, however many there are.
        prospect: Variants whose guessed cost is higher than the sequence's by more than this part are not optimised,
            unless they only leave contacts out.
        patience: Most variants of one sequence that are optimised, of longer ones more in proportion, besides those
            that only leave contacts out.
        slides: Most times in a row that landing points are moved.
        landing: How far they move each time.
        around: Transitions on either side of those that differ which show what a variant of a long sequence costs.
    """

    starts: int = 2
    usual: int = 20
    optimisations: int = 60
    batch: int = 6
    gain: float = 0.005
    prospect: float = 0.05
    patience: int = 12
    slides: int = 3
    landing: RoomConfig = field(default_factory=lambda: RoomConfig(reach=(0.15, 0.1)))
    around: int = 6


class LocalSearch:
    """Searches for truly cheaper variants of the sequences of one run.

    Args:
        config: Settings.
        cost: Weights of the true cost.
        optimise: Optimises the motion of a sequence.
        slide: Moves the landing points of a plan.
        part: Optimises a part of a sequence.

    Attributes:
        spent: Number of motions of whole sequences that were optimised so far.
    """

    def __init__(self, config: RefineConfig, cost: CostConfig, optimise: Optimise, slide: Slide, part: PartMotion):
        self._config, self._cost, self._optimise, self._slide, self._part = config, cost, optimise, slide, part
        self._known: dict[bytes, tuple[MotionPlan, PlanCost]] = {}
        self._parts: dict[tuple[bytes, int, int], CentroidalMotion] = {}  # of plans' own sequences
        self._limit = self.spent = 0
        self._longer = 1.0  # how many times as long as usual the sequence is

    def improved(
        self, plan: MotionPlan, origin: ContactSequence, screen: SequenceScreen, allowed: Allowed
    ) -> MotionPlan:
        """The cheapest plan that is found from a plan with a feasible motion; the plan itself where none is cheaper.

        Args:
            plan: The plan.
            origin: Its sequence as the search found it, to start from where the screens reject a landing point to which
                the optimiser moved a foot.
            screen: The screens of that search.
            allowed: Whether a sequence may be tried.
        """
        self._longer = max(1.0, len(plan.sequence.transitions) / self._config.usual)
        most = int(self._longer * self._config.optimisations)
        self._chains = FootChains(screen)
        before, self._limit = self.spent, self.spent + 3 * most // 4
        best = self._searched(plan, origin, screen, allowed)
        self._limit = before + most
        return self._descended(*best, screen, allowed, all_kinds=False)[0] if screen.passes(best[0].sequence) else plan

    def _searched(
        self, plan: MotionPlan, origin: ContactSequence, screen: SequenceScreen, allowed: Allowed
    ) -> tuple[MotionPlan, PlanCost]:
        """The best plan of the search in all kinds of variants."""
        best = first = plan, plan_cost(plan, self._cost)
        if not screen.passes(plan.sequence):
            start = self._judged(origin, plan, screen, np.inf, None) if allowed(origin) else None
            if start is not None and len(_astray(start[0], screen)) <= len(_astray(plan, screen)):
                best = self._slid(*start, screen, allowed) or start
            elif (better := self._best_variant(*best, origin, screen, allowed)) is not None:
                best = better
            else:
                return first
        while True:
            best = self._descended(*best, screen, allowed)
            slid = self._slid(*best, screen, allowed)
            if slid is None:
                return min(first, best, key=lambda each: each[1].total)
            best = slid

    def _descended(
        self, plan: MotionPlan, cost: PlanCost, screen: SequenceScreen, allowed: Allowed, *, all_kinds: bool = True
    ) -> tuple[MotionPlan, PlanCost]:
        """The best of the plan's variants, the best of that one's variants, and so on, as long as they are cheaper.

        They only leave contacts out, unless all kinds of variants are asked for.
        """
        while True:
            better = self._best_variant(plan, cost, plan.sequence, screen, allowed, all_kinds=all_kinds)
            if better is None:
                return plan, cost
            plan, cost = better

    def _best_variant(
        self,
        plan: MotionPlan,
        cost: PlanCost,
        sequence: ContactSequence,
        screen: SequenceScreen,
        allowed: Allowed,
        *,
        all_kinds: bool = True,
    ) -> tuple[MotionPlan, PlanCost] | None:
        """The cheapest of the first variants of a sequence, as soon as one is cheaper than the plan; None: none is."""
        best: tuple[MotionPlan, PlanCost] | None = None
        least, astray, tried = self._less_than(cost), _astray(plan, screen), 0
        for variant in self._variants(sequence, plan, cost, screen, all_kinds=all_kinds):
            if not allowed(variant) or not arrives(variant, plan):
                continue
            if best is not None and tried >= self._config.batch:
                break
            tried += 1
            if not self._promises(variant, plan, cost, least):
                continue
            found = self._judged(variant, plan, screen, least, astray)
            if found is not None and found[1].total < least:
                best, least = found, found[1].total
        return best

    def _less_than(self, cost: PlanCost) -> float:
        """The true cost below which a variant of a sequence with a given one is cheaper."""
        return cost.total * (1.0 - self._config.gain / self._longer)

    def _variants(
        self, sequence: ContactSequence, plan: MotionPlan, cost: PlanCost, screen: SequenceScreen, *, all_kinds: bool
    ) -> Iterator[ContactSequence]:
        """Variants that pass the screens, those that are guessed to be the cheapest first."""
        guess = Foresight(plan.sequence, cost, self._cost, plan.world.goal, plan.robot.scale)
        fewer = {each.identity: each for each in (*without_palms(sequence, screen), *left_out(sequence, screen))}
        swaps = (iter([each]) for each in swapped(sequence, screen))
        groups = chain(relinked(sequence, self._chains), swaps) if all_kinds else ()
        most = cost.total * (1.0 + self._config.prospect)
        others: dict[bytes, tuple[float, ContactSequence]] = {}
        for group in groups:
            best = next(group, sequence)  # those of a group take equally long, and the others travel more
            if best.identity not in fewer and (cost_of_best := guess(best)) <= most:
                others[best.identity] = cost_of_best, best
        others.pop(sequence.identity, None)
        ranked = [*((guess(each), each) for each in fewer.values()), *self._likeliest(sequence, others.values())]
        yield from (each for _, each in sorted(ranked, key=itemgetter(0)))

    def _likeliest(
        self, sequence: ContactSequence, others: Iterable[tuple[float, ContactSequence]]
    ) -> list[tuple[float, ContactSequence]]:
        """Those variants with the least guesses, as many in each stretch of a long sequence."""
        stretches = int(self._longer)
        counts, most = [0] * stretches, int(self._longer * self._config.patience / stretches)
        ranked = []
        for each in sorted(others, key=itemgetter(0)):
            first = Change.between(sequence, each[1], 0).first
            stretch = min(first * stretches // len(sequence.transitions), stretches - 1)
            counts[stretch] += 1
            if counts[stretch] <= most:
                ranked.append(each)
        return ranked

    def _promises(self, variant: ContactSequence, plan: MotionPlan, cost: PlanCost, wanted: float) -> bool:
        """Whether a variant may cost less than is wanted, as far as the motion around what differs tells.

        That is asked only where it is a small part of the sequence, and no motion of the whole is known.
        """
        change = Change.between(plan.sequence, variant, self._config.around)
        if len(change.new.transitions) > _PART * len(variant.transitions) or variant.identity in self._known:
            return True
        key = plan.sequence.identity, change.first, len(change.old.transitions)
        if key not in self._parts:
            self._parts[key] = self._part(plan, change.old, change.first, change.following)
        old, new = self._parts[key], self._part(plan, change.new, change.first, change.following)
        if not (old.feasible and new.feasible):
            return not old.feasible
        goal, scale = plan.world.goal, plan.robot.scale
        known = [known_costs(part, goal, self._cost, scale).sum() for part in (change.old, change.new)]
        more = known[1] - known[0] + self._cost.dynamics * (new.objective - old.objective)
        return cost.total + more < wanted

    def _judged(
        self,
        sequence: ContactSequence,
        base: MotionPlan,
        screen: SequenceScreen,
        wanted: float,
        astray: set[bytes] | None,
    ) -> tuple[MotionPlan, PlanCost] | None:
        """A sequence with its motion and true cost; None where the budget is spent or the motion does not hold.

        The motion has to keep the margins of the base, and limbs may be out of reach only in the `astray` transitions,
        those in which the base's are; None: anywhere. Where it lacks margins, but costs little more than is wanted,
        contacts are moved.
        """
        identity = sequence.identity
        if identity not in self._known:
            if self.spent >= self._limit:
                return None
            self.spent += 1
            plan = self._optimise(sequence)
            self._known[identity] = plan, plan_cost(plan, self._cost)
        plan, cost = self._known[identity]
        if not plan.motion.feasible or (astray is not None and not _astray(plan, screen) <= astray):
            return None
        if keeps_margins(plan, base):
            return plan, cost
        return self._slid_once(plan, base, screen) if cost.total < _SLIDE * wanted else None

    def _slid(
        self, plan: MotionPlan, cost: PlanCost, screen: SequenceScreen, allowed: Allowed
    ) -> tuple[MotionPlan, PlanCost] | None:
        """The plan with its landing points moved as long as that helps; None where it does not."""
        best: tuple[MotionPlan, PlanCost] | None = None
        for _ in range(self._config.slides):
            found = self._slid_once(plan, plan, screen)
            if found is None or found[1].total > self._less_than(cost):
                break
            if not allowed(found[0].sequence):
                break
            best = plan, cost = found
        return best

    def _slid_once(
        self, plan: MotionPlan, base: MotionPlan, screen: SequenceScreen
    ) -> tuple[MotionPlan, PlanCost] | None:
        """The plan with its landing points moved, less or not at all where the screens reject where they went.

        None where the motion does not keep the margins of the base.
        """
        sequence, excused = plan.sequence, screen.reach_codes(plan) > 0
        share = np.ones(len(sequence.transitions))
        for less in (*_SHARES, 0.0):
            if self.spent >= self._limit:
                return None
            self.spent += 1
            moved = self._slide(plan, self._config.landing, share)
            if moved is None or not moved.motion.feasible or not keeps_margins(moved, base):
                return None
            wrong = np.flatnonzero(screen.codes(moved.sequence) | np.where(excused, 0, screen.reach_codes(moved)))
            if not len(wrong):
                return moved, plan_cost(moved, self._cost)
            for index in wrong.tolist():
                share[_contacts_of(sequence, index)] = less
        return None


def _astray(plan: MotionPlan, screen: SequenceScreen) -> set[bytes]:
    """Identities of the transitions, with the stances before them, in which limbs do not reach in a plan's motion."""
    stances, transitions = plan.sequence.stances, plan.sequence.transitions
    return {
        b"|".join((stances[index].identity, transitions[index].identity))
        for index in np.flatnonzero(screen.reach_codes(plan))
    }


def _contacts_of(sequence: ContactSequence, index: int) -> list[int]:
    """The transitions that made the contacts of the stance before a transition, and the transition itself."""
    last = {item.limb: number for number, item in enumerate(sequence.transitions[:index])}
    return [*last.values(), index]


def arrives(sequence: ContactSequence, base: MotionPlan) -> bool:
    """Whether a sequence ends where plans may end, or no farther from the goal than a given plan."""
    goal = base.world.goal

    def distance(each: ContactSequence) -> float:
        return float(goal.distance(each.stances[-1].mean_feet.position))

    return distance(sequence) <= max(arrival_radius(goal, base.robot.scale), distance(base.sequence))
