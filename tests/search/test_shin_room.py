"""How far shins may lean over their feet: what MuJoCo measures between a capsule and the world, and what it forbids."""

import mujoco
import numpy as np
import pytest

from tests.search.test_narrow import sole, walk_problem
from tests.search.worlds import FLOOR, box, make_world
from tests.shipped_robots import OWN
from toolkit.geometry.limb import FEET
from toolkit.geometry.pose import rotation_on_surface
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.robot.loader import load_robot
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.moves.body_room import BodyRoom
from toolkit.search.moves.candidates import Candidates
from toolkit.search.moves.occupancy import Occupancy
from toolkit.search.moves.reach_check import ReachCheck
from toolkit.search.moves.reasons import Reason
from toolkit.search.moves.shin_room import _CLEAR, _HELP, ShinRoom
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.world.timing import Timing

FOOT = FEET[0]


@pytest.fixture(scope="module")
def robot():
    return load_robot(OWN[0])


def riser(x, height=0.25, euler=(0, 0, 0)):
    """A step whose face is at x m where it is not turned."""
    return box([x + 0.5, 0, height / 2], [0.5, 1.0, height / 2], euler)


def lean_over(robot, geoms, position, rotation):
    world = make_world(FLOOR, *geoms)
    return float(ShinRoom(robot, world).over(FOOT, np.array([position]), rotation[None])[0])


def gap(robot, geoms, position, rotation, lean):
    """Distance in m between the world and a shin that leans by `lean` rad over a sole, as MuJoCo measures it."""
    leg = robot.legs[FOOT]
    ankle = position + rotation @ leg.ankle_in_sole
    knee = ankle + leg.shin * rotation @ [np.sin(lean), 0.0, np.cos(lean)]
    ends = " ".join(f"{value:.9g}" for value in (*ankle, *knee))
    shin = f'<geom name="shin" type="capsule" fromto="{ends}" size="{robot.leg_radii[1]:.9g}"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{''.join(geoms)}{shin}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    last = model.ngeom - 1
    return min(mujoco.mj_geomDistance(model, data, last, geom, 1.0, None) for geom in range(last))


@pytest.mark.parametrize("slope", [0.0, 0.15])
@pytest.mark.parametrize("turn", [0.0, 20.0, -35.0])
@pytest.mark.parametrize("height", [0.18, 0.25, 0.6])
def test_a_shin_that_leans_as_far_as_it_may_just_keeps_clear(robot, slope, turn, height):
    """At the lean that is wanted at most, which the base may exceed by its help."""
    rotation = rotation_on_surface(np.array([-np.sin(slope), 0.0, np.cos(slope)]), 0.0)
    met = []
    for x in np.linspace(-0.3, -0.16, 5):
        geoms, place = [riser(0.0, height, (0, 0, turn))], np.array([x, 0.0, 0.0])
        lean = lean_over(robot, geoms, place, rotation) - _HELP
        if np.isfinite(lean) and lean > 0.0:
            met.append(lean)
            assert gap(robot, geoms, place, rotation, lean) == pytest.approx(_CLEAR, abs=0.004)
    assert len(met) > 2 and (np.diff(met) < 0.0).all()


def test_what_is_behind_beside_or_low_leaves_shins_alone(robot):
    ankle = robot.legs[FOOT].ankle_in_sole[2]
    wide = float(robot.leg_radii[1]) + 2 * _CLEAR
    for geom in (
        riser(-1.3),
        box([0.0, 0.5 + wide, 0.3], [2.0, 0.5, 0.3]),
        riser(0.15, ankle),
        box([0.5, 0, 2.0], [0.4, 1.0, 0.5]),
        riser(0.8),
    ):
        assert lean_over(robot, [geom], np.zeros(3), np.eye(3)) == np.inf


def test_soles_beside_which_nothing_is_high_are_told_from_the_occupied_cells(robot):
    world = make_world(FLOOR, riser(1.0), riser(2.5, 0.05), goal=(4, 0, 0))
    occupancy = Occupancy.of(world.mujoco_model, np.array([-1.0, -1.0, -0.5]), np.array([4.0, 1.0, 2.0]))
    room = ShinRoom(robot, world)
    place = np.column_stack([np.linspace(-0.5, 0.9, 29), np.zeros(29), np.zeros(29)])
    turn = np.tile(np.eye(3), (29, 1, 1))
    beside, leans = room.beside(FOOT, place, occupancy), room.over(FOOT, place, turn)
    assert beside[np.isfinite(leans)].all() and np.isfinite(leans).any() and not beside.all()


def test_problems_know_their_leans(robot):
    """Each contact has the lean of its place for as long as it lasts, and open ground has none."""
    problem = walk_problem(robot, 0.0, steps=4, length=0.25)
    assert BodyRoom(robot, make_world(FLOOR, goal=(5, 0, 0))).leans(problem) is None
    world = make_world(FLOOR, riser(0.95), goal=(5, 0, 0))
    leans, room = BodyRoom(robot, world).leans(problem), ShinRoom(robot, world)
    assert leans is not None and leans.shape == (problem.steps, 2)
    for foot in FEET:
        on = np.flatnonzero(problem.active[:, foot])
        np.testing.assert_array_equal(
            leans[on, foot], room.over(foot, problem.position[on, foot], problem.rotation[on, foot])
        )
        assert np.isinf(leans[~problem.active[:, foot], foot]).all()
    assert np.isfinite(leans).any() and np.isinf(leans[0]).all()


def test_the_search_leaves_out_stances_whose_shins_would_meet_a_riser(robot):
    """With the CoM over its toes, a foot stands on open ground and not before a riser."""
    for geoms, expected in (([], Reason.NONE), ([riser(0.17, 0.3)], Reason.SHANK)):
        world = make_world(FLOOR, *geoms, goal=(0, 0, 0))
        config = PlannerConfig(search=AnaStarConfig(max_expansions=10))
        moves = ContactPlanner(robot, world, KinematicEvaluator(robot), config).ground.moves()
        table, timing = moves.table, Timing(1.0, 1.0)
        left, right = (table.add_contact(sole(robot, limb, 0.0)) for limb in FEET)
        contacts = np.array([[left, right, -1, -1]])
        step = Candidates.of(table, contacts, np.zeros(1, int), contacts, np.zeros(1, int))
        com, still = np.array([0.12, 0.0, 0.9 * robot.com_height]), np.zeros(3)
        check = ReachCheck(moves, (), (timing,))
        assert check.codes(contacts[0], com, still, step, com[None], still[None]).tolist() == [expected]
