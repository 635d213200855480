"""A CoM that is out of reach by rounding only is moved within reach; any other is left alone."""

import numpy as np
import pytest

from toolkit.centroidal.body import body_residuals
from toolkit.centroidal.build import ProblemConfig
from toolkit.centroidal.sequence import optimise_transition
from toolkit.contacts.category import Category
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import rotation_about_z
from toolkit.prediction import reach
from toolkit.prediction.optimiser import OptimiserEvaluator
from toolkit.prediction.reach import SLACK, within_reach
from toolkit.robot.loader import load_robot
from validation.random_contacts import SamplingConfig, sample_transition


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


def states(robot, count=20):
    rng = np.random.default_rng(0)
    for _ in range(count):
        yield sample_transition(robot, Category.MOVE_ONE_PALM, rng, SamplingConfig(speed_spread=0.1))


def excess(robot, stance, com):
    """m; most that any limb is out of reach of CoMs (..., 3), by the definition in `CentroidalProblem`."""
    turn = rotation_about_z(stance.mean_feet.yaw)
    worst = np.full(np.shape(com)[:-1], -np.inf)
    for contact in stance.contacts:
        if contact.limb.is_foot:
            leg = robot.legs[contact.limb]
            root, tip, reach = leg.hip_in_com, leg.ankle_in_sole, leg.max_length
        else:
            arm = robot.arms[contact.limb]
            root, tip, reach = arm.shoulder_in_com, np.zeros(3), arm.max_reach
        worst = np.maximum(worst, np.linalg.norm(com + turn @ root - contact.pose @ tip, axis=-1) - reach)
    return worst


def just_out(robot, sample, by):
    """The CoM moved away from the left palm until something is out of reach by `by`; None where it is already."""
    arm = robot.arms[Limb.LEFT_PALM]
    turn = rotation_about_z(sample.stance.mean_feet.yaw)
    away = sample.com + turn @ arm.shoulder_in_com - sample.stance[Limb.LEFT_PALM].pose.position
    places = sample.com + np.linspace(0.0, 0.3, 30_001)[:, None] * away / np.linalg.norm(away)
    first = int(np.argmax(excess(robot, sample.stance, places) >= by))
    return places[first] if first > 0 else None


def test_a_com_within_reach_stays(robot):
    for sample in states(robot):
        if excess(robot, sample.stance, sample.com) <= 0:
            np.testing.assert_array_equal(within_reach(robot, sample.stance, sample.com[None])[0], sample.com)


def test_a_com_just_out_of_reach_is_moved_by_little(robot):
    moved = 0
    for sample in states(robot):
        com = just_out(robot, sample, 0.6 * SLACK)
        if com is None:
            continue
        near = within_reach(robot, sample.stance, com[None])[0]
        if (near == com).all():  # two limbs pull apart: there may be no such place
            continue
        moved += 1
        assert excess(robot, sample.stance, near) <= 0
        assert np.linalg.norm(near - com) < 4 * SLACK  # balls that meet at an angle need more than the violation
        motion = optimise_transition(robot, sample.stance, near, sample.com_velocity, sample.transition)
        limits = body_residuals(motion, robot).violation
        assert max(limits[name][0].max() for name in ("leg length", "CoM height")) <= 1e-9
        assert limits["arm reach"][0, Limb.LEFT_PALM] <= 1e-9  # the other palm may be too near for its arm
    assert moved >= 5


def test_a_com_far_out_of_reach_stays(robot):
    for sample in states(robot, 5):
        com = sample.com + [0.0, 0.0, 0.5]
        np.testing.assert_array_equal(within_reach(robot, sample.stance, com[None])[0], com)


def test_how_far_out_of_reach_a_com_may_be_is_the_slack(robot, monkeypatch):
    sample = next(each for each in states(robot) if just_out(robot, each, 2.0 * SLACK) is not None)
    com = just_out(robot, sample, 2.0 * SLACK)
    near = within_reach(robot, sample.stance, com[None])[0]
    monkeypatch.setattr(reach, "SLACK", 3.0 * SLACK)
    nearer = within_reach(robot, sample.stance, com[None])[0]
    np.testing.assert_array_equal(near, com)
    assert (nearer != com).any() and excess(robot, sample.stance, nearer) <= 0


def test_a_com_too_low_by_rounding_is_raised(robot):
    sample = next(states(robot))
    floor = min(contact.pose.position[2] for contact in sample.stance.contacts[:2])
    floor += ProblemConfig().min_height * robot.com_height
    com = sample.stance.mean_feet.position.copy()
    com[2] = floor - 0.001
    if excess(robot, sample.stance, com) <= 0:
        assert within_reach(robot, sample.stance, com[None])[0, 2] >= floor


def test_the_optimiser_judges_states_rounded_by_the_search(robot):
    """Rounding to 1 mm must not make a state a dead end."""
    judge, tried = OptimiserEvaluator(robot), 0
    for sample in states(robot):
        com = just_out(robot, sample, 1e-4)
        if com is None:
            continue
        before = just_out(robot, sample, -1e-4)
        if before is None or not judge.evaluate(sample.stance, before, 0 * com, [sample.transition]).feasible[0]:
            continue
        tried += 1
        assert judge.evaluate(sample.stance, com, 0 * com, [sample.transition]).feasible[0]
    assert tried >= 3
