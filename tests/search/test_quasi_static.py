import numpy as np
import pytest

from tests.search.worlds import FLOOR, box, corridor, make_world
from toolkit.centroidal.balance import statically_balanced
from toolkit.contacts.sequence import ContactTransition
from toolkit.errors import PlanningError
from toolkit.geometry.limb import Limb
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner import PlannerConfig
from toolkit.search.quasi_static import QuasiStaticEvaluator, quasi_static_planner

QUICK = PlannerConfig(search=AnaStarConfig(max_expansions=120))


def slope(degrees, friction):
    """Level, slope downwards of 1.2 m, level."""
    angle = np.radians(degrees)
    length, drop = 1.2 * np.cos(angle), 1.2 * np.sin(angle)
    middle = [0.5 + length / 2 - 0.05 * np.sin(angle), 0, -drop / 2 - 0.05 * np.cos(angle)]
    return make_world(
        box([0, 0, -0.05], [0.5, 0.5, 0.05], friction=friction),
        box(middle, [0.6, 0.5, 0.05], [0, degrees, 0], friction=friction),
        box([1.0 + length, 0, -drop - 0.05], [0.5, 0.5, 0.05], friction=friction),
        goal=(1.0 + length, 0, -drop),
    )


def test_every_stance_of_a_plan_is_balanced(robot):
    world = corridor(4)
    result = quasi_static_planner(robot, world, QUICK).search(np.random.default_rng(0), 600.0)
    last = result.solutions[-1]
    stances = last.sequence.stances
    for before, after, transition, com in zip(
        stances[:-1], stances[1:], last.sequence.transitions, last.com[1:], strict=True
    ):
        support = transition.during_swing(before)
        assert statically_balanced(robot, support, com).balanced
        assert statically_balanced(robot, after.contacts, com).balanced
        assert statically_balanced(robot, support).balanced
    assert (last.com_velocity == 0).all() and (last.objective == 0).all()
    moves = sum(
        np.linalg.norm((b.mean_feet.position - a.mean_feet.position)[:2]) + 3.0
        for a, b in zip(stances[:-1], stances[1:], strict=True)
    )
    assert moves <= last.cost <= moves + 5.0 * 0.5  # dynamics cost nothing; the rest is the final stagger


def test_a_gentle_slope_has_a_plan_and_a_steep_one_says_why_not(robot):
    assert quasi_static_planner(robot, slope(15, 0.5), QUICK).search(np.random.default_rng(0), 600.0).solutions
    with pytest.raises(PlanningError, match=r"steeper than its friction angle .*30 deg, friction 0\.5 holds 26\.6 deg"):
        quasi_static_planner(robot, slope(30, 0.5), QUICK).search(np.random.default_rng(0), 600.0)


def test_long_strides_are_not_quasi_static(robot):
    world = make_world(FLOOR, goal=(2.0, 0, 0))
    planner = quasi_static_planner(robot, world, QUICK)
    stance = planner.ground.start_stance()
    evaluator = QuasiStaticEvaluator(robot)

    def judged(x):
        contact = stance[Limb.LEFT_FOOT]
        pose = type(contact.pose)(contact.pose.rotation, contact.pose.position + [x, 0, 0])
        moved = ContactTransition(Limb.LEFT_FOOT, type(contact)(contact.limb, pose, contact.friction, contact.surface))
        com = stance.mean_feet.position + [0, 0, robot.com_height]
        return evaluator.evaluate(stance, com, np.zeros(3), [moved]).feasible[0]

    assert judged(0.0) and judged(0.2) and not judged(0.9)


def test_a_palm_holds_the_robot_where_a_foot_cannot(robot):
    """The linear program decides where feet are beyond their friction angle."""
    evaluator = QuasiStaticEvaluator(robot)
    world = slope(30, 0.5)
    on_slope = [surface for surface in world.surfaces if surface.serves_foot and surface.normal[2] < 0.9][0]
    planner = quasi_static_planner(robot, make_world(FLOOR), QUICK)
    stance = planner.ground.start_stance()
    tilted = [
        type(stance[limb])(
            limb, type(on_slope.pose)(on_slope.pose.rotation, stance[limb].pose.position), 0.5, on_slope.index
        )
        for limb in (Limb.LEFT_FOOT, Limb.RIGHT_FOOT)
    ]
    com = np.array([0, 0, robot.com_height])
    stance = type(stance)(tuple(tilted))
    step = ContactTransition(Limb.LEFT_FOOT, tilted[0])
    assert not evaluator.evaluate(stance, com, np.zeros(3), [step]).feasible[0]
