"""The cost of each transition's interval: never negative, and together the objective of the whole motion."""

from dataclasses import replace

import numpy as np
import pytest

from tests.centroidal.walks import walk
from toolkit.centroidal.build import initial_com
from toolkit.centroidal.intervals import intervals
from toolkit.centroidal.residual import step_costs
from toolkit.centroidal.sequence import optimise
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import InputError

TIMINGS = [(1.0, 1.0), (0.13, 0.41), (0.6, 0.8)]


def walking(robot, timing, steps=4):
    """Schedule and motion of a walk."""
    start, schedule = walk(robot, steps, 0.3, timing)
    motion = optimise(robot, schedule, initial_com(robot, start), np.zeros(3))
    assert motion.feasible
    return schedule, motion


@pytest.mark.parametrize("timing", TIMINGS)
def test_the_costs_of_the_intervals_add_up_to_the_objective(robot, timing):
    schedule, motion = walking(robot, timing)
    found = intervals(motion, schedule)
    assert found.objective.shape == (4,) and (found.objective > 0.0).all()
    np.testing.assert_allclose(found.objective.sum(), motion.objective, rtol=1e-12)
    times = motion.problem.times
    ends = 0.3 + sum(timing) * np.arange(1, 5)
    np.testing.assert_allclose(times[found.knots], [0.0, *ends], atol=1e-9)
    # The rests belong to the first and the last transition.
    costs = step_costs(motion)
    np.testing.assert_allclose(found.objective[0], costs[times[:-1] < ends[0] - 1e-6].sum(), rtol=1e-12)
    np.testing.assert_allclose(found.objective[-1], costs[times[:-1] > ends[-2] - 1e-6].sum(), rtol=1e-12)


@pytest.mark.parametrize("timing", TIMINGS)
def test_the_states_are_those_of_the_motion_at_the_ends_of_swings(robot, timing):
    schedule, motion = walking(robot, timing)
    found = intervals(motion, schedule)
    for row, time in enumerate([0.0, *(phase.end for phase in schedule.phases if phase.swing is not None)]):
        com, velocity, _ = motion.sample(time)
        np.testing.assert_allclose(found.com[row], com, atol=1e-9)
        np.testing.assert_allclose(found.com_velocity[row], velocity, atol=1e-9)


def test_a_step_costs_what_its_own_terms_say(robot):
    """The terms of the linear momentum, written out once more: the others are taken out by their weights."""
    schedule, motion = walking(robot, (0.6, 0.8))
    only = dict.fromkeys(("linear_momentum_rate", "angular_momentum_rate", "torque", "lateral_force", "cop"), 0.0)
    weights = replace(motion.problem.weights, angular_momentum=0.0, force=0.0, **only)
    motion = replace(motion, problem=replace(motion.problem, weights=weights))
    expected = motion.problem.dt / 0.2 * 0.2 * (motion.linear_momentum[1:] ** 2).sum(1)
    np.testing.assert_allclose(step_costs(motion), expected, rtol=1e-12)
    np.testing.assert_allclose(intervals(motion, schedule).objective.sum(), expected.sum(), rtol=1e-12)


def test_an_undefined_motion_has_infinite_costs(robot):
    schedule, motion = walking(robot, (0.6, 0.8))
    broken = replace(motion, yaw_torque=motion.yaw_torque * np.nan)
    assert np.isposinf(intervals(broken, schedule).objective).all()
    short = replace(motion, force=motion.force[:-1])
    assert np.isposinf(intervals(short, schedule).objective).all()


def test_another_schedule_is_refused(robot):
    schedule, motion = walking(robot, (0.6, 0.8))
    for other in (walking(robot, (0.6, 0.7))[0], walking(robot, (0.6, 0.8), steps=3)[0]):
        with pytest.raises(InputError, match="not one of this schedule"):
            intervals(motion, other)
    start, _ = walk(robot, 4, 0.3)
    with pytest.raises(InputError, match="no intervals"):
        intervals(motion, ContactSchedule.of(ContactSequence(start, ()), final_rest=1.0))
