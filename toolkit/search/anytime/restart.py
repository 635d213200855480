"""Searches in turn: early ones for a first sequence, then a patient one that begins again at the start.

How long a random search takes to its first sequence varies a lot: most find one at once or hardly at all. So an early
search that has not found one soon gives way to another one, with other draws. The sequence that is found first is
seldom one that holds. The early search would go on around its own first sequence, so the patient one does not build on
it.

References:
    Gomes, Selman, Crato, Kautz: Heavy-tailed phenomena in satisfiability and constraint satisfaction problems, Journal
    of Automated Reasoning 2000.
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
    """Run one search after the other, each from the start.

    No later search runs where one ran out of time, or looked at every state of the whole graph. Where one finds a
    sequence, the last one follows.

    Args:
        searches: Graph and settings of each. The graphs before the last one are the same, or parts of it.
        rng: Generator of the last search. Those before it get generators of their own, so that they do not change
            what the last one finds.
        judge: See `AnaStar`.
        time_limit: Limit in s for all of them together.
        observer: Told of the progress of all as if they were one; its cost is the best of all so far.

    Returns:
        The result of all, whose paths are in the order in which they were found (costs fall strictly within each
        search), and the number of paths that come from searches before the last one.
    """
    paths: list[Path[State]] = []
    expanded: list[State] = []
    seconds, bound, early = 0.0, 0.0, 0
    result: AnaStarResult[State] | None = None
    for (problem, config), generator in zip(searches, [*rng.spawn(len(searches) - 1), rng], strict=True):
        if paths and generator is not rng:
            continue
        early, whole, before = len(paths), problem is searches[-1][0], len(expanded)
        # The bound of a part of the graph does not hold for the whole one: there only h of the start is known.
        least = 0.0 if whole else float(problem.heuristic([problem.start()])[0])
        best = min(paths, key=lambda path: path.cost, default=None)
        tell = None if observer is None else partial(_tell, observer, seconds, before, best, least)
        search = AnaStar(problem, generator, config, judge, known=bool(paths))
        result = search.run(time_limit - seconds, tell)
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
    """Report the progress of a search as if it continued the searches before it and their best path."""
    progress = replace(progress, bound=_loosened(progress.bound, progress.cost, least))
    if best is not None and best.cost < progress.cost:
        progress = replace(progress, cost=best.cost, bound=best.bound)
    observer(replace(progress, seconds=seconds + progress.seconds, expansions=expansions + progress.expansions))


def _loosened(bound: float, cost: float, least: float) -> float:
    """The bound on suboptimality, given that no path costs less than `least`; never below `bound`."""
    return max(bound, cost / least) if least > 0.0 else bound
