"""The solver and Ipopt, given the same program: the same verdict and the same objective."""

import numpy as np
import pytest

from toolkit.centroidal.build import initial_com, sequence_problem, transition_problem
from toolkit.centroidal.program import Program
from toolkit.centroidal.sequence import SequenceConfig, guess, optimise, optimise_transition
from toolkit.contacts.category import Category
from toolkit.contacts.schedule import ContactSchedule
from toolkit.world.timing import Timing
from validation.random_contacts import SamplingConfig, sample_transition, sample_walk
from validation.reference.sequence import solve

CONFIG = SequenceConfig()
WIDE = SamplingConfig(friction=(0.3, 0.9), shift=(0.05, 1.0), swing=(0.3, 1.0))


def reference(robot, problem):
    """Ipopt's motion, from the solver's own guess."""
    program = Program(problem, robot, CONFIG.body, CONFIG.regularisers)
    return solve(program, guess(program))


def compare(robot, items):
    """Shares of transitions on which solver and reference agree: feasibility, objective within 1 %."""
    same, close = [], []
    for item in items:
        given = robot, item.stance, item.com, item.com_velocity, item.transition
        ours, theirs = optimise_transition(*given), reference(robot, transition_problem(*given, config=CONFIG.problem))
        same.append(ours.feasible == theirs.feasible)
        if ours.feasible and theirs.feasible:
            close.append(abs(ours.objective / theirs.objective - 1) < 0.01)
    return np.mean(same), np.mean(close) if close else 1.0


@pytest.mark.parametrize("category", Category)
def test_random_transitions_agree_with_the_reference(robot, category):
    rng = np.random.default_rng([9, category])
    assert compare(robot, [sample_transition(robot, category, rng)]) == (1.0, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("category", Category)
def test_many_random_transitions_agree_with_the_reference(robot, category):
    items = [
        sample_transition(robot, category, np.random.default_rng([10, category, index]), WIDE if index % 2 else None)
        for index in range(300)
    ]
    same, close = compare(robot, items)
    assert same >= 0.99 and close >= 0.95


@pytest.mark.parametrize("contacts, timing", [(10, Timing(0.2, 0.5)), (30, Timing(1.0, 1.0))])
def test_walks_agree_with_the_reference(robot, contacts, timing):
    sequence = sample_walk(robot, contacts, np.random.default_rng(1), timing=timing)
    schedule = ContactSchedule.of(sequence, initial_rest=0.5, final_rest=1.0)
    com, rest = initial_com(robot, sequence.start), np.zeros(3)
    ours = optimise(robot, schedule, com, rest)
    theirs = reference(robot, sequence_problem(robot, schedule, com, rest, config=CONFIG.problem))
    assert ours.feasible and theirs.feasible, (ours.outcome, theirs.outcome)
    np.testing.assert_allclose(ours.objective, theirs.objective, rtol=1e-2)
