import numpy as np
import pytest

from tests.search.worlds import FLOOR, box, make_world
from tests.shipped_robots import OWN
from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose, rotation_on_surface
from toolkit.physics.leg import ReachMargins, leg_posture
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.robot.loader import load_robot
from toolkit.search.moves.legs import legs_of, reach
from toolkit.search.moves.occupancy import Occupancy
from toolkit.search.moves.reasons import Reason
from toolkit.search.moves.shanks import ball_free, segment_distance, shanks_of
from toolkit.search.planner import ContactPlanner


@pytest.mark.parametrize("name", OWN)
def test_points_and_radii_of_the_legs(name):
    robot = load_robot(name)
    radius = shanks_of(robot).radius
    assert ((radius > 0.01) & (radius < 0.15)).all()
    rng = np.random.default_rng(0)
    legs = legs_of(robot, ReachMargins(ankle=-9.0, hip=-9.0))
    for side, limb in enumerate(FEET):
        for _ in range(50):
            com = np.array([0.0, 0.0, robot.com_height - 0.05]) + rng.uniform(-0.1, 0.05, 3)
            yaw = float(rng.uniform(-3, 3))
            normal = np.array([*rng.uniform(-0.3, 0.3, 2), 1.0])
            turn = rotation_on_surface(normal / np.linalg.norm(normal), yaw)
            place = Pose.from_yaw(np.zeros(3), yaw).rotation @ [0.05, 0.1 - 0.2 * side, 0.0]
            posture = leg_posture(robot.legs[limb], com[None], np.array([yaw]), place[None], turn[None])
            reason, points = reach(legs, side, tuple(com), yaw, place, turn)
            assert reason == 0
            expected = (posture.hip_point, posture.knee_point, posture.ankle_point)
            np.testing.assert_allclose(points, np.array(expected)[..., 0], atol=1e-12)


def test_distance_of_segments_is_the_least_over_all_points():
    rng = np.random.default_rng(1)
    s = np.linspace(0, 1, 201)[:, None]
    for _ in range(200):
        a, b, p, q = rng.uniform(-1, 1, (4, 3))
        first, second = a + s * (b - a), p + s * (q - p)
        sampled = np.linalg.norm(first[:, None] - second, axis=-1).min()
        assert sampled - 0.02 < segment_distance(a, b, p, q) <= sampled + 1e-12  # 0.02: samples lie 0.017 apart at most
    a = np.zeros(3)
    assert segment_distance(a, a, np.ones(3), np.ones(3)) == pytest.approx(np.sqrt(3))


def test_ball_on_the_grid():
    below = np.zeros((4, 4, 5), np.int16)
    below[2, 2, 3:] = 1  # one occupied cell, [0.1, 0.15]^3
    grid = Occupancy(np.zeros(3), 0.05, below)
    assert not ball_free(grid, 0.12, 0.12, 0.12, 0.0)
    assert not ball_free(grid, 0.12, 0.12, 0.08, 0.05)
    assert ball_free(grid, 0.12, 0.12, 0.07, 0.05)
    assert ball_free(grid, 0.12, 0.06, 0.12, 0.05)


def codes(robot, world, poses, standing):
    """Screen codes of left soles (x, y, yaw in degrees) beside a standing right one on level ground."""
    moves = ContactPlanner(robot, world, KinematicEvaluator(robot)).ground.moves()
    stand = Pose.from_yaw(np.array([*standing[:2], 0.0]), np.radians(standing[2]))
    number = moves.table.add_contact(Contact(Limb.RIGHT_FOOT, stand, 0.7, 0))
    poses = np.array(poses, float)
    yaw = np.radians(poses[:, 2])
    rotation = np.array([Pose.from_yaw(np.zeros(3), angle).rotation for angle in yaw])
    position = np.column_stack([poses[:, :2], np.zeros(len(poses))])
    return moves.screen(Limb.LEFT_FOOT, np.zeros(len(poses), int), position, rotation, yaw, number).tolist()


def test_toes_turned_in_bring_the_knees_together(robot):
    world = make_world(FLOOR)
    assert codes(robot, world, [(0, 0.1, 0), (0, 0.1, 25)], (0, -0.1, 0)) == [0, 0]
    assert codes(robot, world, [(0, 0.12, -25), (0, 0.13, -10)], (0, -0.12, 25)) == [Reason.KNEES, 0]


def test_a_beam_beside_the_shin_is_no_place_for_a_leg(robot):
    knee = robot.legs[Limb.LEFT_FOOT].shin
    beam = box([0.05, 0.32, knee * 0.75], [0.3, 0.1, 0.05])  # its near edge 0.22 m to the left, below the knee
    free, hit = (codes(robot, make_world(FLOOR, *geoms), [(0, 0.2, 0)], (0, 0, 0)) for geoms in ((), (beam,)))
    assert free == [0] and hit == [Reason.SHANK]
    far = box([0.05, 0.5, knee * 0.75], [0.3, 0.1, 0.05])
    assert codes(robot, make_world(FLOOR, far), [(0, 0.2, 0)], (0, 0, 0)) == [0]
