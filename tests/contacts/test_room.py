"""Room of landing points: inside the surface, apart from the other sole, and what becomes of the sequence."""

import numpy as np
import pytest
import shapely

from tests.shipped_robots import OWN
from toolkit.contacts.room import RoomConfig, landing_room, moved_sequence
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.loader import load_robot
from toolkit.world.surface import Surface
from toolkit.world.world import Goal


@pytest.fixture(scope="module", params=OWN)
def robot(request):
    return load_robot(request.param)


def square(size):
    ring = size / 2 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    return Surface(0, "tile", Pose.identity(), (ring,), (ring,), 0.5, True, False)


def step(robot, x, y, size=1.0, surface=0):
    """A left foot that steps to (x, y) beside a right one at (0, -0.12)."""
    width = robot.half_sizes[0, 1]
    contacts = [
        Contact(limb, Pose.from_yaw(np.array([0.0, side * 2 * width, 0.0]), 0.0), 0.5, 0)
        for limb, side in zip(FEET, (1, -1), strict=True)
    ]
    landing = Contact(Limb.LEFT_FOOT, Pose.from_yaw(np.array([x, y, 0.0]), 0.0), 0.5, surface)
    return ContactSequence(Stance(tuple(contacts)), (ContactTransition(Limb.LEFT_FOOT, landing),)), [square(size)]


def test_room_is_the_reach_in_the_open(robot):
    sequence, surfaces = step(robot, 0.1, 4 * robot.half_sizes[0, 1], size=4.0)
    config = RoomConfig()
    (room,) = landing_room(robot, surfaces, sequence, config)
    np.testing.assert_allclose(room, np.outer([-1.0, 1.0], config.reach), atol=1e-12)


def test_soles_stay_on_the_surface_anywhere_in_the_room(robot):
    half = robot.half_sizes[0]
    edge = 0.5 - half[0] - 0.035  # 3.5 cm from the edge ahead
    sequence, surfaces = step(robot, edge, 0.5 - half[1] - 0.02, size=1.0)
    (room,) = landing_room(robot, surfaces, sequence)
    assert 0.01 < room[1, 0] <= 0.035 and room[0, 0] < -0.05
    region = shapely.Polygon(surfaces[0].boundary[0])
    contact = sequence.transitions[0].contact
    assert contact is not None
    x, y = contact.pose.position[:2]
    for dx in room[:, 0]:
        for dy in room[:, 1]:
            sole = shapely.box(x + dx - half[0], y + dy - half[1], x + dx + half[0], y + dy + half[1])
            assert region.covers(sole)


def test_soles_stay_apart_though_both_may_move(robot):
    half = robot.half_sizes[0]
    config = RoomConfig()
    sequence, surfaces = step(robot, 0.6, -2 * half[1] + 2 * half[1] + config.gap + 0.02, size=4.0)
    (room,) = landing_room(robot, surfaces, sequence, config)
    assert room[0, 1] == pytest.approx(-0.01, abs=1e-9)  # half of the 2 cm beyond the gap


def test_contacts_without_a_surface_and_soles_beyond_the_edge_do_not_move(robot):
    sequence, surfaces = step(robot, 0.1, 0.3, surface=-1)
    assert not landing_room(robot, surfaces, sequence).any()
    sequence, surfaces = step(robot, 0.5, 0.3, size=1.0)
    assert not landing_room(robot, surfaces, sequence).any()


def test_a_moved_sequence_has_its_contacts_where_the_motion_has_them(robot):
    sequence, _ = step(robot, 0.1, 0.3)
    schedule = ContactSchedule.of(sequence, final_rest=1.0)
    times = np.array([0.0, 1.0, 2.0, 3.0])
    position = np.zeros((3, 4, 3))
    position[2, Limb.LEFT_FOOT] = [0.15, 0.31, 0.0]
    moved = moved_sequence(sequence, schedule, times, position)
    contact = moved.transitions[0].contact
    assert contact is not None
    np.testing.assert_array_equal(contact.pose.position, [0.15, 0.31, 0.0])
    assert contact.surface == 0 and moved.start is sequence.start
    assert moved.transitions[0].timing == sequence.transitions[0].timing


def test_the_mean_of_the_last_feet_stays_at_the_goal(robot):
    sequence, surfaces = step(robot, 0.1, 4 * robot.half_sizes[0, 1], size=4.0)
    centre = sequence.stances[-1].mean_feet.position
    goal = Goal(centre - [0.1, 0.0, 0.0], 0.2)
    config = RoomConfig()
    (room,) = landing_room(robot, surfaces, sequence, config, goal)
    assert room[0, 0] == -config.reach[0]  # towards the middle of the goal
    assert 0.05 < room[1, 0] < 0.2 - config.arrival - 0.1 + 1e-9
    (room,) = landing_room(robot, surfaces, sequence, config, Goal(centre - [0.195, 0.0, 0.0], 0.2))
    assert room[1, 0] < 1e-6  # planned closer to the edge than wanted: no farther


def test_feet_land_only_where_they_touch_nothing_beside_their_soles(robot):
    """Something stands 5 cm ahead of where a foot may land, and nothing of the room leads there."""
    sequence, surfaces = step(robot, 0.1, 4 * robot.half_sizes[0, 1], size=4.0)
    (room,) = landing_room(
        robot, surfaces, sequence, hits=lambda position, rotation: position[:, 0] > 0.1 + 0.05 + 1e-9
    )
    np.testing.assert_allclose(room[:, 0], [-RoomConfig().reach[0], 0.05], atol=1e-9)
    (room,) = landing_room(robot, surfaces, sequence, hits=lambda position, rotation: np.ones(len(position), bool))
    assert not room.any()
