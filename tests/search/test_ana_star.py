import gc
import math
import weakref
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest

from toolkit.search.anytime.ana_star import AnaStar, AnaStarConfig, Edge
from toolkit.search.anytime.graph import Fault


class Graph:
    """A random digraph with an admissible, deliberately inconsistent heuristic."""

    def __init__(self, rng, nodes=60, degree=4, consistent=False, goals=2, scale=1.0):
        self.graph = nx.DiGraph()
        self.graph.add_nodes_from(range(nodes))
        for node in range(nodes):
            for other in rng.choice(nodes, degree, replace=False):
                if other != node:
                    self.graph.add_edge(node, int(other), weight=float(rng.choice([0.0, 0.5, 1.0, 3.0]) + rng.random()))
        self.goals = {int(x) for x in rng.choice(np.arange(1, nodes), goals, replace=False)}
        reverse = self.graph.reverse()
        distance = nx.multi_source_dijkstra_path_length(reverse, self.goals)
        self.least = distance.get(0, math.inf)
        factor = np.full(nodes, scale) if consistent else scale * rng.random(nodes)
        self.h = [distance[node] * factor[node] if node in distance else math.inf for node in range(nodes)]
        self.expansions = 0

    def start(self):
        return 0

    def expand(self, state, slack):
        self.expansions += 1
        return [Edge(other, data["weight"], (state, other)) for other, data in self.graph[state].items()]

    def heuristic(self, states):
        return [self.h[state] for state in states]

    def is_goal(self, states):
        return [state in self.goals for state in states]

    def crowd(self, states):
        return [state % 7 for state in states]


@pytest.mark.parametrize("epsilon", [0.0, 0.1, 0.7])
@pytest.mark.parametrize(("initial_cost", "crowding"), [(math.inf, 0.0), (5.0, 0.0), (math.inf, 0.5), (5.0, 2.0)])
@pytest.mark.parametrize("consistent", [True, False])
def test_exhaustion_equals_dijkstra(epsilon, initial_cost, crowding, consistent):
    for seed in range(15):
        graph = Graph(np.random.default_rng(seed), consistent=consistent)
        config = AnaStarConfig(epsilon=epsilon, initial_cost=initial_cost, crowding=crowding)
        result = AnaStar(graph, np.random.default_rng(seed), config).run()
        assert result.stopped_by == "exhausted"
        if graph.least == math.inf:
            assert not result.paths
            continue
        assert result.paths[-1].cost == pytest.approx(graph.least, abs=1e-9)
        for path in result.paths:  # each is a real path of its cost
            assert path.states[0] == 0 and path.states[-1] in graph.goals
            assert path.payloads == tuple(zip(path.states, path.states[1:], strict=False))
            cost = sum(graph.graph[a][b]["weight"] for a, b in path.payloads)
            assert cost == pytest.approx(path.cost, abs=1e-9)


def test_costs_fall_and_bounds_hold():
    for seed in range(25):
        graph = Graph(np.random.default_rng(seed), nodes=150, scale=0.8)
        result = AnaStar(graph, np.random.default_rng(seed), AnaStarConfig(epsilon=0.1)).run()
        costs = [path.cost for path in result.paths]
        assert costs == sorted(set(costs), reverse=True)
        for path in result.paths:
            assert path.bound >= 1.0 - 1e-12
            assert path.cost <= path.bound * graph.least + 1e-9
        if result.paths:
            assert result.lower_bound == pytest.approx(graph.least, abs=1e-9)


def test_bound_on_interruption_is_valid():
    for seed in range(25):
        graph = Graph(np.random.default_rng(seed), nodes=150, scale=0.9)
        result = AnaStar(graph, np.random.default_rng(0), AnaStarConfig(epsilon=0.0, max_expansions=15)).run()
        assert result.lower_bound <= graph.least + 1e-9
        assert result.expansions <= 15


def test_an_inadmissible_heuristic_can_miss_the_optimum():
    """The Dijkstra test can fail: the same test with h too large finds costlier paths."""
    missed = 0
    for seed in range(25):
        graph = Graph(np.random.default_rng(seed), scale=6.0)
        result = AnaStar(graph, np.random.default_rng(seed), AnaStarConfig(epsilon=0.0)).run()
        missed += bool(result.paths) and result.paths[-1].cost > graph.least + 1e-9
    assert missed > 0


def test_same_seed_same_search():
    def run(seed):
        graph = Graph(np.random.default_rng(3), nodes=200)
        return AnaStar(graph, np.random.default_rng(seed), AnaStarConfig(epsilon=0.5)).run()

    first, second, other = run(1), run(1), run(2)
    assert first.expanded == second.expanded
    assert first.expanded != other.expanded


def test_judge_forbids_and_changes_the_last_edge():
    graph = Graph(np.random.default_rng(0), goals=2)
    best = AnaStar(graph, np.random.default_rng(0)).run().paths[-1]
    forbidden = best.states[-1]

    def judge(states, payloads, edge):
        assert states[0] == 0 and list(payloads) == list(zip(states, states[1:], strict=False))
        assert edge.payload == (states[-1], edge.state)
        return None if edge.state == forbidden else edge._replace(cost=edge.cost + 10, payload="judged")

    judged = AnaStar(graph, np.random.default_rng(0), judge=judge).run()
    assert judged.paths and all(path.states[-1] != forbidden for path in judged.paths)
    path = judged.paths[-1]
    assert path.payloads[-1] == "judged"
    cost = 10 + sum(graph.graph[a][b]["weight"] for a, b in zip(path.states, path.states[1:], strict=False))
    assert path.cost == pytest.approx(cost)


def test_limits_and_observer(monkeypatch):
    clock = iter(np.arange(0.0, 100.0, 1e-3))  # every look at the clock takes a millisecond
    monkeypatch.setattr("toolkit.search.anytime.ana_star.time.perf_counter", lambda: float(next(clock)))

    class Line(Graph):
        def __init__(self):
            pass

        def expand(self, state, slack):
            return [Edge(state + 1, 1.0), Edge(-state - 1, 1.0)]

        def heuristic(self, states):
            return [1.0] * len(states)

        def is_goal(self, states):
            return [False] * len(states)

    seen = []
    monkeypatch.setattr("toolkit.search.anytime.ana_star._REPORT_INTERVAL", 0.01)
    result = AnaStar(Line(), np.random.default_rng(0)).run(0.2, seen.append)
    assert result.stopped_by == "time" and not result.paths
    assert 0.2 <= result.seconds < 0.21  # kept within 5 %
    assert len(seen) > 3 and "none yet" in str(seen[0])
    assert AnaStar(Line(), np.random.default_rng(0), AnaStarConfig(max_expansions=7)).run().expansions == 7
    monkeypatch.setattr("toolkit.search.anytime.ana_star._MAX_STATES", 50)
    assert AnaStar(Line(), np.random.default_rng(0)).run().stopped_by == "memory"


def test_start_at_the_goal_is_a_path_without_edges():
    graph = Graph(np.random.default_rng(0))
    graph.goals = {0}
    result = AnaStar(graph, np.random.default_rng(0)).run()
    assert result.paths[0].states == (0,) and result.paths[0].cost == 0.0 and result.stopped_by == "exhausted"


def test_the_search_goes_on_from_a_goal_that_was_refused():
    """0 -> 1 -> 2, both 1 and 2 goals, 1 refused: the way to 2 leads through 1."""
    graph = Graph(np.random.default_rng(0), nodes=6)
    graph.graph = nx.DiGraph([(0, 1, {"weight": 1.0}), (1, 2, {"weight": 1.0})])
    graph.goals, graph.h = {1, 2}, [0.0] * 6
    result = AnaStar(graph, np.random.default_rng(0), judge=lambda states, _, edge: edge if states[1:] else None).run()
    assert [path.states for path in result.paths] == [(0, 1, 2)] and result.paths[0].cost == 2.0


@pytest.mark.parametrize("epsilon", [0.0, 0.3])
def test_delays_change_the_order_and_nothing_else(epsilon):
    class Delayed(Graph):
        def expand(self, state, slack):
            return [edge._replace(delay=float(edge.state % 5)) for edge in super().expand(state, slack)]

    orders = set()
    for seed in range(10):
        config = AnaStarConfig(epsilon=epsilon)
        plain, delayed = (
            AnaStar(kind(np.random.default_rng(seed)), np.random.default_rng(seed), config).run()
            for kind in (Graph, Delayed)
        )
        assert plain.lower_bound == pytest.approx(delayed.lower_bound)
        assert [path.cost for path in plain.paths[-1:]] == pytest.approx([path.cost for path in delayed.paths[-1:]])
        orders.add(plain.expanded == delayed.expanded)
    assert False in orders


def test_a_finished_search_leaves_nothing_behind():
    """Its memory goes with it, without a garbage collection: a world's maps hang on the problem."""
    graph = Graph(np.random.default_rng(3))
    search = AnaStar(graph, np.random.default_rng(0))
    search.run()
    gone = weakref.ref(graph), weakref.ref(search)
    gc.disable()
    try:
        del graph, search
        assert [reference() for reference in gone] == [None, None]
    finally:
        gc.enable()


def test_an_assumed_cost_that_is_far_too_low_grows_until_something_is_found():
    """Two arms of a comb: many cheap dead ends near the start, and one way that costs far more than was assumed."""

    class Comb:
        def start(self):
            return (0, 0)

        def expand(self, state, slack):
            x, y = state
            ahead = [Edge((x + 1, 0), 10.0)] if y == 0 else []
            return [*ahead, *(Edge((x, y + k), 0.01) for k in (1, 2, 3) if y < 400)]

        def heuristic(self, states):
            return np.array([0.1 * (60 - x) for x, _ in states])

        def is_goal(self, states):
            return np.array([x == 60 for x, _ in states])

        def crowd(self, states):
            return [0] * len(states)

    def search(patience):
        config = AnaStarConfig(
            epsilon=0.0, initial_cost=20.0, crowding=0.0, patience=patience, max_expansions=3000, first_only=True
        )
        return AnaStar(Comb(), np.random.default_rng(0), config).run()

    assert not search(10_000).paths
    assert search(100).paths


class Fan:
    """A start, two states behind it, and many goals behind each of these."""

    def start(self):
        return (0,)

    def expand(self, state, slack):
        count = {1: 2, 2: 20}.get(len(state), 0)
        return [Edge((*state, k), 1.0 + k / 100, None) for k in range(count)]

    def heuristic(self, states):
        return [0.5 * (3 - len(state)) for state in states]

    def is_goal(self, states):
        return [len(state) == 3 for state in states]

    def crowd(self, states):
        return states


@pytest.mark.parametrize("answer", [None, Fault(1)], ids=["refused", "a fault on the way"])
def test_a_judge_is_asked_about_few_goals_out_of_a_state(answer):
    asked = []

    def judge(states, payloads, edge):
        asked.append(edge.state)
        return answer

    assert not AnaStar(Fan(), np.random.default_rng(0), AnaStarConfig(epsilon=0.0), judge=judge).run().paths
    most = 4 if answer is None else 1
    assert sorted(asked) == [(0, way, goal) for way in (0, 1) for goal in range(most)]


class Ways:
    """A start and many ways to goals, each over a state of its own."""

    def __init__(self, costs):
        self._costs = costs

    def start(self):
        return ()

    def expand(self, state, slack):
        if not state:
            return [Edge((way,), cost - 1.0, None) for way, cost in enumerate(self._costs)]
        return [Edge((*state, 0), 1.0, None)] if len(state) == 1 else []

    def heuristic(self, states):
        return [0.1 * (2 - len(state)) for state in states]

    def is_goal(self, states):
        return [len(state) == 2 for state in states]

    def crowd(self, states):
        return states


def judged_ways(truth, costs):
    """The cost of the best way and the ways that were judged, where the judge says what they truly cost."""
    asked = []

    def judge(states, payloads, edge):
        way = edge.state[0]
        asked.append(way)
        return edge._replace(cost=edge.cost + truth[way] - costs[way])

    config = AnaStarConfig(epsilon=0.5, layer=math.inf)
    result = AnaStar(Ways(costs), np.random.default_rng(0), config, judge=judge).run()
    return result.paths[-1].cost, asked


def test_ways_that_the_judge_surely_makes_too_dear_are_not_judged():
    rng = np.random.default_rng(5)
    costs = rng.uniform(10.0, 13.0, 200)
    truth = costs * rng.uniform(1.3, 1.35, 200)
    best, asked = judged_ways(truth, costs)
    could = [way for way in range(200) if costs[way] < truth.min()]  # which the costs alone do not rule out
    assert len(could) > 150 and len(asked) < 60
    assert best < 1.01 * truth.min()


def test_ways_that_the_judge_makes_cheaper_are_judged_although_they_seem_too_dear():
    rng = np.random.default_rng(6)
    costs = rng.uniform(10.0, 13.0, 200)
    truth = costs * rng.uniform(0.75, 0.8, 200)
    best, asked = judged_ways(truth, costs)
    assert len(asked) > 1  # though all others seem dearer than the first one truly is
    assert best < 1.04 * truth.min()


def test_the_first_solution_ends_a_search_that_wants_no_more():
    for seed in range(10):
        graph = Graph(np.random.default_rng(seed), goals=4)
        result = AnaStar(graph, np.random.default_rng(seed), AnaStarConfig(epsilon=0.5, first_only=True)).run()
        assert len(result.paths) == (graph.least < math.inf)
        assert result.stopped_by in (("solution", "exhausted") if result.paths else ("exhausted",))


def test_a_search_ends_when_it_has_settled_but_not_before_there_is_a_sequence():
    settled, patient = 0, AnaStarConfig(epsilon=0.3)
    for seed in range(30):
        rng = np.random.default_rng
        long = AnaStar(Graph(rng(seed), goals=4), rng(seed), patient).run()
        short = AnaStar(Graph(rng(seed), goals=4), rng(seed), replace(patient, settled=3)).run()
        if short.stopped_by != "settled":
            assert short.stopped_by == "exhausted" and short.expansions == long.expansions
            continue
        settled += 1
        assert short.expansions == short.paths[-1].expansions + 3
        assert [path.states for path in short.paths] == [path.states for path in long.paths[: len(short.paths)]]
    assert settled > 10
