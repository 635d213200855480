import numpy as np

from tests.search.worlds import FLOOR, box, corridor, make_world
from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.moves import screen
from toolkit.search.moves.reasons import Reason
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.search.states.state import COM, CONTACTS, LAST, VELOCITY, pack, unpack


def reached(robot, world, limb):
    """Positions and headings of all moves of a limb out of the start stance."""
    planner = ContactPlanner(robot, world, KinematicEvaluator(robot))
    stance = planner.ground.start_stance()
    moves = planner.ground.moves()
    table = moves.table
    left, right = (table.add_contact(stance[foot]) for foot in (Limb.LEFT_FOOT, Limb.RIGHT_FOOT))
    found = moves.steps(limb, right if limb.is_left else left) if limb.is_foot else moves.palms(limb, left, right)
    numbers = found.numbers
    return np.column_stack([table.position[numbers], table.rotation[numbers][:, :2, 0]]), found.rejected


def test_mirrored_world_gives_mirrored_moves(robot):
    for limb in Limb:
        one, dropped = reached(robot, corridor(7), limb)
        other, dropped_too = reached(robot, corridor(7, mirrored=True), limb.mirrored)
        assert len(one) > 0
        mirrored = other * [1, -1, 1, 1, -1]
        order, order_too = np.lexsort(np.round(one, 6).T), np.lexsort(np.round(mirrored, 6).T)
        # Contacts are stored once per millimetre; the world's file has six digits.
        np.testing.assert_allclose(one[order], mirrored[order_too], atol=1e-5)
        np.testing.assert_array_equal(dropped, dropped_too)


def test_screens_name_their_reasons(robot):
    flat = make_world(FLOOR)
    steps, rejected = reached(robot, flat, Limb.LEFT_FOOT)
    assert len(steps) > 40 and (steps[:, 1] > -0.1).all()
    far, dropped = reached(robot, make_world(box([0, 0, -0.05], [0.3, 0.4, 0.05]), goal=(0.2, 0, 0)), Limb.LEFT_FOOT)
    assert len(far) < len(steps) and dropped[Reason.NO_SURFACE] > rejected[Reason.NO_SURFACE]
    ledge, dropped = reached(robot, make_world(FLOOR, box([0.55, 0, 0.3], [0.3, 2, 0.3])), Limb.LEFT_FOOT)
    assert dropped[Reason.BODY] + dropped[Reason.NO_SURFACE] + dropped[Reason.LEG_LENGTH] > 0


def test_swings_do_not_cross_the_stance_leg():
    half = np.array([0.11, 0.065]) + 0.01
    stand, old = np.array([0.0, -0.1, 0.0]), np.array([-0.3, 0.1, 0.0])
    new = np.array([[0.3, 0.1, 0.0], [0.3, -0.35, 0.0], [-0.29, 0.1, 0.0], [3.0, 0.1, 0.0]])
    codes = np.empty(4, np.int64)
    turn = np.eye(3)
    feet = screen.Sole(old, turn, 0.0), screen.Sole(stand, turn, 0.0)
    screen.screen_swings(new, np.zeros(4), *feet, half, 2.0, 0.04, 0.1, codes)
    assert codes.tolist() == [0, Reason.CROSSES, Reason.STILL, Reason.FAST]


def test_legs_do_not_pass_through_each_other_where_soles_have_room(robot):
    """A right foot that goes from behind the left one to its left; soles keep apart, but shins do not."""
    moves = ContactPlanner(robot, make_world(FLOOR), KinematicEvaluator(robot)).ground.moves()

    def sole(limb, x, y, yaw):
        return moves.table.add_contact(Contact(limb, Pose.from_yaw(np.array([x, y, 0.0]), yaw), 0, 1.0))

    stand = sole(Limb.LEFT_FOOT, 0.0, 0.0, 0.0)
    crossing = sole(Limb.RIGHT_FOOT, -0.51, 0.21, -0.77), sole(Limb.RIGHT_FOOT, 0.28, 0.2, 0.0)
    passing = sole(Limb.RIGHT_FOOT, -0.35, -0.2, 0.0), sole(Limb.RIGHT_FOOT, 0.35, -0.2, 0.0)
    for (old, new), code in ((crossing, Reason.KNEES), (passing, Reason.NONE)):
        assert moves.swings(Limb.RIGHT_FOOT, np.array([new]), old, stand, 2.0).tolist() == [code]


def test_rectangles_overlap_like_polygons():
    import shapely
    from shapely import affinity

    rng = np.random.default_rng(0)
    half = np.array([0.11, 0.065])
    outline = shapely.box(*-half, *half)
    seen = set()
    for _ in range(500):
        x, y, a, b = *rng.uniform(-0.3, 0.3, 2), *rng.uniform(-3, 3, 2)
        first = affinity.rotate(outline, a, origin=(0, 0), use_radians=True)
        second = affinity.translate(affinity.rotate(outline, b, origin=(0, 0), use_radians=True), x, y)
        if abs(first.distance(second)) < 1e-9 and first.intersection(second).area < 1e-6:
            continue
        expected = first.intersects(second)
        assert screen.rectangles_overlap(0.0, 0.0, a, x, y, b, *half) == expected
        seen.add(expected)
    assert seen == {True, False}


def test_palm_screen(robot):
    surface = np.array([0, 0, 0, 0, -1])
    shoulder, centre = np.array([0, 0.25, 1.3]), np.zeros(3)
    position = np.array([[0, 0.7, 1.3], [0, 1.2, 1.3], [0.4, 0.1, 1.3], [0, 0.7, 1.3], [0, 0.7, 1.3]])
    normal = np.array([[0, -1.0, 0], [0, -1, 0], [-1, 0, 0], [0, 0, 1], [0, -1, 0]])
    codes = screen.screen_palms(surface, position, normal, shoulder, centre, 0.0, 1.0, (0.2, 0.6), 0.15, 0.5)
    assert codes.tolist() == [0, Reason.FAR, Reason.WRONG_SIDE, Reason.FACING, Reason.NO_WALL]


def test_states_pack_and_unpack():
    rng = np.random.default_rng(0)
    contacts, last = rng.integers(-1, 1000, (5, 4)), rng.integers(-1, 4, 5)
    com, velocity = rng.uniform(-30, 30, (5, 3)), rng.uniform(-3, 3, (5, 3))
    states = pack(contacts, last, com, velocity)
    rows = unpack(states)
    assert len(set(states)) == 5 and all(len(state) == 44 for state in states)
    np.testing.assert_array_equal(rows[:, CONTACTS], contacts)
    np.testing.assert_array_equal(rows[:, LAST], last)
    np.testing.assert_allclose(rows[:, COM] / 1000, com, atol=5e-4 + 1e-12)
    np.testing.assert_allclose(rows[:, VELOCITY] / 1000, velocity, atol=5e-4 + 1e-12)
    assert pack(contacts, last, com, velocity) == states
    assert pack(contacts, last, com + 0.002, velocity) != states


def test_cul_de_sac(robot):
    """A U-shaped wall: the straight line leads into it; epsilon and crowding lead out, the grid never in."""
    u = [box([1.1, 0, 1.0], [0.05, 0.75, 1.0]), *[box([0.75, s * 0.75, 1.0], [0.4, 0.05, 1.0]) for s in (-1, 1)]]
    world = make_world(FLOOR, *u, goal=(2.2, 0, 0))

    def first(heuristic, epsilon, crowding):
        search = AnaStarConfig(epsilon=epsilon, crowding=crowding, max_expansions=1200)
        cost = CostConfig(time=0.0)
        config = PlannerConfig(heuristic=heuristic, search=search, drawn=False, palms=False, cost=cost)
        planner = ContactPlanner(robot, world, KinematicEvaluator(robot), config)
        found = []

        def stop(progress):
            if progress.cost < np.inf:
                found.append(progress.expansions)
                raise StopIteration

        try:
            planner.search(np.random.default_rng(0), 600.0, stop)
        except StopIteration:
            return found[0]
        return np.inf

    grid = first("grid", 0.0, 0.0)
    crowded = first("euclidean", 0.1, 0.035)
    plain = first("euclidean", 0.0, 0.0)
    assert grid < crowded < plain
