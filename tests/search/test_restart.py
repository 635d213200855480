"""Searches in turn: the first sequence of the hasty one, then all that the patient one finds."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.search.test_ana_star import Graph
from toolkit.search.anytime.ana_star import AnaStar, AnaStarConfig
from toolkit.search.anytime.restart import search_in_turn

HASTY, PATIENT = AnaStarConfig(epsilon=0.5, first_only=True), AnaStarConfig(epsilon=0.3)


def test_the_first_solution_ends_a_search_that_wants_no_more():
    for seed in range(10):
        graph = Graph(np.random.default_rng(seed), goals=4)
        result = AnaStar(graph, np.random.default_rng(seed), HASTY).run()
        assert len(result.paths) == (graph.least < math.inf)
        assert result.stopped_by in (("solution", "exhausted") if result.paths else ("exhausted",))


def test_both_searches_count_and_the_second_one_starts_again():
    found = 0
    for seed in range(20):
        graph = Graph(np.random.default_rng(seed), goals=4)
        told = []
        result, early = search_in_turn(
            [(graph, HASTY), (graph, PATIENT)],
            np.random.default_rng(seed),
            None,
            math.inf,
            lambda progress, to=told: to.append(progress),
        )
        assert result.expansions == graph.expansions == len(result.expanded)
        if graph.least == math.inf:
            assert not result.paths
            continue
        hasty = AnaStar(graph, np.random.default_rng(seed).spawn(1)[0], HASTY).run()
        alone = AnaStar(graph, np.random.default_rng(seed), PATIENT).run()
        assert result.paths[0].states == hasty.paths[0].states
        if hasty.stopped_by == "solution":
            found += 1
            assert early == 1
            assert [path.states for path in result.paths[1:]] == [path.states for path in alone.paths]
            assert [p.expansions - hasty.expansions for p in result.paths[1:]] == [p.expansions for p in alone.paths]
        assert min(path.cost for path in result.paths) == pytest.approx(graph.least)
        expansions, costs = [p.expansions for p in told], [p.cost for p in told]
        assert expansions == sorted(expansions) and costs == sorted(costs, reverse=True)  # as if they were one
        seconds = [path.seconds for path in result.paths]
        assert seconds == sorted(seconds) and seconds[-1] <= result.seconds
    assert found > 5


def test_no_later_search_where_all_states_were_seen_or_no_time_is_left():
    graph = Graph(np.random.default_rng(1), goals=1)
    lone = AnaStar(graph, np.random.default_rng(1).spawn(1)[0], PATIENT).run()
    again, _ = search_in_turn([(graph, PATIENT), (graph, PATIENT)], np.random.default_rng(1), None, math.inf)
    assert (lone.stopped_by, again.expansions) == ("exhausted", lone.expansions)
    none, _ = search_in_turn([(graph, HASTY), (graph, PATIENT)], np.random.default_rng(1), None, 0.0)
    assert (none.stopped_by, none.expansions) == ("time", 0)


def test_a_part_of_the_graph_that_ends_does_not_end_the_whole():
    part, graph = Graph(np.random.default_rng(1), goals=1), Graph(np.random.default_rng(1), goals=1)
    whole, _ = search_in_turn([(part, PATIENT), (graph, PATIENT)], np.random.default_rng(1), None, math.inf)
    assert part.expansions > 0 and graph.expansions > 0
    assert whole.expansions == part.expansions + graph.expansions
    assert whole.lower_bound == pytest.approx(graph.least)


def test_hasty_searches_begin_again_until_one_finds_a_sequence():
    graph = Graph(np.random.default_rng(0), goals=4)
    short = AnaStarConfig(epsilon=0.5, first_only=True, max_expansions=1)
    one, _ = search_in_turn([(graph, HASTY), (graph, PATIENT)], np.random.default_rng(1), None, math.inf)
    found, early = search_in_turn([(graph, HASTY)] * 3 + [(graph, PATIENT)], np.random.default_rng(1), None, math.inf)
    assert early == 1  # the other two are left out
    assert [path.states for path in found.paths] == [path.states for path in one.paths]
    none, early = search_in_turn([(graph, short)] * 3 + [(graph, PATIENT)], np.random.default_rng(1), None, math.inf)
    alone = AnaStar(graph, np.random.default_rng(1), PATIENT).run()
    assert early == 0 and none.expansions == alone.expansions + 3


def test_a_search_ends_when_it_has_settled_but_not_before_there_is_a_sequence():
    settled = 0
    for seed in range(30):
        rng = np.random.default_rng
        long = AnaStar(Graph(rng(seed), goals=4), rng(seed), PATIENT).run()
        short = AnaStar(Graph(rng(seed), goals=4), rng(seed), replace(PATIENT, settled=3)).run()
        if short.stopped_by != "settled":
            assert short.stopped_by == "exhausted" and short.expansions == long.expansions
            continue
        settled += 1
        assert short.expansions == short.paths[-1].expansions + 3
        assert [path.states for path in short.paths] == [path.states for path in long.paths[: len(short.paths)]]
        known = AnaStar(Graph(rng(seed), goals=4), rng(seed), replace(PATIENT, settled=3), known=True).run()
        if not known.paths:
            assert known.expansions == 3
    assert settled > 10


def test_the_last_search_settles_for_the_sequence_of_one_before_it():
    graph = Graph(np.random.default_rng(0), goals=4)
    searches = [(graph, HASTY), (graph, replace(PATIENT, settled=1))]
    found, early = search_in_turn(searches, np.random.default_rng(1), None, math.inf)
    assert (early, len(found.paths), found.stopped_by) == (1, 1, "settled")
    assert found.expansions == found.paths[0].expansions + 1
