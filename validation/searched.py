"""Searches whose sequences are all optimised: what calibration, ablation and budgets are made of."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.search.planner import ContactPlanner
from toolkit.search.result import SearchResult, Solution
from toolkit.search.sequence_screen import SequenceScreen
from toolkit.world.world import World
from validation.cases import Case
from validation.jobs import Record
from validation.options import TrialSettings
from validation.plan_trial import WarmUp, warm_up
from validation.random_contacts import sample_walk
from validation.run_trial import make_planner, robot_of
from validation.sequence_solvers import solve
from validation.truth import Outcome, Truth

PLANNERS = ("learned", "optimiser", "kinematic", "quasi-static")


@dataclass(frozen=True)
class Tested:
    """A sequence of a search, and what became of it.

    Attributes:
        solution: As the search found it.
        outcome: As it was optimised.
        ready: s from the start of the search until it was optimised, if the search waits while each sequence is
            optimised as soon as it is found. The time for the heuristic is not part of it.
        ready_processor: s; the same in processor time, which leaves out what other programs took.
        screen: Of the search that found it, for the local search.
    """

    solution: Solution
    outcome: Outcome
    ready: float
    ready_processor: float
    screen: SequenceScreen

    def record(self) -> dict[str, Any]:
        """The figures, as JSON can hold them."""
        return {
            "search_cost": self.solution.predicted,
            "predicted": float(self.solution.objective.sum()),
            "found_seconds": self.solution.seconds,
            "ready_seconds": self.ready,
            **self.outcome.record(),
        }


@dataclass(frozen=True)
class Searched:
    """A search, all of whose sequences were optimised.

    Attributes:
        planner: Who searched.
        result: What it found.
        tested: Its sequences, in the order in which they were found.
    """

    planner: ContactPlanner
    result: SearchResult
    tested: tuple[Tested, ...]

    @property
    def seconds(self) -> float:
        """s; of heuristic, search and all optimisations."""
        optimised = sum(item.outcome.seconds for item in self.tested)
        return self.result.heuristic_seconds + self.result.seconds + optimised

    @property
    def by_cost(self) -> list[Tested]:
        """The sequences, those first that the search holds for the cheapest."""
        return sorted(self.tested, key=lambda item: item.solution.predicted)

    @property
    def first_feasible(self) -> Tested | None:
        """The first sequence that the optimiser calls feasible."""
        return next((item for item in self.tested if item.outcome.feasible), None)

    def summary(self) -> dict[str, Any]:
        """Figures of the search, as JSON can hold them."""
        first = self.first_feasible
        return {
            "found": bool(self.tested),
            "feasible": first is not None,
            "sequences": len(self.tested),
            "feasible_sequences": sum(item.outcome.feasible for item in self.tested),
            "reason": self.result.reason,
            "expansions": self.result.expansions,
            "search_seconds": self.result.seconds,
            "heuristic_seconds": self.result.heuristic_seconds,
            "first_seconds": self.tested[0].solution.seconds if self.tested else None,
            "first_feasible_seconds": None if first is None else first.ready,
            "first_feasible_processor_seconds": None if first is None else first.ready_processor,
            "bound": self.result.solutions[-1].bound if self.tested else None,
        }


def favourite(tested: Sequence[Tested]) -> Tested | None:
    """The feasible sequence that its search holds for the cheapest."""
    feasible = (item for item in tested if item.outcome.feasible)
    return min(feasible, key=lambda item: item.solution.predicted, default=None)


def cheapest(tested: Sequence[Tested]) -> Tested | None:
    """The feasible sequence that truly is the cheapest."""
    feasible = (item for item in tested if item.outcome.feasible)
    return min(feasible, key=lambda item: item.outcome.cost.total, default=None)


def search(settings: TrialSettings, world: World, kind: str, seed: Sequence[int], truth: Truth) -> Searched:
    """Search once and optimise every sequence that is found.

    Args:
        settings: Of the planner, the limit on its expansions included.
        world: The world.
        kind: Who judges transitions; see `toolkit.pipeline.make_planner`.
        seed: Of the search.
        truth: Optimises; it knows what it has optimised before.

    Raises:
        PlanningError: The robot cannot stand at the start, or nothing leads to the goal.
    """
    make_ready(settings, kind)
    planner = make_planner(settings, world, kind)
    began, worked = time.perf_counter(), time.process_time()
    result = planner.search(np.random.default_rng(list(seed)), settings.planning.time_limit)
    share = min((time.process_time() - worked) / (time.perf_counter() - began), 1.0)
    tested, spent, processor = [], 0.0, 0.0
    screen = result.screen
    assert screen is not None
    for solution in result.solutions:
        outcome = truth(solution.sequence, solution.plan)
        spent += outcome.seconds
        processor += outcome.processor_seconds
        found = solution.seconds
        tested.append(Tested(solution, outcome, found + spent, share * found + processor, screen))
    return Searched(planner, result, tuple(tested))


def completed(
    records: Sequence[Record], cases: Sequence[tuple[Case, str]], nothing: dict[str, Any]
) -> list[dict[str, Any]]:
    """Records of trials (case, planner) with what those lack that ended in an error: every trial counts."""
    return [
        {
            "kind": case.kind,
            "seed": case.seed,
            "planner": planner,
            "found": False,
            "feasible": False,
            **nothing,
            **record,
        }
        for record, (case, planner) in zip(records, cases, strict=True)
    ]


def with_expansions(settings: TrialSettings, expansions: int) -> TrialSettings:
    """The settings with another limit on the expansions."""
    return replace(settings, planning=replace(settings.planning, expansions=expansions))


def make_ready(settings: TrialSettings, kind: str) -> None:
    """Compile and load in this process what search and optimiser need, so that no trial's time contains it."""
    warm_up(WarmUp(settings.robot, settings.robots, kind))
    _warm_optimiser(settings.robot, settings.robots)


@lru_cache(maxsize=2)
def _warm_optimiser(name: str, robots: Path) -> None:
    robot = robot_of(name, robots)
    solve(robot, sample_walk(robot, 2, np.random.default_rng(0)))
