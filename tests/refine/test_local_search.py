"""The local search finds truly cheaper plans within its budget and limits, and leaves nothing to leave out."""

from dataclasses import replace

import numpy as np
import pytest

from tests.refine.conftest import steps
from toolkit.centroidal.part import part_motion
from toolkit.centroidal.plan import MotionConfig, keeps_margins, plan_motion, slid
from toolkit.centroidal.problem import Margins
from toolkit.centroidal.sequence import SequenceConfig
from toolkit.contacts.sequence import Change
from toolkit.refine.chains import FootChains
from toolkit.refine.foresight import Foresight, travel
from toolkit.refine.local_search import LocalSearch, RefineConfig, arrives
from toolkit.refine.variants import left_out, relinked, swapped
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.costs.plan_cost import plan_cost

COST = CostConfig()


class Workshop:
    """What a local search asks for, counted."""

    def __init__(self, walk):
        self._walk, self.sequences, self.slides, self.parts = walk, [], [], []

    def optimise(self, sequence):
        self.sequences.append(sequence)
        config = MotionConfig(initial_rest=0.4, final_rest=0.6)
        return plan_motion(self._walk.robot, self._walk.world, sequence, config)

    def slide(self, plan, landing, share):
        self.slides.append(share.copy())
        return slid(plan, landing, SequenceConfig(), share)

    def part(self, plan, part, first, following):
        self.parts.append(len(part.transitions))
        return part_motion(plan, part, first, following, SequenceConfig())

    def search(self, **settings):
        return LocalSearch(RefineConfig(**settings), COST, self.optimise, self.slide, self.part)


@pytest.fixture(scope="module")
def plan(walk):
    """The walk with its motion."""
    made = Workshop(walk).optimise(walk.sequence)
    assert made.motion.feasible
    return made


def improved(walk, plan, allowed=lambda sequence: True, **settings):
    workshop = Workshop(walk)
    return workshop.search(**settings).improved(plan, walk.sequence, walk.screen, allowed), workshop


@pytest.fixture(scope="module")
def better(walk, plan):
    """What the local search makes of the walk."""
    return improved(walk, plan, optimisations=40)


def total(plan):
    return plan_cost(plan, COST).total


def test_steps_that_are_not_needed_are_found(walk, plan, better):
    found, workshop = better
    assert total(found) < 0.85 * total(plan)
    assert len(found.sequence.transitions) <= len(plan.sequence.transitions) - 3
    assert found.motion.feasible and keeps_margins(found, plan)
    assert walk.screen.passes(found.sequence) and not walk.screen.reach_codes(found).any()
    end, goal = found.sequence.stances[-1].mean_feet.position, walk.world.goal
    assert np.hypot(*(end - goal.position)[:2]) <= goal.radius
    assert len(workshop.sequences) + len(workshop.slides) <= 40
    assert len({sequence.identity for sequence in workshop.sequences}) == len(workshop.sequences)


def test_no_one_and_no_two_contacts_can_be_left_out_for_less(walk, better):
    found, _ = better
    workshop = Workshop(walk)
    for variant in left_out(found.sequence, walk.screen):
        other = workshop.optimise(variant)
        arrives = np.hypot(*(variant.stances[-1].mean_feet.position - walk.world.goal.position)[:2]) <= 0.14
        assert not arrives or total(other) > 0.98 * total(found)


def test_a_walk_that_ends_early_does_not_arrive(walk, plan):
    half = replace(walk.sequence, transitions=walk.sequence.transitions[: len(walk.sequence.transitions) // 2])
    assert arrives(walk.sequence, plan)
    assert not arrives(half, plan)


def test_the_same_plan_gives_the_same_improvement(walk, plan, better):
    again, _ = improved(walk, plan, optimisations=40)
    assert again.sequence.identity == better[0].sequence.identity


def test_a_small_budget_is_kept_and_never_makes_a_plan_worse(walk, plan):
    found, workshop = improved(walk, plan, optimisations=5)
    assert 0 < len(workshop.sequences) + len(workshop.slides) <= 5
    assert total(found) <= total(plan)
    nothing, idle = improved(walk, plan, optimisations=0)
    assert nothing is plan and not idle.sequences and not idle.slides


def test_what_is_not_allowed_is_not_tried(walk, plan):
    found, workshop = improved(walk, plan, allowed=lambda sequence: False, optimisations=20)
    assert found is plan and not workshop.sequences


def test_a_plan_off_its_screens_starts_from_the_sequence_of_the_search(walk, plan):
    first = plan.sequence.transitions[0]
    still = replace(plan.sequence, transitions=(first, *plan.sequence.transitions))
    off = Workshop(walk).optimise(still)
    assert off.motion.feasible and not walk.screen.passes(off.sequence)
    found, workshop = improved(walk, off, optimisations=12)
    assert workshop.sequences[0] is walk.sequence
    assert walk.screen.passes(found.sequence) and total(found) < total(off)


@pytest.fixture(scope="module")
def long_walk(walk):
    """Thirty steps over 8.7 m, of which few can be left out."""
    sequence = steps(walk.sequence.start, 30, 0.6)
    goal = replace(walk.world.goal, position=np.array([8.7, 0.0, 0.0]))
    return walk._replace(sequence=sequence, world=replace(walk.world, goal=goal))


def test_the_motion_around_a_change_tells_what_it_costs(long_walk):
    workshop = Workshop(long_walk)
    base = workshop.optimise(long_walk.sequence)
    chains, screen = FootChains(long_walk.screen), long_walk.screen
    groups = [*([each] for each in left_out(base.sequence, screen)), *relinked(base.sequence, chains)]
    variants = [next(iter(group), base.sequence) for group in groups][:: len(groups) // 12]
    found = 0
    for variant in variants:
        change = Change.between(base.sequence, variant, RefineConfig().around)
        parts = change.old, change.new
        old, new = (workshop.part(base, part, change.first, change.following) for part in parts)
        assert old.feasible
        other = workshop.optimise(variant).motion
        assert new.feasible == other.feasible
        if other.feasible and variant is not base.sequence:
            more = other.objective - base.motion.objective
            assert new.objective - old.objective == pytest.approx(more, rel=0.05, abs=2e-3 * base.motion.objective)
            found += 1
    assert found > 5


def test_variants_of_long_sequences_need_few_motions_of_the_whole(long_walk):
    start = Workshop(long_walk).optimise(long_walk.sequence)
    found, workshop = improved(long_walk, start, optimisations=30)
    whole, judge = improved(long_walk, start, optimisations=30, around=100)
    assert total(found) == pytest.approx(total(whole), rel=0.005) and total(found) < total(start)
    assert not judge.parts
    assert len(workshop.sequences) < len(judge.sequences) / 3


class Astray:
    """A screen that finds limbs out of reach in the transitions of a motion that some others have too."""

    def __init__(self, screen, transitions):
        self._screen, self._identities = screen, {each.identity for each in transitions}

    def __getattr__(self, name):
        return getattr(self._screen, name)

    def reach_codes(self, plan):
        return np.array([int(each.identity in self._identities) for each in plan.sequence.transitions])


def test_limbs_may_be_out_of_reach_only_where_they_were(walk, plan, better):
    def found(transitions):
        search = Workshop(walk).search(optimisations=40)
        return search.improved(plan, walk.sequence, Astray(walk.screen, transitions), lambda sequence: True)

    known = {each.identity for each in plan.sequence.transitions}
    new = [each for each in better[0].sequence.transitions if each.identity not in known]
    assert new  # landing points were moved, or steps put in
    assert total(found(plan.sequence.transitions[:1])) < 0.9 * total(plan)  # one of the plan's own bars no variant
    assert found(new).sequence.identity != better[0].sequence.identity


def test_a_long_sequence_has_more_motions(walk, plan):
    half = len(plan.sequence.transitions) // 2
    found, workshop = improved(walk, plan, optimisations=5, usual=half)
    assert 5 < len(workshop.sequences) + len(workshop.slides) <= 10
    assert total(found) <= total(plan)


def test_the_guess_of_a_sequence_itself_is_its_cost_and_detours_cost_more(walk, plan):
    cost = plan_cost(plan, COST)
    guess = Foresight(plan.sequence, cost, COST, walk.world.goal)
    assert guess(plan.sequence) == pytest.approx(cost.total, rel=1e-9)
    wide = list(plan.sequence.transitions)
    contact = wide[3].contact
    assert contact is not None
    aside = replace(contact.pose, position=contact.pose.position + [0.0, -0.2, 0.0])
    wide[3] = replace(wide[3], contact=replace(contact, pose=aside))
    detour = replace(plan.sequence, transitions=tuple(wide))
    assert travel(detour) > travel(plan.sequence) and guess(detour) > cost.total


def test_what_variants_share_does_not_change_their_guesses(walk, leaning, plan):
    cost = plan_cost(plan, COST)
    guess = Foresight(plan.sequence, cost, COST, walk.world.goal)
    variants = [*left_out(walk.sequence, walk.screen), *swapped(walk.sequence, walk.screen), leaning]
    assert len(variants) > 10
    for variant in [*variants, *variants[::-1]]:
        alone = Foresight(plan.sequence, cost, COST, walk.world.goal)(variant)
        assert guess(variant) == pytest.approx(alone, rel=1e-12)


def test_a_plan_slides_within_its_share_of_the_room(walk, plan):
    share = np.ones(len(plan.sequence.transitions))
    share[2:] = 0.0
    moved = slid(plan, RefineConfig().landing, SequenceConfig(), share)
    assert moved is not None and moved.motion.feasible and total(moved) < total(plan)
    ways = [
        np.linalg.norm(new.contact.pose.position - old.contact.pose.position)
        for new, old in zip(moved.sequence.transitions, plan.sequence.transitions, strict=True)
    ]
    assert max(ways[:2]) > 0.01 and max(ways[2:]) == 0.0
    assert [phase.end for phase in moved.schedule.phases] == [phase.end for phase in plan.schedule.phases]
    for phase in moved.schedule.phases:
        stance = moved.sequence.stances[phase.transition]
        assert all(contact in stance.contacts for contact in phase.contacts)
    assert slid(plan, RefineConfig().landing, SequenceConfig(), 0.0 * share) is None


def test_margins_are_kept_but_for_rounding(plan):
    def with_friction(factor):
        margins = Margins(factor, (0.0, 0.0), 1.0)
        return replace(plan, motion=replace(plan.motion, kept=margins))

    assert keeps_margins(with_friction(0.705), with_friction(0.7))
    assert not keeps_margins(with_friction(0.75), with_friction(0.7))
    assert keeps_margins(with_friction(0.7), with_friction(0.9))
