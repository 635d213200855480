"""The screens of a search accept what it finds, and reject what it would never propose."""

from dataclasses import replace

import numpy as np
import pytest

from tests.search.worlds import corridor
from toolkit.centroidal.plan import MotionConfig, MotionPlan, plan_motion
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.prediction.kinematic import KinematicConfig, KinematicEvaluator
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.moves.reasons import Reason
from toolkit.search.planner import ContactPlanner
from toolkit.search.planner_config import PlannerConfig
from toolkit.world.timing import Timing


@pytest.fixture(scope="module")
def found(robot):
    """A search in a corridor that likes palms."""
    evaluator = KinematicEvaluator(robot, KinematicConfig(palm_relief=0.3, stride=300.0, spread=50.0))
    config = PlannerConfig(cost=CostConfig(time=0.0), search=AnaStarConfig(epsilon=0.3, max_expansions=200))
    return ContactPlanner(robot, corridor(2), evaluator, config).search(np.random.default_rng(0), 600.0)


@pytest.fixture
def sequence(found):
    return found.solutions[-1].sequence


def moved(contact, x=0.0, y=0.0, z=0.0):
    """The contact at another place."""
    return replace(contact, pose=Pose(contact.pose.rotation, contact.pose.position + [x, y, z]))


def changed(sequence, index, **place):
    """The sequence with the contact of one transition at another place."""
    transitions = list(sequence.transitions)
    transitions[index] = replace(transitions[index], contact=moved(transitions[index].contact, **place))
    return replace(sequence, transitions=tuple(transitions))


def test_whatever_a_search_found_passes(found):
    assert any(stance.palms for solution in found.solutions for stance in solution.sequence.stances)
    for solution in found.solutions:
        codes = found.screen.codes(solution.sequence)
        assert codes.shape == (len(solution.sequence.transitions),) and not codes.any()
        assert found.screen.passes(solution.sequence)


def test_a_limb_may_not_move_twice_in_a_row(found, sequence):
    first = sequence.transitions[0]
    twice = replace(sequence, transitions=(first, *sequence.transitions))
    assert found.screen.codes(twice)[1] == Reason.STILL and not found.screen.passes(twice)
    rest = ContactSequence(sequence.stances[1], sequence.transitions[1:])
    assert found.screen.passes(rest, first.limb)
    assert not found.screen.passes(rest, rest.transitions[0].limb)


def test_steps_that_no_leg_makes_are_rejected(found, sequence):
    index = next(i for i, item in enumerate(sequence.transitions) if item.limb in FEET)
    assert found.screen.codes(changed(sequence, index, x=0.9))[index] != 0
    assert found.screen.codes(changed(sequence, index, z=0.5))[index] == Reason.HIGH
    other = sequence.stances[index][sequence.transitions[index].limb.mirrored]
    away = other.pose.position - sequence.transitions[index].contact.pose.position
    assert found.screen.codes(changed(sequence, index, x=away[0], y=away[1]))[index] == Reason.CLOSE
    hurried = replace(sequence.transitions[index], timing=Timing(0.1, 0.001))
    fast = (*sequence.transitions[:index], hurried, *sequence.transitions[index + 1 :])
    assert found.screen.codes(replace(sequence, transitions=fast))[index] == Reason.FAST


def test_palms_need_a_wall_and_a_contact_to_break(found):
    sequence = next(s.sequence for s in found.solutions if any(stance.palms for stance in s.sequence.stances))
    index = next(i for i, item in enumerate(sequence.transitions) if item.limb not in FEET and item.contact is not None)
    side = 1.0 if sequence.transitions[index].limb.is_left else -1.0
    assert found.screen.codes(changed(sequence, index, y=-0.1 * side))[index] != 0  # in front of the wall
    idle = ContactSequence(sequence.start, (ContactTransition(Limb.LEFT_PALM, None),))
    assert found.screen.codes(idle)[0] == Reason.STILL


def test_no_palm_passes_where_the_search_may_not_use_it(robot, sequence):
    config = PlannerConfig(palms=False, search=AnaStarConfig(max_expansions=20))
    feet = ContactPlanner(robot, corridor(2), KinematicEvaluator(robot), config).search(np.random.default_rng(0), 600.0)
    made = [i for i, item in enumerate(sequence.transitions) if item.limb not in FEET and item.contact is not None]
    assert feet.screen is not None and (feet.screen.codes(sequence)[made] == Reason.NO_WALL).all()


def test_limbs_must_reach_in_the_motion(robot, found):
    evaluator = KinematicEvaluator(robot)
    config = PlannerConfig(palms=False, search=AnaStarConfig(max_expansions=60))
    search = ContactPlanner(robot, corridor(2), evaluator, config).search(np.random.default_rng(0), 600.0)
    sequence = ContactSequence(
        search.solutions[-1].sequence.start, search.solutions[-1].sequence.transitions[:3]
    )  # a short motion is enough
    config = MotionConfig(initial_rest=0.4, final_rest=1.0)
    plan = plan_motion(robot, corridor(2), sequence, config)
    assert plan.motion.feasible and search.screen is not None
    assert not search.screen.reach_codes(plan).any()
    raised = replace(plan.motion, com=plan.motion.com + [0.0, 0.0, 0.3])
    high = MotionPlan(plan.robot, plan.world, plan.sequence, plan.schedule, raised)
    assert search.screen.reach_codes(high).all()


def test_steps_of_a_stance_are_those_of_the_search(found, sequence):
    stance, timing = sequence.start, sequence.transitions[0].timing
    for foot in FEET:
        (numbers,) = found.screen.numbers(ContactSequence(stance, ()))
        steps = [found.screen.table.contact(int(number)) for number in found.screen.steps(numbers, foot, timing)]
        assert len(steps) > 5 and all(step.limb == foot for step in steps)
        made = (ContactTransition(foot, step, timing) for step in steps)
        assert all(found.screen.passes(ContactSequence(stance, (step,))) for step in made)
