"""Low and narrow places: stances with bent knees, ways to the side, and the room that motions get."""

import numpy as np
import pytest

from tests.search.test_distance import at, terrain
from tests.search.worlds import FLOOR, box, make_world
from toolkit import pipeline
from toolkit.centroidal.build import initial_com, sequence_problem
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.pipeline.config import PipelineConfig
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.moves import body_room
from toolkit.search.moves.body_room import BodyRoom
from toolkit.search.moves.limits import drops
from toolkit.search.moves.occupancy import BodyBox, Occupancy, body_free
from toolkit.search.moves.reasons import Reason
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.world.timing import Timing


def ceiling(height, x=0.0, length=3.0):
    """A ceiling across the way."""
    return box([x, 0, height + 0.05], [length / 2, 2, 0.05])


def slot(width, x, depth):
    """Two walls with an opening, wide enough to leave no way around."""
    return [box([x + depth / 2, side * (width / 2 + 3.0), 1.0], [depth / 2, 3.0, 1.0]) for side in (-1, 1)]


def planner_of(robot, world):
    config = PlannerConfig(search=AnaStarConfig(max_expansions=400))
    return ContactPlanner(robot, world, KinematicEvaluator(robot), config)


def sole(robot: RobotModel, limb, x, y=None, yaw=0.0):
    side = robot.legs[limb].hip_in_com[1]
    return Contact(limb, Pose.from_yaw(np.array([x, side if y is None else y, 0.0]), yaw), 0.7, 0)


def standing(robot, x=0.0):
    return Stance(tuple(sole(robot, limb, x) for limb in FEET))


@pytest.mark.parametrize(("part", "steps"), [(-0.05, True), (0.3, True), (0.7, True), (1.4, False)])
def test_stances_below_a_ceiling_bend_the_knees(robot, part, steps):
    """The ceiling is below the top of the body by this part of what the CoM can sink."""
    height = BodyBox.of(robot).top - part * drops(robot)[-1]
    planner = planner_of(robot, make_world(FLOOR, ceiling(height)))
    moves = planner.ground.moves()
    right = moves.table.add_contact(sole(robot, Limb.RIGHT_FOOT, 0.0))
    found = moves.steps(Limb.LEFT_FOOT, right)
    assert (len(found.numbers) > 0) == steps
    if not steps:
        assert found.rejected[Reason.BODY] > 0


def test_ways_below_a_ceiling_seem_longer(robot):
    height = BodyBox.of(robot).top - 0.5 * drops(robot)[-1]
    low = make_world(FLOOR, ceiling(height, 1.0, 1.0), goal=(2.5, 0, 0))
    free = make_world(FLOOR, goal=(2.5, 0, 0))
    bent, straight = (terrain(robot, world).distance(world.start, 0.4) for world in (low, free))
    assert bent is not None and straight is not None
    assert 1.1 < at(bent, 0.0, 0.0) / at(straight, 0.0, 0.0) < 1.4


@pytest.mark.parametrize("heading", [0.0, 20.0])
def test_a_slot_leads_to_the_goal_sideways(robot, heading):
    """Narrower than the shoulders: the usual grid sees no way, a finer one does, and tells that it takes long."""
    body = BodyBox.of(robot)
    width = body.half_depth + body.half_width - 0.03
    turn = np.radians(heading)
    world = make_world(FLOOR, *slot(width, 0.9, 0.6), goal=(2.4, 0, 0), heading=heading)
    distances = terrain(robot, world)
    found = distances.distance(world.start, 0.4, narrow=True)
    assert found is not None
    straight = 2.4 - world.goal.radius
    assert straight + 0.5 < at(found, 0.0, 0.0, yaw=turn) < straight + 3.0
    assert at(found, 1.2, 0.0, yaw=np.pi / 2) < 2.5
    assert at(found, 1.2, 0.0, yaw=0.0) == np.inf


@pytest.mark.parametrize("depth", [0.1, 0.3])
@pytest.mark.parametrize("wall", [2.0, 0.5], ids=["wide wall", "with ways for the body beside the ground"])
def test_the_way_knows_that_a_door_narrower_than_the_shoulders_is_passed_sideways(robot, depth, wall):
    body = BodyBox.of(robot)
    for width, forward in ((body.half_depth + body.half_width, False), (2 * body.half_width + 0.3, True)):
        door = [box([1.0, side * (width / 2 + wall), 1.0], [depth / 2, wall, 1.0]) for side in (-1, 1)]
        world = make_world(box([1.0, 0, -0.05], [2.5, 0.9, 0.05]), *door, goal=(2.2, 0, 0))
        planner = planner_of(robot, world)
        distance = planner.ground.way(planner.ground.start_stance()).distance
        ahead, sideways = (at(distance, 0.8, 0.0, yaw=yaw) for yaw in (0.0, np.pi / 2))
        assert (ahead > sideways + 0.15) != forward


@pytest.mark.parametrize("turn", [0.0, 20.0, 50.0])
def test_the_way_leads_straight_through_a_door_just_where_the_screens_let_the_body_through(robot, turn):
    """The grid has no other opinion of the body than the screens, wherever their cells lie."""
    shoulders, yaw = 2 * BodyBox.of(robot).half_width, np.radians(turn)
    ahead, aside = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    floor = box(0.6 * ahead - [0, 0, 0.05], [1.5, 1.0, 0.05], [0, 0, turn])
    seen = []
    for width in shoulders + np.array([-0.06, -0.03, -0.01, 0.02, 0.1]):
        walls = (0.95 * ahead + side * (width / 2 + 3.0) * aside + [0, 0, 1.0] for side in (-1, 1))
        door = [box(centre, [0.05, 3.0, 1.0], [0, 0, turn]) for centre in walls]
        world = make_world(floor, *door, goal=1.8 * ahead, heading=turn)
        distances = terrain(robot, world)
        distance = distances.distance(world.start, 0.4, narrow=True)
        assert distance is not None
        fits = any(
            body_free(distances.occupancy, distances.box, *(0.95 * ahead + shift * aside), yaw + heading)
            for shift in np.linspace(-0.05, 0.05, 21)
            for heading in np.radians(np.linspace(-4.0, 4.0, 5))
        )
        forward, sideways = (at(distance, *(0.7 * ahead), yaw=yaw + heading) for heading in (0.0, np.pi / 2))
        assert (forward < sideways) == fits
        seen.append(fits)
    assert any(seen) and not all(seen)


def test_a_body_does_not_pass_through_a_wall_between_two_stances(robot):
    """The stances before and after a long step are free; half-way there is a thin wall above the feet."""
    body = BodyBox.of(robot)
    gap = 2 * body.half_depth + 0.1
    thin = box([gap / 2 + 0.02, 0, 1.3], [0.01, 2, 0.3])
    for geoms, expected in (([FLOOR], Reason.NONE), ([FLOOR, thin], Reason.BODY)):
        moves = planner_of(robot, make_world(*geoms, goal=(3, 0, 0))).ground.moves()
        table = moves.table
        old, new = (table.add_contact(sole(robot, Limb.LEFT_FOOT, x)) for x in (-gap / 2, 3 * gap / 2))
        stand = table.add_contact(sole(robot, Limb.RIGHT_FOOT, gap / 2))
        codes = moves.swings(Limb.LEFT_FOOT, np.array([new]), old, stand, 10.0)
        assert codes.tolist() == [expected]


def walk_problem(robot, x, y=0.0, yaw=0.0, steps=4, length=0.2, pace=1.0):
    """The problem of a few steps from x on, with a heading; y is the middle of the feet, `pace` a factor on times."""

    def contact(limb, along):
        side = robot.legs[limb].hip_in_com[1]
        place = [x + along * np.cos(yaw) - side * np.sin(yaw), y + along * np.sin(yaw) + side * np.cos(yaw), 0.0]
        return Contact(limb, Pose.from_yaw(np.array(place), yaw), 0.7, 0)

    start = Stance(tuple(contact(limb, 0.0) for limb in FEET))
    moves = [(Limb(k % 2), min(k + 1, steps - 1) * length) for k in range(steps)]
    transitions = tuple(
        ContactTransition(limb, contact(limb, along), Timing(pace * 0.6, pace * 0.8)) for limb, along in moves
    )
    schedule = ContactSchedule.of(ContactSequence(start, transitions), initial_rest=pace * 0.3, final_rest=pace * 0.6)
    return sequence_problem(robot, schedule, initial_com(robot, start), np.zeros(3))


def test_open_ground_and_far_walls_leave_all_room(robot):
    problem = walk_problem(robot, 0.0)
    for geoms in ([FLOOR], [FLOOR, box([0.3, 1.2, 1], [3, 0.05, 1]), box([0.3, -1.2, 1], [3, 0.05, 1])]):
        assert BodyRoom(robot, make_world(*geoms, goal=(5, 0, 0))).room(problem) is None


def test_cells_are_made_where_something_is_at_the_height_of_the_body_and_once_for_the_whole_way(robot, monkeypatch):
    made = []

    class Counted(Occupancy):
        @classmethod
        def by(cls, *args):
            made.append(args)
            return Occupancy.by(*args)

    monkeypatch.setattr(body_room, "Occupancy", Counted)
    tile, far = box([1, 0, 0.05], [0.3, 1, 0.05]), box([2, 4, 1], [1, 0.1, 1])
    for geoms, count in (([FLOOR, tile, far], 0), ([FLOOR, *slot(0.9, 1.0, 2.0)], 1)):
        made.clear()
        room = BodyRoom(robot, make_world(*geoms, goal=(5, 0, 0)))
        for x in np.linspace(0.0, 5.0, 6):
            room.sink(standing(robot, x))
            room.room(walk_problem(robot, x))
        assert len(made) == count


def test_a_ceiling_lowers_the_com_where_it_is(robot):
    body = BodyBox.of(robot)
    wanted = 0.12
    room_of = BodyRoom(robot, make_world(FLOOR, ceiling(body.top - wanted, 1.0, 0.8), goal=(5, 0, 0)))
    problem = walk_problem(robot, 0.0, steps=8, length=0.2)
    room = room_of.room(problem)
    assert room is not None
    lowered = room.sink > 0.0
    assert not lowered[0] and lowered.any()
    np.testing.assert_allclose(room.sink[lowered], wanted, atol=0.026)  # the cells of the grid
    assert (room.sink[lowered] >= wanted - 1e-9).all()
    np.testing.assert_allclose(room.bound, robot.com_height - room.sink[room.knot], atol=1e-9)
    assert room_of.sink(standing(robot, 0.0)) == 0.0
    assert wanted <= room_of.sink(standing(robot, 1.0)) < wanted + 0.026


def test_near_walls_hold_the_com_before_and_behind(robot):
    """Sideways between two walls: the CoM keeps its distance from both, and less where knees would hit."""
    body, away = BodyBox.of(robot), 0.06
    world = make_world(FLOOR, *slot(2 * (body.half_depth + away), -3.0, 6.0), start=(-4, 0, 0), goal=(5, 0, 0))
    room = BodyRoom(robot, world).room(walk_problem(robot, 0.0, yaw=np.pi / 2, length=0.0, steps=2))
    assert room is not None and not room.sink.any()
    assert set(np.sign(np.round(room.normal[:, 1])).tolist()) == {-1.0, 1.0}
    np.testing.assert_allclose(room.normal[:, [0, 2]], 0.0, atol=1e-9)
    assert (room.bound <= away + 1e-9).all() and (room.bound > 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("geoms", [[ceiling(1.58, 1.1, 0.8)], slot(0.6, 0.9, 0.8)], ids=["ceiling", "slot"])
def test_plans_lead_through_low_and_narrow_places(robot, geoms):
    """Search, motion and postures: the trunk really is below the ceiling, and between the walls."""
    ground = box([1.2, 0, -0.05], [2.0, 1.0, 0.05])
    world = make_world(ground, *geoms, goal=(2.3, 0, 0), timing="0.6 0.8")
    planner = pipeline.make_planner(robot, world, config=PlannerConfig(search=AnaStarConfig(max_expansions=800)))
    result = pipeline.run(robot, world, planner, PipelineConfig(until="wholebody", time_limit=600.0, candidates=8))
    assert result.passed, result.reason
