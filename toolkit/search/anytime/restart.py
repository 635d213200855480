"""Searches in turn: a hasty one for a first sequence, then a patient one from the start again.

What gets to a goal soonest is seldom what holds: the hasty search would go on around its own first sequence, so the
patient one does not build on it.

Reference:
    Richter, Thayer, Ruml: The joy of forgetting: faster anytime search via restarting, ICAPS 2010.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from toolkit.search.anytime.ana_star import AnaStar, AnaStarConfig, AnaStarResult
from toolkit.search.anytime.graph import Judge, Path, Progress, SearchProblem, State


def search_in_turn(
    searches: Sequence[tuple[SearchProblem[State], AnaStarConfig]],
    rng: np.random.Generator,
    judge: Judge[State] | None,
    time_limit: float,
    observer: Callable[[Progress[State]], None] | None = None,
) -> tuple[AnaStarResult[State], int]:
    """Run one search after the other, each from the start; no later one where one ran out of time, or of all states.

    Args:
        searches: graph and settings of each; graphs before the last one are the same, or parts of it.
        rng: for the random expansions of the last search; those before it have streams of their own, so that they do
            not change what it finds.
        judge: see `AnaStar`.
        time_limit: s, for all together.
        observer: told of the progress of all as if they were one; its cost is the best of all so far.

    Returns:
        All paths in the order of their finding, whose costs fall strictly within each search; and how many of them are
        of searches before the last one.
    """
    paths: list[Path[State]] = []
    expanded: list[State] = []
    seconds, bound, early = 0.0, 0.0, 0
    result: AnaStarResult[State] | None = None
    for (problem, config), generator in zip(searches, [*rng.spawn(len(searches) - 1), rng], strict=True):
        early, whole, before = len(paths), problem is searches[-1][0], len(expanded)
        # Of a part of the graph the bound holds for that part: of the whole one only what h says at the start is known.
        least = 0.0 if whole else float(problem.heuristic([problem.start()])[0])
        best = min(paths, key=lambda path: path.cost, default=None)
        tell = None if observer is None else partial(_tell, observer, seconds, before, best, least)
        result = AnaStar(problem, generator, config, judge).run(time_limit - seconds, tell)
        for path in result.paths:
            loose, found = _loosened(path.bound, path.cost, least), seconds + path.seconds
            paths.append(replace(path, bound=loose, seconds=found, expansions=before + path.expansions))
        expanded += result.expanded
        seconds, bound = seconds + result.seconds, max(bound, result.lower_bound if whole else least)
        if result.stopped_by == "time" or (result.stopped_by == "exhausted" and whole):
            break
    assert result is not None
    spent = {"seconds": seconds, "expansions": len(expanded), "expanded": tuple(expanded)}
    return replace(result, paths=tuple(paths), lower_bound=bound, **spent), early


def _tell(
    observer: Callable[[Progress[State]], None],
    seconds: float,
    expansions: int,
    best: Path[State] | None,
    least: float,
    progress: Progress[State],
) -> None:
    """Tell of the progress of a search as if it had gone on from the searches before it and from their best path."""
    progress = replace(progress, bound=_loosened(progress.bound, progress.cost, least))
    if best is not None and best.cost < progress.cost:
        progress = replace(progress, cost=best.cost, bound=best.bound)
    observer(replace(progress, seconds=seconds + progress.seconds, expansions=expansions + progress.expansions))


def _loosened(bound: float, cost: float, least: float) -> float:
    """A bound on suboptimality where no path costs less than `least`, if that is more."""
    return max(bound, cost / least) if least > 0.0 else bound
