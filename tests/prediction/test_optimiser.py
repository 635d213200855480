"""The evaluator that solves every transition: same answers as the solver, in the evaluator's terms."""

import numpy as np
import pytest

from tests.conftest import sole
from toolkit.centroidal.build import initial_com
from toolkit.centroidal.sequence import optimise_transition
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.geometry.limb import Limb
from toolkit.prediction.optimiser import OptimiserEvaluator


@pytest.fixture
def stance(robot):
    return Stance((sole(robot, Limb.LEFT_FOOT), sole(robot, Limb.RIGHT_FOOT)))


def test_transitions_are_judged_in_order(robot, stance):
    com, velocity = initial_com(robot, stance), np.array([0.1, 0.0, 0.0])
    transitions = [ContactTransition(Limb.LEFT_FOOT, sole(robot, Limb.LEFT_FOOT, x)) for x in (0.2, 1.6, 0.3)]
    batch = OptimiserEvaluator(robot).evaluate(stance, com, velocity, transitions)
    np.testing.assert_array_equal(batch.feasible, [True, False, True])
    assert batch.objective[1] == np.inf
    motion = optimise_transition(robot, stance, com, velocity, transitions[2])
    np.testing.assert_allclose(batch.objective[2], motion.objective, rtol=1e-12)
    np.testing.assert_allclose(batch.com[2], motion.com[-1], rtol=1e-12)
    np.testing.assert_allclose(batch.com_velocity[2], motion.linear_momentum[-1] / robot.mass, atol=1e-12)


def test_no_transitions_are_no_work(robot, stance):
    batch = OptimiserEvaluator(robot).evaluate(stance, initial_com(robot, stance), np.zeros(3), [])
    assert batch.feasible.shape == (0,) and batch.com.shape == (0, 3)
