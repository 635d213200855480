"""Searches in turn: a hasty one for a first sequence, then a patient one from the start again.

What gets to a goal soonest is seldom what holds: the hasty search would go on around its own first sequence, so the
patient one does not build on it.

Reference:
    Richter, Thayer, Ruml: The joy of forgetting: faster anytime search via restarting, ICAPS 2010.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

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
    seconds, bound = 0.0, 0.0
    result: AnaStarResult[State] | None = None
    generators, early = [*rng.spawn(len(searches) - 1), rng], 0
    for (problem, config), generator in zip(searches, generators, strict=True):
        early, whole = len(paths), problem is searches[-1][0]
        began, before, best = seconds, len(expanded), min(paths, key=lambda path: path.cost, default=None)
        # Of a part of the graph the bound holds for that part: of the whole one only what h says at the start is known.
        least = 0.0 if whole else float(problem.heuristic([problem.start()])[0])

        def observed(
            progress: Progress[State],
            began: float = began,
            before: int = before,
            best: Path[State] | None = best,
            least: float = least,
        ) -> None:
            progress = replace(progress, bound=_loosened(progress.bound, progress.cost, least))
            if best is not None and best.cost < progress.cost:
                progress = replace(progress, cost=best.cost, bound=best.bound)
            assert observer is not None
            observer(replace(progress, seconds=began + progress.seconds, expansions=before + progress.expansions))

        search = AnaStar(problem, generator, config, judge)
        result = search.run(time_limit - began, None if observer is None else observed)
        for path in result.paths:
            loose = _loosened(path.bound, path.cost, least)
            paths.append(replace(path, bound=loose, seconds=began + path.seconds, expansions=before + path.expansions))
        expanded += result.expanded
        seconds, bound = began + result.seconds, max(bound, result.lower_bound if whole else least)
        if result.stopped_by == "time" or (result.stopped_by == "exhausted" and whole):
            break
    assert result is not None
    together = replace(
        result,
        paths=tuple(paths),
        lower_bound=bound,
        seconds=seconds,
        expansions=len(expanded),
        expanded=tuple(expanded),
    )
    return together, early


def _loosened(bound: float, cost: float, least: float) -> float:
    """A bound on suboptimality where no path costs less than `least`, if that is more."""
    return max(bound, cost / least) if least > 0.0 else bound
