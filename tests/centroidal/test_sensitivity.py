"""Derivatives of the least objective are those that the solver's own answers have."""

from dataclasses import replace

import numpy as np
import pytest

from toolkit.centroidal import fast
from toolkit.centroidal.arrays import MotionArrays
from toolkit.centroidal.build import transition_problem
from toolkit.contacts.category import Category
from toolkit.contacts.stance import Stance
from toolkit.robot.loader import load_robot
from toolkit.world.timing import Timing
from validation.random_contacts import SamplingConfig, sample_transition

EXACT = fast.FastConfig(tolerance=1e-9, max_iterations=200)
STEP = 1e-4  # of the differences: the least objective has edges, where constraints come and go


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


def problem_of(robot, case):
    stance, com, velocity, transition = case
    return transition_problem(robot, stance, com, velocity, transition)


def objective(robot, case):
    return fast.solve(problem_of(robot, case), config=EXACT).objective


def moved(contact, axis, step):
    change = step * np.eye(6)[axis]
    return replace(contact, pose=contact.pose.moved(change[:3], change[3:]))


def varied(case, index, step):
    """The case with the thing of one derivative changed; None where it has no such thing."""
    stance, com, velocity, transition = case
    if index < 30:
        row, axis = divmod(index, 6)
        if row == 4:
            if transition.contact is None:
                return None
            return stance, com, velocity, replace(transition, contact=moved(transition.contact, axis, step))
        found = [contact for contact in stance.contacts if contact.limb == row]
        return (stance.replace(moved(found[0], axis, step)), com, velocity, transition) if found else None
    index -= 30
    if index < 6:
        change = step * np.eye(6)[index]
        return stance, com + change[:3], velocity + change[3:], transition
    timing = transition.timing
    if index < 8:
        change = step * np.eye(2)[index - 6]
        new = Timing(timing.shift + change[0], timing.swing + change[1])
        return stance, com, velocity, replace(transition, timing=new)
    *contacts, made = (
        contact and replace(contact, friction=contact.friction + step)
        for contact in (*stance.contacts, transition.contact)
    )
    return Stance(tuple(contacts)), com, velocity, replace(transition, contact=made)


@pytest.mark.parametrize("category", list(Category))
def test_derivatives_are_those_of_the_solutions(robot, category):
    rng, errors = np.random.default_rng(int(category)), []
    config = SamplingConfig(speed_spread=0.3, step_spread=0.8, shift=(0.3, 1.0), swing=(0.4, 1.0), friction=(0.4, 0.8))
    for _ in range(40):
        sample = sample_transition(robot, category, rng, config)
        case = (sample.stance, sample.com, sample.com_velocity, sample.transition)
        if not objective(robot, case) < 1e3:
            continue
        _, found = fast.sensitive_wrenches(problem_of(robot, case))
        found = np.concatenate([found.contacts.ravel(), found.others])
        expected = np.zeros(39)
        for index in range(39):
            pair = [varied(case, index, sign * STEP) for sign in (-1, 1)]
            if pair[0] is not None:
                expected[index] = (objective(robot, pair[1]) - objective(robot, pair[0])) / (2 * STEP)
        if np.isfinite(expected).all():
            errors.append(np.linalg.norm(found - expected) / np.linalg.norm(expected))
        if len(errors) == 3:
            break
    # The solver's own tolerance of 1e-4 leaves 1e-3; edges of the objective may spoil one of three differences.
    assert len(errors) == 3
    assert np.median(errors) < 5e-3


def test_an_exact_solution_has_exact_derivatives(robot):
    sample = sample_transition(robot, Category.ADD_PALM, np.random.default_rng(1), SamplingConfig(speed_spread=0.1))
    case = (sample.stance, sample.com, sample.com_velocity, sample.transition)
    motion, found = fast.sensitive_wrenches(problem_of(robot, case), config=EXACT)
    pairs = [[objective(robot, varied(case, 30 + axis, sign * STEP)) for sign in (-1, 1)] for axis in range(9)]
    expected = np.diff(pairs)[:, 0] / (2 * STEP)
    np.testing.assert_allclose(found.others, expected, rtol=1e-3, atol=1e-3 * np.linalg.norm(expected))
    np.testing.assert_array_equal(found.contacts[2:4][~np.isin([2, 3], sample.stance.limbs)], 0.0)
    solved = MotionArrays.of(fast.solve(problem_of(robot, case), config=EXACT))
    for one, other in zip(motion, solved, strict=True):
        np.testing.assert_array_equal(one, other)


def test_what_is_infeasible_has_no_derivatives(robot):
    sample = sample_transition(robot, Category.MOVE_FOOT, np.random.default_rng(2))
    problem = transition_problem(robot, sample.stance, sample.com, np.array([9.0, 0.0, 0.0]), sample.transition)
    assert fast.sensitive_wrenches(problem) is None
