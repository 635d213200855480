"""Every rival finds the best plan of a world in which it is known, and the independent checks accept it."""

import itertools
import math

import networkx as nx
import numpy as np
import pytest

from tests.validation.three_surfaces import BEST, three_surfaces, visited
from toolkit.pipeline import make_planner
from toolkit.robot.loader import load_robot
from toolkit.search.anytime.graph import Edge
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.planner_config import PlannerConfig
from validation.rivals.best_first import Limits, a_star
from validation.rivals.contact_graph import contact_graph
from validation.rivals.envelopes import products
from validation.rivals.footsteps import footsteps_of
from validation.rivals.linear import Builder, solution, violation
from validation.rivals.mixed_integer import Model, mixed_program, planned
from validation.rivals.random_tree import random_tree
from validation.rivals.regions import regions_of
from validation.rivals.sl1m import choices, relax
from validation.rivals.solvers import GAP, available, solver_of

SOLVERS = [name for name in available() if name != "Gurobi"]
needs_solvers = pytest.mark.skipif(not SOLVERS, reason="neither highspy nor pyscipopt is installed")
COARSE = Model(step=1.0)


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


@pytest.fixture(scope="module")
def world():
    return three_surfaces()


@pytest.fixture(scope="module")
def planner(robot, world):
    return make_planner(robot, world, "kinematic")


@needs_solvers
@pytest.mark.parametrize("solver", SOLVERS)
def test_the_mixed_integer_program_finds_the_best_plan_of_all_choices(robot, world, planner, solver):
    task = footsteps_of(robot, world, planner, 4)
    mixed = mixed_program(task, COARSE)
    found = solver_of(solver)(mixed.program, 60.0, 1e-6)
    assert found.x is not None and found.gap <= 1e-6
    assert found.first_seconds is not None and found.gap_seconds is not None
    assert 0.0 <= found.first_seconds <= found.gap_seconds
    assert violation(mixed.program, found.x) < 1e-5
    assert violation(mixed.program, found.x + 1e-2) > 1e-3
    assert visited(world, planned(task, mixed, found.x)) == BEST
    # Whatever else the four steps might choose, as 3^4 linear programs: none is cheaper, most are impossible.
    costs = {}
    for choice in itertools.product(range(len(task.regions)), repeat=4):
        low = mixed.program.low.copy()
        low[mixed.chosen[np.arange(4), choice]] = 1.0
        x = solution(mixed.program._replace(low=low))
        if x is not None:
            costs[choice] = mixed.program.cost @ x
    (best,) = costs
    assert [world.surfaces[task.regions[number].surface].geom for number in best] == BEST
    assert found.objective == pytest.approx(costs[best], rel=1e-5)


@needs_solvers
def test_fewer_steps_than_the_way_needs_are_proven_impossible(robot, world, planner):
    mixed = mixed_program(footsteps_of(robot, world, planner, 3), COARSE)
    found = solver_of(SOLVERS[0])(mixed.program, 60.0)
    assert found.x is None and found.first_seconds is None and found.gap == math.inf


def test_envelopes_hold_every_product_and_parts_make_them_tighter():
    rng = np.random.default_rng(0)
    widths = []
    for parts in (1, 3):
        builder = Builder()
        arm, force = builder.variables((1,), -0.4, 0.6), builder.variables((1,), -1.0, 2.0)
        (product,) = products(builder, arm, [force], parts)
        builder.cost(1.0, product)
        program, worst = builder.finished(), 0.0
        for a, f in rng.uniform([-0.4, -1.0], [0.6, 2.0], (20, 2)):
            low, high = program.low.copy(), program.high.copy()
            for at, value in ((arm, a), (force, f)):
                low[at] = high[at] = value
            fixed = program._replace(low=low, high=high)
            ends = [solution(fixed._replace(cost=way * fixed.cost)) for way in (1.0, -1.0)]
            least, most = (float(x[product[0]]) for x in ends if x is not None)
            assert least - 1e-7 <= a * f <= most + 1e-7
            worst = max(worst, most - least)
        widths.append(worst)
    assert widths[1] < 0.6 * widths[0]


def test_regions_hold_whole_soles(robot, world):
    half = robot.half_sizes[0]
    (stone,) = (
        region for region in regions_of(world.surfaces, half, 0.0) if world.surfaces[region.surface].geom == "stone"
    )
    inside = [0.75 - half[0] - 1e-6, 0.5 - half[1] - 1e-6, 0.0]
    assert (stone.sides @ inside <= stone.bounds).all()
    for axis in range(2):
        outside = np.array(inside)
        outside[axis] += 1e-3
        assert (stone.sides @ outside > stone.bounds).any()
    assert not regions_of(world.surfaces, np.array([3.0, 3.0]), 0.0)


def test_sl1m_finds_the_best_plan(robot, world, planner):
    found = relax(footsteps_of(robot, world, planner, 4))
    assert found.sequence is not None, found.reason
    assert visited(world, found.sequence) == BEST
    assert relax(footsteps_of(robot, world, planner, 3)).sequence is None


def test_choices_come_in_the_order_of_their_slacks():
    slacks = np.array([[0.0, 0.3, np.inf], [0.2, 0.1, 0.4], [0.5, 0.5, 0.0]])
    found = list(choices(slacks))
    sums = [slacks[np.arange(3), choice].sum() for choice in found]
    assert sums == sorted(sums)
    assert len({tuple(choice) for choice in found}) == len(found) == 2 * 3 * 3


def test_a_star_and_the_random_tree_find_the_plan(robot, world):
    steps_alone = CostConfig(dynamics=0.0, time=0.0, steep=0.0, stagger=0.0)
    planner = make_planner(robot, world, "kinematic", PlannerConfig(steps=38, drawn=False, cost=steps_alone))
    graph = contact_graph(planner)
    found = a_star(graph.problem, lambda states, payloads: True)
    sequence = graph.sequence(found.states, found.payloads)
    assert visited(world, sequence) == BEST
    assert graph.parts.screen.passes(sequence)
    tree = random_tree(
        graph.problem,
        graph.place,
        graph.box,
        graph.goal,
        lambda states, payloads: True,
        np.random.default_rng(1),
        Limits(),
    )
    walked = graph.sequence(tree.states, tree.payloads)
    assert tree.cost >= found.cost - 1e-9
    assert graph.parts.screen.passes(walked)
    assert set(visited(world, walked)) >= {"stone", "platform_goal"}


class Weighted:
    """A random graph with an inconsistent but admissible heuristic."""

    def __init__(self, rng, nodes=60):
        self.graph = nx.gnp_random_graph(nodes, 0.06, seed=int(rng.integers(1 << 30)), directed=True)
        for a, b in self.graph.edges:
            self.graph[a][b]["weight"] = float(rng.random())
        away = nx.single_source_dijkstra_path_length(self.graph.reverse(), nodes - 1)
        self.least = away.get(0, math.inf)
        self.h = [away.get(node, math.inf) * rng.random() if node in away else math.inf for node in range(nodes)]
        self.goal = nodes - 1

    def start(self):
        return 0

    def expand(self, state, slack):
        return [Edge(other, data["weight"], (state, other)) for other, data in self.graph[state].items()]

    def heuristic(self, states):
        return [self.h[state] for state in states]

    def is_goal(self, states):
        return [state == self.goal for state in states]

    def crowd(self, states):
        return states


@pytest.mark.parametrize("seed", range(10))
def test_a_star_is_optimal_and_the_tree_finds_what_there_is(seed):
    graph = Weighted(np.random.default_rng(seed))
    found = a_star(graph, lambda states, payloads: True)
    place = lambda states: np.array([[state % 8, state // 8] for state in states], float)  # noqa: E731
    box = np.array([[0.0, 0.0], [8.0, 8.0]])
    tree = random_tree(
        graph, place, box, box[1], lambda states, payloads: True, np.random.default_rng(seed), Limits(expansions=1000)
    )
    if graph.least == math.inf:
        assert found.stopped_by == tree.stopped_by == "exhausted" and not found.states and not tree.states
        return
    assert found.cost == pytest.approx(graph.least)
    for path in (found, tree):
        assert (path.states[0], path.states[-1]) == (0, graph.goal)
        assert path.payloads == tuple(zip(path.states, path.states[1:], strict=False))
        assert sum(graph.graph[a][b]["weight"] for a, b in path.payloads) == pytest.approx(path.cost)
    refused = a_star(graph, lambda states, payloads: False)
    assert refused.stopped_by == "exhausted" and refused.cost == math.inf


def test_a_gap_that_is_wanted_is_five_per_cent():
    assert pytest.approx(0.05) == GAP
