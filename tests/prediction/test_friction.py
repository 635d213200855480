"""Where no contact can rest, predicted motions gain the speed that friction cannot take from them."""

import numpy as np
import pytest

from toolkit.centroidal.build import ProblemConfig
from toolkit.centroidal.program import LEAST
from toolkit.centroidal.sequence import SequenceConfig, optimise_transition
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose, rotation_on_surface
from toolkit.prediction.friction import allowed, rests
from toolkit.world.timing import Timing


def on_slope(degrees, x, y, limb, friction=0.5):
    """A foot on a slope that falls towards x."""
    angle = np.radians(degrees)
    normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
    return Contact(limb, Pose(rotation_on_surface(normal, 0.0), np.array([x, y, -x * np.tan(angle)])), friction)


def stance_on(degrees):
    return Stance(tuple(on_slope(degrees, 0.0, y, limb) for limb, y in zip(FEET, (0.1, -0.1), strict=True)))


def test_a_contact_rests_where_the_friction_that_plans_use_holds_it():
    most = np.degrees(np.arctan(LEAST.friction * 0.5))  # where a search begins to call its way sliding
    assert rests(stance_on(most - 0.1)) and not rests(stance_on(most + 0.1))
    assert rests(stance_on(30.0).replace(on_slope(0.0, 0.0, 0.1, Limb.LEFT_FOOT)))


@pytest.mark.parametrize("speed", [0.0, 0.5, 1.5])
def test_a_steep_slope_makes_faster_whatever_is_predicted(speed):
    angle, seconds = np.radians(30.0), np.array([0.3, 0.6])
    velocity = speed * np.array([np.cos(angle), 0.0, -np.sin(angle)])
    com = np.array([0.0, 0.0, 0.9])
    predicted = com + seconds[:, None] * velocity, np.tile(velocity, (2, 1))
    end_com, end_velocity = allowed(stance_on(30.0), com, velocity, seconds, *predicted)
    along = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    least = 9.81 * (np.sin(angle) - 0.5 * np.cos(angle))
    assert ((end_velocity - velocity) @ along >= 0.8 * least * seconds).all()
    assert ((end_com - predicted[0]) @ along >= 0.8 * least * seconds**2 / 2).all()


def test_what_the_optimiser_finds_is_allowed(robot):
    stance = stance_on(30.0)
    com = stance.mean_feet.position + [0.02, 0.0, 0.97 * robot.com_height]
    velocity = np.array([0.6, 0.0, -0.35])
    config = SequenceConfig(problem=ProblemConfig(), body=SequenceConfig().body)
    target = on_slope(30.0, 0.4, 0.1, Limb.LEFT_FOOT)
    transition = ContactTransition(Limb.LEFT_FOOT, target, Timing(0.04, 0.25))
    motion = optimise_transition(robot, stance, com, velocity, transition, config=config)
    assert motion.feasible
    ends = motion.com[-1:], motion.linear_momentum[-1:] / robot.mass
    moved = allowed(stance, com, velocity, np.array([0.29]), *ends)
    # an optimum may go beyond the margin of plans, at a price
    np.testing.assert_allclose(moved[0], ends[0], atol=5e-3)
    np.testing.assert_allclose(moved[1], ends[1], atol=5e-2)
