"""Building problems: steps, contacts, headings, bounds, and refusals."""

import numpy as np
import pytest

from toolkit.centroidal.build import ProblemConfig, initial_com, sequence_problem, transition_problem
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact
from toolkit.errors import InputError
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose, rotation_about_z
from toolkit.world.timing import Timing


def step(yaw=0.4, timing=None):
    contact = Contact(Limb.LEFT_FOOT, Pose.from_yaw(np.array([0.3, 0.1, 0.05]), yaw), 0.7)
    return ContactTransition(Limb.LEFT_FOOT, contact, timing or Timing(0.5, 1.0))


def test_a_transition_has_five_steps_of_shift_and_of_swing(robot, feet):
    problem = transition_problem(robot, feet, initial_com(robot, feet), np.zeros(3), step())
    np.testing.assert_allclose(problem.dt, [0.1] * 5 + [0.2] * 5, rtol=1e-12)  # one division
    assert problem.active[:5, :2].all() and not problem.active[5:, 0].any() and problem.active[5:, 1].all()
    assert not problem.active[:, 2:].any()
    assert problem.landing_limb == Limb.LEFT_FOOT
    np.testing.assert_array_equal(problem.landing_position, [0.3, 0.1, 0.05])


def test_the_heading_turns_with_the_foot(robot, feet):
    problem = transition_problem(robot, feet, initial_com(robot, feet), np.zeros(3), step(yaw=0.4))
    np.testing.assert_allclose(problem.yaw[:6], 0.0, atol=1e-12)
    np.testing.assert_allclose(problem.yaw[-1], 0.2, rtol=1e-12)
    assert (np.diff(problem.yaw[5:]) > 0).all()


def test_the_heading_turns_the_short_way_across_pi(robot, feet):
    turned = Pose(rotation_about_z(np.pi - 0.1), np.zeros(3))
    stance = type(feet)(tuple(Contact(c.limb, turned @ c.pose, c.friction) for c in feet.contacts))
    contact = Contact(Limb.LEFT_FOOT, Pose.from_yaw(turned @ np.array([0.2, 0.1, 0.0]), -np.pi + 0.2), 0.5)
    transition = ContactTransition(Limb.LEFT_FOOT, contact)
    problem = transition_problem(robot, stance, initial_com(robot, stance), np.zeros(3), transition)
    assert np.abs(np.diff(problem.yaw)).max() < 0.05


def test_the_final_box_stands_above_the_new_feet(robot, feet):
    config = ProblemConfig(final_half_size=(0.1, 0.2, 0.3), moving_half_size=(0.4, 0.5, 0.6))
    for at_rest, size in ((True, [0.1, 0.2, 0.3]), (False, [0.4, 0.5, 0.6])):
        problem = transition_problem(
            robot, feet, initial_com(robot, feet), np.zeros(3), step(), config=config, final_at_rest=at_rest
        )
        np.testing.assert_allclose(problem.final_center, [0.15, 0.0, 0.025 + robot.com_height], rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(problem.final_half_size, size)


def test_breaking_a_palm_swings_without_it(robot, feet):
    palm = Contact(Limb.LEFT_PALM, Pose(np.eye(3), np.array([0.0, 0.6, 1.3])), 0.5)
    transition = ContactTransition(Limb.LEFT_PALM, None)
    stance = feet.replace(palm)
    problem = transition_problem(robot, stance, initial_com(robot, stance), np.zeros(3), transition)
    assert problem.active[:5, 2].all() and not problem.active[5:, 2].any()
    assert problem.landing_limb == -1


def test_normal_forces_are_bounded_by_the_weight(robot, feet):
    problem = transition_problem(robot, feet, initial_com(robot, feet), np.zeros(3), step())
    np.testing.assert_allclose(problem.max_normal_force, 3 * robot.mass * 9.81, rtol=1e-12)


def test_a_schedule_gets_more_steps_for_long_phases_and_ends_at_rest(robot, feet):
    schedule = ContactSchedule.of(ContactSequence(feet, (step(timing=Timing(0.5, 2.0)),)), final_rest=0.4)
    problem = sequence_problem(robot, schedule, initial_com(robot, feet), np.zeros(3))
    assert problem.steps == 5 + 10 + 5
    assert problem.dt.max() <= 0.2 + 1e-12
    np.testing.assert_allclose(problem.dt.sum(), schedule.duration, rtol=1e-12)
    assert problem.final_at_rest
    np.testing.assert_allclose(problem.position[-1, 0], [0.3, 0.1, 0.05])
    assert problem.friction[-1, 0] == 0.7 and problem.friction[0, 0] == 0.5
    np.testing.assert_allclose(problem.yaw[-1], 0.2, rtol=1e-12)


def test_a_schedule_that_ends_in_the_air_is_refused(robot, feet):
    schedule = ContactSchedule.of(ContactSequence(feet, (step(),)))
    with pytest.raises(InputError, match="final rest"):
        sequence_problem(robot, schedule, initial_com(robot, feet), np.zeros(3))


@pytest.mark.parametrize("velocity", [[np.nan, 0.0, 0.0], [0.0, 30.0, 0.0]])
def test_an_impossible_state_is_refused(robot, feet, velocity):
    with pytest.raises(InputError, match="must be finite"):
        transition_problem(robot, feet, initial_com(robot, feet), np.array(velocity), step())


def test_timing_must_be_positive(robot, feet):
    with pytest.raises(InputError, match="must be positive"):
        transition_problem(robot, feet, initial_com(robot, feet), np.zeros(3), step(timing=Timing(0.0, 1.0)))


def test_a_palm_without_an_arm_is_refused(robot, feet):
    palm = Contact(Limb.LEFT_PALM, Pose(np.eye(3), np.array([0.0, 0.6, 1.3])), 0.5)
    armless = type(robot)(arms={})
    with pytest.raises(InputError, match="left_palm"):
        transition_problem(
            armless, feet, initial_com(robot, feet), np.zeros(3), ContactTransition(Limb.LEFT_PALM, palm)
        )
