"""Strategies of a contact search: ordinary, lazy or sliding, one function each."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.planner_config import PlannerConfig

_SHORTEST = 1.0  # m for a body of the usual size (`toolkit.robot.scale`); shorter ways are taken to be as long
_ATTEMPTS = 6  # at a first sequence over ground on which no foot rests; more of them find less than patient searches
_USUAL = 1000  # expansions, of which early searches have a part or a multiple each
_RESTARTS = 3  # of a patient search for a first sequence there, which finds one soon or hardly at all
_SLACK = 0.03  # m; legs are stretched in a run, and predicted CoMs are a little out of reach more often than not
_LAYER = 0.13  # units; random expansions are as likely at every distance from the goal


@dataclass(frozen=True)
class Strategy:
    """The strategy of one search.

    Attributes:
        cost: Weights of the edges' cost.
        at_once: Judges all transitions out of a state when the state is expanded. None: all of them wait, each as a
            state of the graph, until they are the best to go on with (`states.state.pack_pending`).
        waiting: Judges a transition that has waited. Where there is a judge `at_once` as well and it rejects every way
            on, the transitions it rejects wait. None: nothing waits.
        patient: Settings of the search of the whole graph.
        hasty: Settings of searches before that one, until one of them finds a sequence, in graphs without sequences
            that begin with one of the feet; states that run ahead of their feet then wait (`costs.delay.Haste`). None:
            there are no such searches.
        attempts: Number of those searches.
        calm: Settings of a search of the whole graph that follows them, until one of its runs finds a sequence; None:
            there is no such search.
        restarts: Number of those runs, each with other draws.
        slack: m for a body of the usual size (`toolkit.robot.scale`); predicted CoMs that are out of reach by up to so
            much are judged from where they are within it. 0: they stay as they are.
    """

    cost: CostConfig
    at_once: TransitionEvaluator | None
    waiting: TransitionEvaluator | None
    patient: AnaStarConfig
    hasty: AnaStarConfig | None = None
    attempts: int = 0
    calm: AnaStarConfig | None = None
    restarts: int = 0
    slack: float = 0.0


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
        evaluator = evaluator.sliding or evaluator
        # Steep ground need not be avoided. Ways across it are rare and lie deep in the graph. Finding them takes less
        # width than leaving a cul-de-sac does, and so more patience.
        search = replace(config.search, patience=10 * config.search.patience)
        config = replace(config, search=search)
    if evaluator.costly:
        return lazy(config, evaluator, length)
    return sliding(config, evaluator) if slides else ordinary(config, evaluator, length)


def ordinary(config: PlannerConfig, evaluator: TransitionEvaluator, length: float) -> Strategy:
    """Judge all transitions out of a state together, and let the cost so far count from the start."""
    patient = replace(config.search, initial_cost=_acceptable(config, length), layer=min(config.search.layer, _LAYER))
    return Strategy(config.cost, evaluator, None, patient)


def lazy(config: PlannerConfig, evaluator: TransitionEvaluator, length: float) -> Strategy:
    """Judge a transition only when it is the best to go on with; 20 such expansions count as an ordinary one."""
    limit = config.search.max_expansions
    patient = replace(
        config.search, initial_cost=_acceptable(config, length), max_expansions=None if limit is None else 20 * limit
    )
    return Strategy(config.cost, None, evaluator, patient)


def sliding(config: PlannerConfig, evaluator: TransitionEvaluator) -> Strategy:
    """Find a first sequence soon over ground on which no foot rests, then start again with patience.

    The cost so far does not count before there is a solution, since it would only lead back: it is high for all states
    that get far. Expansions are ten times as many, as most of them only show that the robot arrives too fast. The
    usual number of them without a cheaper sequence ends the search. Early searches, hasty ones and then patient ones,
    are short, since how long one takes to a first sequence varies a lot.
    """
    limit = config.search.max_expansions
    usual = _USUAL if limit is None else min(limit, _USUAL)  # a first sequence does not come sooner for a higher limit
    patient = replace(
        config.search,
        layer=0.2,
        epsilon=0.15,
        crowding=0.08,
        max_expansions=None if limit is None else 10 * limit,
        settled=limit,
    )
    calm = replace(patient, max_expansions=2 * usual, settled=None, persistence=1, first_only=True)
    hasty = replace(calm, layer=0.13, epsilon=0.3, crowding=0.013, max_expansions=3 * usual // 10)
    return Strategy(config.cost, evaluator, evaluator.stand_in, patient, hasty, _ATTEMPTS, calm, _RESTARTS, _SLACK)


def _acceptable(config: PlannerConfig, length: float) -> float:
    """The assumed cost of a solution before there is one; that of the settings, unless they leave it open."""
    given = config.search.initial_cost
    return config.acceptable_cost * length if given == math.inf else given
