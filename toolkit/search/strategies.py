"""How a contact search goes about its graph: ordinary, lazy or sliding; each strategy stands in one function."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.delay import HasteConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.planner_config import PlannerConfig


@dataclass(frozen=True)
class Strategy:
    """What one search does its own way.

    Attributes:
        cost: Weights of the edges' cost.
        at_once: The judge of all transitions out of a state when the state is expanded. None: all of them wait, each
            as a state of the graph, until they are the best to go on with (`states.state.pack_pending`).
        waiting: The judge of a transition that has waited. Where there is a judge `at_once` as well, what that one
            rejects waits where it sees no way on. None: nothing waits.
        patient: Settings of the search of the whole graph.
        hasty: Settings of a search before that one, without what begins with the right foot; None: there is none.
        haste: Weights by which states wait that run ahead of their feet; None: none does.
    """

    cost: CostConfig
    at_once: TransitionEvaluator | None
    waiting: TransitionEvaluator | None
    patient: AnaStarConfig
    hasty: AnaStarConfig | None = None
    haste: HasteConfig | None = None


def strategy_of(config: PlannerConfig, evaluator: TransitionEvaluator, length: float, *, slides: bool) -> Strategy:
    """The strategy that suits a judge and the ground.

    Args:
        config: Settings of the planner.
        evaluator: Judges the dynamics of transitions.
        length: m; of the way to the goal.
        slides: Whether no way leads over resting ground alone.
    """
    if slides:
        # Steep ground is not to be avoided. What crosses it is rare and lies deep: it needs less width than a way out
        # of a cul-de-sac does, and so more patience.
        search = replace(config.search, patience=10 * config.search.patience)
        config = replace(config, cost=replace(config.cost, steep=0.0), search=search)
    if evaluator.costly:
        return lazy(config, evaluator, length)
    return sliding(config, evaluator) if slides else ordinary(config, evaluator, length)


def ordinary(config: PlannerConfig, evaluator: TransitionEvaluator, length: float) -> Strategy:
    """Judge all transitions out of a state together, and let the cost so far count from the outset."""
    patient = replace(config.search, initial_cost=_acceptable(config, length))
    return Strategy(config.cost, evaluator, None, patient)


def lazy(config: PlannerConfig, evaluator: TransitionEvaluator, length: float) -> Strategy:
    """Judge a transition only when it is the best to go on with: 20 such expansions count as an ordinary one."""
    limit = config.search.max_expansions
    patient = replace(
        config.search,
        initial_cost=_acceptable(config, length),
        max_expansions=None if limit is None else 20 * limit,
    )
    return Strategy(config.cost, None, evaluator, patient)


def sliding(config: PlannerConfig, evaluator: TransitionEvaluator) -> Strategy:
    """Find a first sequence over ground on which no foot rests soon, then start again with patience.

    Whoever gets far has paid for it, so that the cost so far would only lead back: it does not count before there is a
    solution. Expansions are three times as many, as most of them only see that they have come too fast; the hasty
    search has a fifth of them.
    """
    limit = config.search.max_expansions
    patient = replace(
        config.search,
        layer=1.5,
        epsilon=0.15,
        crowding=0.6,
        max_expansions=None if limit is None else 3 * limit,
    )
    hasty = replace(
        patient,
        layer=1.0,
        epsilon=0.3,
        crowding=0.1,
        max_expansions=600 if limit is None else 3 * limit // 5,
        first_only=True,
    )
    return Strategy(config.cost, evaluator, evaluator.stand_in, patient, hasty, config.haste)


def _acceptable(config: PlannerConfig, length: float) -> float:
    """The cost that stands for that of a solution before there is one, where the settings leave it open."""
    given = config.search.initial_cost
    return config.acceptable_cost * max(length, 1.0) if given == math.inf else given
