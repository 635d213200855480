"""Where floors lie one above the other, a goal is on one of them."""

import numpy as np
import pytest

from toolkit.errors import PlanningError
from toolkit.pipeline.planner import make_planner
from toolkit.report.files import plain
from toolkit.report.standard_entry import _floor
from toolkit.robot.loader import load_robot
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner_config import PlannerConfig

GROUND = '<geom type="box" size="3 2 0.1" pos="0 0 -0.1"/>'
DECK = '<geom type="box" size="0.5 1 0.05" pos="1 0 {}"/>'
STEP = '<geom type="box" size="0.1 1 {0}" pos="0.8 0 {0}"/>'


@pytest.mark.parametrize(
    ("height", "floor"),
    [(0.0, (-np.inf, 0.8)), (0.5, (-np.inf, 0.8)), (1.6, (0.8, 2.4)), (3.2, (2.4, np.inf)), (9.0, (2.4, np.inf))],
)
def test_the_floor_is_the_nearest_to_the_goal(make_world, height, floor):
    world = make_world(GROUND + DECK.format(1.55) + DECK.format(3.15), goal=f"1 0 {height}")
    assert world.goal.floor == pytest.approx(floor)


def test_ground_is_one_floor_where_nothing_lies_far_above_it(make_world):
    for more in ("", STEP.format(0.2), STEP.format(0.2) + DECK.replace("0.5 1", "0.1 1").format(0.75)):
        assert make_world(GROUND + more, goal="0.8 0 1").goal.floor == (-np.inf, np.inf)
    assert make_world(GROUND + DECK.format(1.55), goal="1.9 0 0").goal.floor == (-np.inf, np.inf)  # beside the deck


def test_below_the_goal_s_floor_the_goal_is_not_reached(make_world):
    goal = make_world(GROUND + DECK.format(1.55), goal="1 0 1.6").goal
    places = np.array([[1.0, 0.0, 1.6], [1.1, 0.0, 1.6], [1.0, 0.0, 0.0], [1.0, 3.0, 0.0]])
    np.testing.assert_allclose(goal.distance(places), [0.0, 0.1, goal.radius + 0.8, 3.8])
    np.testing.assert_array_equal(goal.on_floor(places[:, 2]), [True, True, False, False])


def test_nothing_leads_up_to_a_deck_without_stairs(make_world):
    robot = load_robot("humanoid30")
    for height, found in ((0.0, True), (1.6, False)):
        world = make_world(GROUND + DECK.format(1.55), goal=f"1 0 {height}", start="0 0 0")
        planner = make_planner(robot, world, "kinematic", PlannerConfig(search=AnaStarConfig(max_expansions=60)))
        if found:
            result = planner.search(np.random.default_rng(0), 20.0)
            assert result.solutions and result.solutions[0].sequence.stances[-1].mean_feet.position[2] < 0.1
        else:
            with pytest.raises(
                PlanningError, match=r"nothing leads to the goal at \(1, 0, 1.6\): .* a rise higher than"
            ):
                planner.search(np.random.default_rng(0), 20.0)


@pytest.mark.parametrize("floor", [(-np.inf, np.inf), (-np.inf, 0.8), (0.8, 2.4), (2.4, np.inf)])
def test_floors_are_kept_in_the_files_of_a_run(floor):
    assert _floor(plain(floor)) == floor and _floor(None) == (-np.inf, np.inf)
