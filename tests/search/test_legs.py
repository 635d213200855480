import numpy as np
import pytest

from tests.shipped_robots import OWN
from toolkit.geometry.limb import FEET
from toolkit.geometry.pose import rotation_about_z, rotation_on_surface
from toolkit.physics.leg import LIMITS, ReachMargins, leg_clearances
from toolkit.robot.loader import load_robot
from toolkit.search.moves.legs import any_lean, legs_of, reach, stances_violated
from toolkit.search.moves.limits import MOST_CARE, margins
from toolkit.search.moves.reasons import OF_LIMIT, Reason
from toolkit.search.moves.shanks import shanks_of


@pytest.mark.parametrize("name", OWN)
def test_same_verdict_as_the_closed_form(name):
    robot = load_robot(name)
    rng = np.random.default_rng(0)
    n = 3000
    margins = ReachMargins(length=0.01, ankle=0.05, hip=-0.02)
    legs = legs_of(robot, margins)
    seen = set()
    for side, limb in enumerate(FEET):
        com = np.array([0.0, 0.0, robot.com_height]) + rng.uniform(-0.25, 0.15, (n, 3))
        yaw = rng.uniform(-3, 3, n)
        normal = np.column_stack([rng.uniform(-0.4, 0.4, (n, 2)), np.ones(n)])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        rotation = rotation_on_surface(normal, yaw + rng.uniform(-0.8, 0.8, n))
        offset = np.column_stack([rng.uniform(-0.4, 0.4, n), (1 - 2 * side) * rng.uniform(-0.1, 0.4, n), np.zeros(n)])
        position = np.einsum("nij,nj->ni", rotation_about_z(yaw), offset) + [0, 0, 1] * rng.uniform(-0.1, 0.3, (n, 1))
        leg = robot.legs[limb]
        clearances = leg_clearances(leg, com, yaw, position, rotation, margins)
        stacked = np.stack([clearances[limit.name] for limit in LIMITS])
        expected = np.where((stacked < 0).any(0), np.array(OF_LIMIT)[(stacked < 0).argmax(0)], 0)
        got = np.array([reach(legs, side, tuple(com[i]), yaw[i], position[i], rotation[i])[0] for i in range(n)])
        np.testing.assert_array_equal(got, expected)
        seen |= set(got.tolist())
    assert {Reason.NONE, Reason.LEG_LENGTH, Reason.ANKLE_PITCH, Reason.ANKLE_ROLL} <= seen


def test_margins_that_grow_leave_less_of_every_range():
    robot = load_robot(OWN[0])
    ranges = [legs_of(robot, margins(robot, care)).ranges for care in range(MOST_CARE + 1)]
    for less, more in zip(ranges[1:], ranges, strict=False):
        assert (less[..., 0] > more[..., 0]).all() and (less[..., 1] < more[..., 1]).all()


def test_a_lower_com_brings_long_strides_into_reach():
    robot = load_robot(OWN[0])
    legs = legs_of(robot, ReachMargins(ankle=0.0))
    stride = 0.45 * robot.legs[FEET[0]].max_length
    y = robot.legs[FEET[0]].hip_in_com[1]
    left, right = np.array([[stride, y, 0.0]]), np.array([[-stride, -y, 0.0]])
    com, turn = np.array([[0.0, 0.0, robot.com_height]]), np.eye(3)[None]
    shanks = shanks_of(robot)
    high = stances_violated(legs, shanks, com, np.array([0.0]), np.zeros(1), left, turn, right, turn, any_lean(1))
    low = stances_violated(
        legs, shanks, com, np.array([0.0, 0.05, 0.1, 0.15, 0.2]), np.zeros(1), left, turn, right, turn, any_lean(1)
    )
    assert high[0] == Reason.LEG_LENGTH and low[0] == 0


def test_legs_in_each_others_way_are_no_stance():
    robot = load_robot(OWN[0])
    legs, shanks = legs_of(robot, ReachMargins(ankle=0.0, hip=-0.5)), shanks_of(robot)
    legs = legs._replace(toes=np.array([-np.pi, np.pi]))
    com, drop = np.array([[0.0, 0.0, robot.com_height]]), np.array([0.1])

    def verdict(turn, apart):
        left, right = (np.array([[0.0, sign * apart / 2, 0.0]]) for sign in (1, -1))
        turns = [rotation_about_z(np.array([-sign * turn])) for sign in (1, -1)]
        return int(
            stances_violated(legs, shanks, com, drop, np.zeros(1), left, turns[0], right, turns[1], any_lean(1))[0]
        )

    assert verdict(0.0, 0.2) == 0 and verdict(0.5, 0.24) == Reason.KNEES and verdict(0.5, 0.5) == 0


def test_feet_turned_towards_each_other_need_the_yaw_of_both_hips():
    robot = load_robot(OWN[0])
    legs, shanks = legs_of(robot, ReachMargins(ankle=0.0, hip=-0.1)), shanks_of(robot)
    com, drop = np.array([[0.0, 0.0, robot.com_height]]), np.array([0.05])
    most = robot.legs[FEET[1]].ranges["hip_yaw"][1] - robot.legs[FEET[0]].ranges["hip_yaw"][0]

    def verdict(inwards):
        left, right = (np.array([[0.0, sign * 0.2, 0.0]]) for sign in (1, -1))
        turns = [rotation_about_z(np.array([-sign * inwards / 2])) for sign in (1, -1)]
        return int(
            stances_violated(legs, shanks, com, drop, np.zeros(1), left, turns[0], right, turns[1], any_lean(1))[0]
        )

    assert verdict(most - 0.05) == 0 and verdict(most + 0.05) == Reason.HIP_YAW
