"""Strategies own their settings; the edge cost owns its terms and their lower bound."""

from dataclasses import replace

import numpy as np
import pytest

from tests.search.worlds import FLOOR, make_world
from toolkit.contacts.projected import Projected
from toolkit.geometry.limb import Limb
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.delay import Facing
from toolkit.search.costs.edge_cost import CostConfig, EdgeCost, backwards
from toolkit.search.costs.heuristic import EuclideanDistance
from toolkit.search.moves.candidates import Candidates, mean_feet
from toolkit.search.planner_config import PlannerConfig
from toolkit.search.states.contact_table import ContactTable
from toolkit.search.strategies import strategy_of
from toolkit.world.timing import Timing

CONFIG = PlannerConfig(search=AnaStarConfig(max_expansions=100))


class Slow(KinematicEvaluator):
    """A judge that had better be asked about one transition at a time."""

    costly = True


@pytest.fixture
def quick(robot):
    """A judge that answers many questions as fast as one."""
    return KinematicEvaluator(robot)


def test_an_ordinary_search_judges_at_once(quick):
    strategy = strategy_of(CONFIG, quick, 3.0, slides=False, paced=False)
    assert (strategy.judge, strategy.lazy, strategy.haste) == (quick, False, False)
    assert strategy.cost == CONFIG.cost
    assert strategy.search == replace(CONFIG.search, initial_cost=3.0 * CONFIG.acceptable_cost, layer=0.13)


@pytest.mark.parametrize("slides", [False, True])
def test_a_lazy_search_lets_everything_wait_and_may_look_at_more(robot, slides):
    judge = Slow(robot)
    strategy = strategy_of(CONFIG, judge, 0.5, slides=slides, paced=False)
    assert (strategy.judge, strategy.lazy, strategy.haste) == (judge, True, False)
    assert strategy.search.max_expansions == 2000
    assert strategy.search.initial_cost == CONFIG.acceptable_cost
    assert strategy.search.patience == CONFIG.search.patience * (10 if slides else 1)
    assert strategy.cost.steep == (0.0 if slides else CONFIG.cost.steep)


@pytest.mark.parametrize(("limit", "most"), [(100, 1000), (None, None)])
def test_a_sliding_search_waits_for_the_feet_and_ends_when_it_has_settled(quick, limit, most):
    config = replace(CONFIG, search=replace(CONFIG.search, max_expansions=limit))
    strategy = strategy_of(config, quick, 3.0, slides=True, paced=False)
    assert (strategy.judge, strategy.lazy, strategy.haste) == (quick, False, True)
    assert (strategy.search.max_expansions, strategy.search.settled) == (most, limit)
    assert strategy.search.initial_cost == np.inf  # the cost so far would lead back
    assert strategy.cost.steep == 0.0


def test_a_given_first_cost_is_kept(quick):
    config = replace(CONFIG, search=replace(CONFIG.search, initial_cost=7.0))
    assert all(
        strategy_of(config, quick, 3.0, slides=slides, paced=False).search.initial_cost == 7.0
        for slides in (False, True)
    )


@pytest.fixture
def walk():
    """Costs on a floor of friction 0.5 with the goal at x = 1 m, and moves of the left foot from 0 to `x` m."""
    table, goal = ContactTable(np.array([0.5])), make_world(FLOOR, goal=(1.0, 0, 0)).goal
    timings = (Timing(0.5, 0.5), Timing(1.0, 1.0))

    def cost(config):
        return EdgeCost(config, table, timings, goal, EuclideanDistance(goal), 0.4)

    def moves(x, angle=0.0):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        n = len(x)
        right = table.add(Limb.RIGHT_FOOT, Projected(np.zeros(1, int), np.array([[0.9, -0.1, 0]]), np.eye(3)[None]))
        place = np.column_stack([x, np.full(n, 0.1), np.zeros(n)])
        left = table.add(Limb.LEFT_FOOT, Projected(np.zeros(n, int), place, np.tile(turn, (n, 1, 1))))
        after = np.column_stack([left, np.full(n, right[0]), np.full((n, 2), -1)])
        centre, yaw = mean_feet(table, after)
        course = np.where(x < 0.0, np.pi, 0.0)
        return Candidates(np.zeros(n, int), left, after, centre, yaw, np.abs(x) / 2, course, np.arange(n) % 2)

    return cost, moves


def test_the_edge_cost_is_the_sum_of_its_terms(walk):
    cost, moves = walk
    candidates = moves(np.array([0.0, 0.2, 0.8]))
    edges = cost(CostConfig(step=3.0, time=5.0, stagger=10.0)).known(candidates)
    way, time, stagger = np.array([0.0, 0.1, 0.4]), 5.0 * np.array([1.0, 2.0, 1.0]), np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(edges, way + 3.0 + time + stagger, rtol=1e-12)
    tilted, angle = moves(np.array([0.1]), 0.4), np.tan(0.4) / 0.5
    steep = cost(CostConfig(steep=200.0, reserve=0.5)).known(tilted) - cost(CostConfig(steep=0.0)).known(tilted)
    np.testing.assert_allclose(steep, 200.0 * (0.5 / (1.0 - angle) - 1.0), rtol=1e-9)


def test_walking_backwards_has_its_price_and_walking_on_has_none(walk):
    cost, moves = walk
    forth, back = (cost(CostConfig(heading=60.0)).terms(moves(np.array([x]))) for x in (0.2, -0.2))
    assert forth.heading == 0.0 and back.heading == pytest.approx(60.0 * 0.1)
    angle = np.radians([0.0, 44.0, -90.0, 136.0, 180.0, 270.0, 350.0])
    np.testing.assert_allclose(backwards(angle), [0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0], atol=1e-9)


def test_states_wait_that_do_not_face_the_way_ahead():
    goal = make_world(FLOOR, goal=(3.0, 0, 0)).goal
    facing = Facing(EuclideanDistance(goal), 60.0, 100.0)
    centre = np.array([[0.0, 0, 0], [0.0, 0, 0], [0.0, 0, 0], [2.7, 0, 0]])
    ahead, aside, away, near = facing.delay(centre, np.array([0.5, np.pi / 2, np.pi, np.pi]))
    assert 0.0 == ahead < near < aside < away  # near the goal it does not pay to turn
    assert not Facing(EuclideanDistance(goal), 0.0, 100.0).delay(centre, np.full(4, np.pi)).any()


def test_no_edge_costs_less_than_its_bound_and_the_heuristic_falls_no_faster_than_costs_rise(walk):
    cost, moves = walk
    edge, candidates = cost(CostConfig()), moves(np.linspace(0.0, 0.8, 9))
    least = edge.least_of_edge(candidates)
    assert (edge.known(candidates) >= least).all()
    before = edge.to_go(np.array([[0.45, 0.0, 0.0]]), np.zeros(1))
    after = edge.to_go(candidates.centre, candidates.yaw)
    assert (after >= 0.0).all() and (after[~edge.at_goal(candidates.centre)] >= 3.0).all()
    assert (before <= least + after + 1e-9).all()
    assert edge.per_metre == pytest.approx(1.0 + (3.0 + 20.0 * 1.0) / 0.4)
