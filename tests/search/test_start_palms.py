"""Starts with palms in contact: where the palms are put, what the search does with them, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from tests.search.worlds import FLOOR, box, make_world
from toolkit.centroidal.balance import statically_balanced
from toolkit.errors import InputError, WorldError
from toolkit.geometry.limb import FEET, Limb
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.search.quasi_static import quasi_static_planner

QUICK = PlannerConfig(cost=CostConfig(time=0.0), search=AnaStarConfig(max_expansions=100))
LEFT, RIGHT = Limb.LEFT_PALM, Limb.RIGHT_PALM


def site(limb, x, y, z):
    return f'<site name="start_{limb.label}" pos="{x:.6g} {y:.6g} {z:.6g}"/>'


@pytest.fixture(scope="session")
def place(robot):
    """(3,) m; comfortably in reach of the left palm: half an arm to the side and forwards, below the shoulder."""
    arm = robot.arms[LEFT]
    shoulder = arm.shoulder_in_com + [0.0, 0.0, robot.com_height]
    return shoulder + arm.max_reach * np.array([0.3, 0.6, -0.25])


def walled(place, *geoms, both=False, euler=0.0, **kwargs):
    """A floor, a wall at the left palm's place turned by `euler` degrees about it, and its mirror image."""
    turn = np.radians(euler)
    geoms = [FLOOR, *geoms]
    for limb, sign in ((LEFT, 1.0), (RIGHT, -1.0))[: 2 if both else 1]:
        at = place * [1.0, sign, 1.0]
        behind = 0.05 * np.array([-np.sin(sign * turn), np.cos(sign * turn) * sign, 0.0])
        behind[0] *= sign
        geoms += [box(at + behind, [0.8, 0.05, 0.6], [0, 0, sign * euler], 0.6), site(limb, *at)]
    return make_world(*geoms, **kwargs)


def planner(robot, world, config=QUICK):
    return ContactPlanner(robot, world, KinematicEvaluator(robot), config)


@pytest.mark.parametrize("euler", [0.0, 12.0, -12.0])
def test_palms_lie_whole_on_their_walls(robot, place, euler):
    world = walled(place, both=True, euler=euler)
    stance = planner(robot, world).ground.start_stance()
    assert stance.limbs == (*FEET, LEFT, RIGHT)
    square = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    for limb in (LEFT, RIGHT):
        contact = stance[limb]
        surface = world.surfaces[contact.surface]
        assert surface.serves_palm and contact.friction == surface.friction == 0.6
        np.testing.assert_allclose(contact.pose.normal, surface.normal, atol=1e-9)
        assert contact.pose.normal[1] * (1 if limb.is_left else -1) < -0.9  # out of the wall, to the robot
        corners = np.column_stack([square * robot.half_sizes[limb], np.zeros(4)])
        local = surface.pose.inverse() @ (contact.pose @ corners)
        np.testing.assert_allclose(local[:, 2], 0.0, atol=1e-9)
        low, high = surface.boundary[0].min(0), surface.boundary[0].max(0)  # a rectangle along its axes
        assert (local[:, :2] > low).all() and (local[:, :2] < high).all()
        assert np.linalg.norm(contact.pose.position - world.start_palms[limb]) < 0.12
    mirrored = stance[RIGHT].pose.position * [1, -1, 1]
    np.testing.assert_allclose(stance[LEFT].pose.position, mirrored, atol=0.045)  # two steps of the grid
    assert statically_balanced(robot, stance.contacts).balanced


def test_the_palm_turns_and_moves_with_the_start(robot, place):
    at = planner(robot, walled(place)).ground.start_stance()[LEFT].pose
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    shift = np.array([0.4, -0.3, 0.0])
    wall = box(turn @ (place + [0, 0.05, 0]) + shift, [0.8, 0.05, 0.6], [0, 0, np.degrees(0.7)], 0.6)
    palm = site(LEFT, *(turn @ place + shift))
    world = make_world(FLOOR, wall, palm, start=shift, goal=(1.5, 0.5, 0), heading=np.degrees(0.7))
    moved = planner(robot, world).ground.start_stance()[LEFT].pose
    np.testing.assert_allclose(moved.position, turn @ at.position + shift, atol=2e-3)
    np.testing.assert_allclose(moved.rotation, turn @ at.rotation, atol=1e-6)


@pytest.mark.parametrize("offset", [(0, -0.2, 0), (0, 0.08, 0), (0.03, -0.1, 0.02)])
def test_the_site_need_not_lie_on_the_wall(robot, place, offset):
    """In front of it or inside it: the palm goes to the side that the arm can touch."""
    world = walled(place)
    world = replace(world, start_palms={LEFT: world.start_palms[LEFT] + offset})
    contact = planner(robot, world).ground.start_stance()[LEFT]
    assert contact.pose.position[1] == pytest.approx(place[1], abs=1e-6) and contact.pose.normal[1] < -0.99
    assert np.hypot(*(contact.pose.position - world.start_palms[LEFT])[[0, 2]]) <= 0.1 + 1e-6


def test_a_search_goes_on_from_the_palms(robot, place):
    world = walled(place, both=True, goal=(0.9, 0, 0))
    search = planner(robot, world)
    result = search.search(np.random.default_rng(0), 600.0)
    assert result.solutions
    for solution in result.solutions:
        assert solution.sequence.start.palms == (LEFT, RIGHT)
        np.testing.assert_allclose(solution.com[0], [0, 0, robot.com_height], atol=1e-3)
    alone = search.search(np.random.default_rng(0), 600.0, palms=False)
    for solution in alone.solutions:
        limbs = [item.limb for item in solution.sequence.transitions]
        assert set(limbs[:2]) == {LEFT, RIGHT} and all(limb.is_foot for limb in limbs[2:])
    assert alone.solutions


def test_the_quasi_static_planner_starts_from_palms_too(robot, place):
    world = walled(place, goal=(0.7, 0, 0))
    result = quasi_static_planner(robot, world, QUICK).search(np.random.default_rng(0), 600.0)
    assert result.solutions and result.solutions[-1].sequence.start.palms == (LEFT,)
    for stance in result.solutions[-1].sequence.stances:
        assert statically_balanced(robot, stance.contacts).balanced


def refused(robot, world, message, error: type[InputError] = WorldError, config=QUICK):
    with pytest.raises(error, match=message) as caught:
        planner(robot, world, config).search(np.random.default_rng(0), 1.0)
    assert "\n" not in str(caught.value) and str(caught.value).startswith("made.xml: ")
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    ("offset", "reason"),
    [((0, 1.0, 0), "out of reach"), ((1.2, 0.3, 0), "out of reach"), ((0, 0, -0.8), ""), ((0.0, -0.18, 0), "")],
    ids=["too far aside", "too far ahead", "at the knees", "too near"],
)
def test_an_arm_that_does_not_reach_says_so(robot, place, offset, reason):
    refused(
        robot,
        walled(place + offset),
        f"the left palm cannot start at site 'start_left_palm' .*shoulder at .*: .*{reason}.*; move the site along",
    )


def test_the_wrong_arm(robot, place):
    wall = box(place + [0, 0.05, 0], [0.8, 0.05, 0.6])
    refused(
        robot, make_world(FLOOR, wall, site(RIGHT, *place)), "the right palm cannot start at site 'start_right_palm'"
    )


def test_something_between_the_shoulder_and_the_wall(robot, place):
    plate = box(place - [0, 0.06, 0], [0.3, 0.005, 0.3], [20, 0, 0])
    world = walled(place)
    blocked = walled(place, plate)
    assert planner(robot, world).ground.start_stance().palms == (LEFT,)
    contact = planner(robot, blocked).ground.start_stance()[LEFT]  # on what is in the way: it serves palms, and is near
    assert abs(contact.pose.normal[2]) > 0.1


def test_a_robot_without_the_arm(robot, place):
    legs = replace(robot, arms={}, limbs={limb: robot.limbs[limb] for limb in FEET})
    refused(legs, walled(place), f"asks for a palm that robot {robot.name} does not have; remove the site")


def test_palms_that_are_switched_off(robot, place):
    config = replace(QUICK, palms=False)
    refused(
        robot,
        walled(place),
        "palms are switched off, but .*; leave out --no-palms, or remove the site start_left_palm",
        InputError,
        config,
    )
