"""A robot of another size finds, in a world to its scale, what the usual one finds."""

from pathlib import Path

import numpy as np
import pytest

from tests.robot.sizes import SIZES, label, sized_robot
from tests.search.test_narrow import walk_problem
from tests.search.worlds import box
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.robot.scale import USUAL, Scale
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig, EdgeCost, arrival_radius
from toolkit.search.costs.heuristic import EuclideanDistance
from toolkit.search.costs.plan_cost import known_costs
from toolkit.search.ground import Ground
from toolkit.search.moves.body_room import BodyRoom
from toolkit.search.moves.exclusion import Blame
from toolkit.search.moves.limits import drops
from toolkit.search.moves.occupancy import BodyBox
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.search.states.contact_table import ContactTable
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world
from toolkit.world.scaling import scaled
from toolkit.world.timing import Timing
from toolkit.world.world import Goal

TIMING = Timing(0.6, 0.8)
GROUND = box([1, 0, -0.5], [2, 1, 0.5])


@pytest.fixture(params=SIZES, ids=label, scope="module")
def size(request):
    return request.param


@pytest.fixture(scope="module")
def sized(size, tmp_path_factory):
    return sized_robot(tmp_path_factory.mktemp("sized"), size)


def text(*geoms, goal=(1.5, 0.2, 0)):
    return f"""<mujoco><worldbody><site name="start" pos="0 0 0"/>
      <site name="goal" type="cylinder" pos="{goal[0]} {goal[1]} {goal[2]}" size="0.2 0.01"/>
      {"".join(geoms)}</worldbody></mujoco>"""


def loaded(mjcf, factor):
    return load_world(Path("made.xml"), mjcf=scaled(mjcf, factor))


def slower(timing, factor):
    """The timing of a body that is larger by a factor: that of a pendulum."""
    return Timing(factor**0.5 * timing.shift, factor**0.5 * timing.swing)


def planner_of(robot, mjcf, factor):
    config = PlannerConfig(palms=False, timings=(slower(TIMING, factor),), search=AnaStarConfig(max_expansions=100))
    return ContactPlanner(robot, loaded(mjcf, factor), KinematicEvaluator(robot), config)


def under_bar(robot):
    """Ground below a bar so low that the robot has to bend its knees."""
    height = BodyBox.of(robot).top - 0.4 * drops(robot)[-1]
    return text(GROUND, box([0.8, 0, height + 0.05], [0.3, 2, 0.05]))


WORLDS = {
    "level": lambda robot: text(GROUND),
    "bar": under_bar,
    "stairs": lambda robot: KINDS["stairs"](np.random.default_rng(3)),
}


@pytest.mark.parametrize("world", WORLDS)
def test_searches_find_the_same_plan_to_scale(robot, size, sized, world):
    """Places to a thousandth, as files of worlds have six decimals; costs go with the way, and so with lengths."""
    found = []
    for each, factor in ((robot, 1.0), (sized, size[0])):
        result = planner_of(each, WORLDS[world](robot), factor).search(np.random.default_rng(0), 1e3)
        assert result.solutions, result.reason
        found.append(result)
    usual, other = found
    assert other.expansions == usual.expansions and len(other.solutions) == len(usual.solutions)
    for mine, theirs in zip(usual.solutions, other.solutions, strict=True):
        assert theirs.cost == pytest.approx(size[0] * mine.cost, rel=1e-3)
        assert len(theirs.sequence.transitions) == len(mine.sequence.transitions)
        for a, b in zip(mine.sequence.transitions, theirs.sequence.transitions, strict=True):
            assert b.limb == a.limb and b.timing == slower(a.timing, size[0])
            np.testing.assert_allclose(b.contact.pose.position / size[0], a.contact.pose.position, atol=1e-3)
            np.testing.assert_allclose(b.contact.pose.rotation, a.contact.pose.rotation, atol=1e-3)


def gap(width):
    far = box([0.5 + width + 0.5, 0, -0.5], [0.5, 0.4, 0.5])
    return text(box([0, 0, -0.5], [0.5, 0.4, 0.5]), far, goal=(0.5 + width + 0.5, 0, 0))


def rise(height):
    far = box([1.0, 0, height / 2 - 0.5], [0.5, 0.4, 0.5 + height / 2])
    return text(box([0, 0, -0.5], [0.5, 0.4, 0.5]), far, goal=(1.1, 0, height))


def slot(width):
    ground = box([1, 0, -0.5], [1.3, 0.4, 0.5])
    return text(ground, *[box([1.0, side * (width + 1) / 2, 1.0], [0.2, 0.5, 1.0]) for side in (-1, 1)], goal=(2, 0, 0))


def ceiling(height):
    ground = box([1, 0, -0.5], [1.3, 0.4, 0.5])
    return text(ground, box([1.0, 0, height + 0.05], [0.3, 0.6, 0.05]), goal=(2, 0, 0))


def stones(length):
    """A gap with turned stones, which hold soles of 22 by 13 cm turned as they are themselves, if at all."""
    tops = [box([0.7 + 0.25 * i, 0.1 * (-1) ** i, -0.5], [length / 2, 0.095, 0.5], euler=(0, 0, 37)) for i in range(6)]
    ends = (box([x, 0, -0.5], [0.5, 0.4, 0.5]) for x in (0.0, 2.65))
    return text(*ends, *tops, goal=(2.65, 0, 0))


OBSTACLES = {  # with the words of the proof, and two sizes: the first may leave a way, the second leaves none
    "gap": (gap, "the ground", (0.46, 0.54)),
    "stones": (stones, "too small for a sole", (0.223, 0.195)),
    "rise": (rise, "the ground", (0.45, 0.51)),
    "slot": (slot, "the body", (0.28, 0.22)),
    "ceiling": (ceiling, "the body", (1.32, 1.24)),
}


@pytest.fixture(scope="module")
def proofs():
    """What is proven in the usual world for the usual robot, by obstacle and size."""
    return {}


@pytest.mark.parametrize("kind", OBSTACLES)
def test_the_same_is_proven_to_be_impossible(robot, size, sized, proofs, kind):
    """The obstacles are near the limit on both sides, so that a length that is not to scale would tell."""
    make, words, values = OBSTACLES[kind]
    for value, impossible in zip(values, (False, True), strict=True):
        if (kind, value) not in proofs:
            proofs[kind, value] = proven(robot, make(value), 1.0)
        for reason in (proofs[kind, value], proven(sized, make(value), size[0])):
            assert (reason is not None) == impossible, (value, reason)
            assert reason is None or words in reason


def proven(robot, mjcf, factor):
    """What steps of the table alone cannot pass; None where nothing is proven."""
    ground = Ground(robot, loaded(mjcf, factor), PlannerConfig(drawn=False, palms=False))
    return ground.obstacle(ground.start_stance())


def test_ceilings_and_walls_leave_motions_the_same_room(robot, size, sized):
    body = BodyBox.of(robot)
    low = text(GROUND, box([0.9, 0, body.top - 0.12 + 0.05], [0.4, 2, 0.05]))
    away = body.half_depth + 0.06
    narrow = text(GROUND, *[box([1, side * (away + 0.5), 1.0], [2, 0.5, 1.0]) for side in (-1, 1)])
    for mjcf, yaw, step, steps in ((low, 0.0, 0.2, 6), (narrow, np.pi / 2, 0.0, 2)):
        rooms = []
        for each, factor in ((robot, 1.0), (sized, size[0])):
            problem = walk_problem(each, 0.3 * factor, 0.0, yaw, steps, factor * step, factor**0.5)
            rooms.append(BodyRoom(each, loaded(mjcf, factor)).room(problem))
        usual, other = rooms
        assert usual is not None and other is not None
        np.testing.assert_array_equal(other.knot, usual.knot)
        np.testing.assert_allclose(other.sink, size[0] * usual.sink, atol=2e-6)
        np.testing.assert_allclose(other.bound, size[0] * usual.bound, atol=2e-6)
        np.testing.assert_allclose(other.normal, usual.normal, atol=1e-12)


def sequence_of(factor):
    """Three steps, the second of them on a tilt, scaled with the body."""
    start = Stance(tuple(Contact(limb, Pose(np.eye(3), np.array([0.0, side, 0.0]) * factor), 0.7, 0)
                         for limb, side in zip(FEET, (0.1, -0.1), strict=True)))  # fmt: skip
    places = ((0.3, 0.1, 0.02), (0.6, -0.12, 0.0), (0.65, 0.1, 0.0))
    steps = []
    for index, place in enumerate(places):
        tilt = Pose.from_quaternion(np.zeros(3), np.array([np.cos(0.2), np.sin(0.2) * (index == 1), 0.0, 0.0]))
        pose = Pose(tilt.rotation if index == 1 else np.eye(3), factor * np.array(place))
        steps.append(ContactTransition(Limb(index % 2), Contact(Limb(index % 2), pose, 0.7, 0), slower(TIMING, factor)))
    return ContactSequence(start, tuple(steps))


def test_terms_of_the_cost_go_with_the_length_of_the_way():
    scale, factor = Scale(0.25, 0.1), 0.25
    usual, small = (
        known_costs(sequence_of(each), Goal(each * np.array([0.6, 0.0, 0.0]), each * 0.3), CostConfig(), size).sum()
        for each, size in ((1.0, USUAL), (factor, scale))
    )
    assert small == pytest.approx(factor * usual, rel=1e-12)
    config = CostConfig().scaled(scale)
    assert config.dynamics * scale.time == pytest.approx(factor * CostConfig().dynamics)  # the objective is an integral
    assert CostConfig().scaled(USUAL) == CostConfig()


def test_estimates_of_the_cost_to_go_do_too():
    scale, costs = Scale(0.25, 0.1), []
    for each, mass in ((USUAL, 68.0), (scale, 6.8)):
        goal, timings = Goal(np.zeros(3), each.length * 0.2), (slower(TIMING, each.length),)
        parts = CostConfig(), ContactTable(np.array([0.7]), each.length), timings, goal
        cost = EdgeCost(*parts, EuclideanDistance(goal), each.length * 0.4, mass, each)
        places = each.length * np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [3.0, 0.0, 0.0], [30.0, 0.0, 0.0]])
        costs.append((cost.to_go(places, np.zeros(4)), cost.unit, arrival_radius(goal, each)))
    for usual, small in zip(*costs, strict=True):
        np.testing.assert_allclose(small, scale.length * usual, rtol=1e-12)


def test_a_smaller_robot_blames_smaller_places():
    for factor in (1.0, 0.1):
        blame = Blame(scale=factor)
        blame.add(sequence_of(factor), 0)
        assert blame.exclusions[0].radius == pytest.approx(0.03 * factor)
