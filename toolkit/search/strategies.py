"""Strategies of a contact search: ordinary, lazy or sliding, one function each."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.planner_config import PlannerConfig

_SHORTEST = 1.0  # m for a body of the usual size (`toolkit.robot.scale`); shorter ways are taken to be as long
_LAYER = 0.13  # units; random expansions are as likely at every distance from the goal


@dataclass(frozen=True)
class Strategy:
    """The strategy of one search.

    Attributes:
        cost: Weights of the edges' cost.
        judge: Judges transitions.
        lazy: Whether transitions wait, each as a state of the graph, until they are the best to go on with
            (`states.state.pack_pending`), and are judged then; else all those out of a state are judged together.
        search: Settings of the search.
        haste: Whether states that run ahead of their feet wait (`costs.delay.Haste`).
    """

    cost: CostConfig
    judge: TransitionEvaluator
    lazy: bool
    search: AnaStarConfig
    haste: bool = False


def strategy_of(
    config: PlannerConfig,
    evaluator: TransitionEvaluator,
    length: float,
    *,
    slides: bool,
    paced: bool,
    scale: float = 1.0,
) -> Strategy:
    """The strategy that suits a judge, the length of the way in m, its ground and its timing.

    `slides` and `paced` are those of `CostConfig.where`; `scale` is the factor on the robot's lengths.
    """
    length = max(length, scale * _SHORTEST)
    config = replace(config, cost=config.cost.where(slides=slides, paced=paced))
    if slides:
        # Steep ground need not be avoided. Ways across it are rare and lie deep in the graph. Finding them takes less
        # width than leaving a cul-de-sac does, and so more patience.
        search = replace(config.search, patience=10 * config.search.patience)
        config = replace(config, search=search)
    if evaluator.costly:
        return lazy(config, evaluator, length)
    return sliding(config, evaluator) if slides else ordinary(config, evaluator, length)


def ordinary(config: PlannerConfig, evaluator: TransitionEvaluator, length: float) -> Strategy:
    """Judge all transitions out of a state together, and let the cost so far count from the start."""
    search = replace(config.search, initial_cost=_acceptable(config, length), layer=min(config.search.layer, _LAYER))
    return Strategy(config.cost, evaluator, False, search)


def lazy(config: PlannerConfig, evaluator: TransitionEvaluator, length: float) -> Strategy:
    """Judge a transition only when it is the best to go on with; 20 such expansions count as an ordinary one."""
    limit = config.search.max_expansions
    search = replace(
        config.search, initial_cost=_acceptable(config, length), max_expansions=None if limit is None else 20 * limit
    )
    return Strategy(config.cost, evaluator, True, search)


def sliding(config: PlannerConfig, evaluator: TransitionEvaluator) -> Strategy:
    """Cross ground on which no foot rests before the robot is too fast for its legs.

    The cost so far does not count before there is a solution, since it would only lead back: it is high for all states
    that get far. Expansions are ten times as many, as most of them only show that the robot arrives too fast. The
    usual number of them without a cheaper sequence ends the search.
    """
    limit = config.search.max_expansions
    most = None if limit is None else 10 * limit
    search = replace(config.search, layer=0.2, epsilon=0.15, crowding=0.08, max_expansions=most, settled=limit)
    return Strategy(config.cost, evaluator, False, search, haste=True)


def _acceptable(config: PlannerConfig, length: float) -> float:
    """The assumed cost of a solution before there is one; that of the settings, unless they leave it open."""
    given = config.search.initial_cost
    return config.acceptable_cost * length if given == math.inf else given
