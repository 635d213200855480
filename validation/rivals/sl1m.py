"""SL1M's relaxation: the choice of surfaces as a linear program whose slacks are sparse in the L1 norm.

Every step has a slack for each of its candidate regions, by which its place may lie outside. The sum of the slacks is
least; where the relaxation is sparse, one slack of every step is zero and its region is chosen. What is written here is
made from the idea of the paper: candidates are the regions near a straight way to the goal. Where the sum is not
sparse, slacks are weighed by their last values and the program is solved again; where it stays so, choices are tried
one after the other, those with the least slacks first.

Reference:
    Tonneau, Song, Fernbach, Mansard, Taix, Del Prete: SL1M: sparse L1-norm minimization for contact planning on uneven
    terrain, ICRA 2020; Candes, Wakin, Boyd: Enhancing sparsity by reweighted L1 minimization, 2008.
"""

from __future__ import annotations

import heapq
import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.sequence import ContactSequence
from validation.rivals.footsteps import Footsteps, add_places, extent
from validation.rivals.linear import Builder, solution
from validation.rivals.regions import Region

_NEAR = 0.6  # m; candidates are the regions no farther from the straight way's point at a step
_ROUNDS = 6
_CHOICES = 150  # that are tried where no round was sparse
_ZERO, _SOFT = 1e-5, 1e-2  # m; a slack that counts as none, and what is added to one before it weighs
_MOST = 100.0  # m; largest slack


@dataclass(frozen=True)
class Relaxed:
    """What the relaxation found.

    Attributes:
        sequence: The contacts; None where no round was sparse.
        rounds: Linear programs solved for the choice.
        seconds: s; wall-clock.
        reason: Why there is no sequence.
    """

    sequence: ContactSequence | None
    rounds: int
    seconds: float
    reason: str = ""


def relax(task: Footsteps, rounds: int = _ROUNDS) -> Relaxed:
    """Choose a region for every step and place the steps in them, with the shortest ways of the feet."""
    began = time.perf_counter()
    candidates = _candidates(task)
    if not candidates.any(1).all():
        return Relaxed(None, 0, time.perf_counter() - began, "a step has no region near the straight way")
    builder = Builder()
    places = add_places(builder, task)
    slacks = _slacks(builder, task, places, candidates)
    program = builder.finished()
    weights, left = np.ones(slacks.shape), np.zeros(slacks.shape)
    for number in range(1, rounds + 1):
        cost = program.cost.copy()
        cost[slacks[candidates]] = weights[candidates]
        x = solution(program._replace(cost=cost))
        if x is None:
            return Relaxed(None, number, time.perf_counter() - began, "no steps lead to the goal in so many steps")
        left = np.where(candidates, x[slacks], np.inf)
        if (left.min(1) < _ZERO).all():
            sequence = _placed(task, left.argmin(1))
            if sequence is not None:
                return Relaxed(sequence, number, time.perf_counter() - began)
        weights = _SOFT / (np.where(candidates, x[slacks], 0.0) + _SOFT)
    for choice in itertools.islice(choices(left), _CHOICES):
        sequence = _placed(task, choice)
        if sequence is not None:
            return Relaxed(sequence, rounds, time.perf_counter() - began)
    return Relaxed(None, rounds, time.perf_counter() - began, f"not sparse after {rounds} rounds")


def choices(slacks: np.ndarray) -> Iterator[np.ndarray]:
    """Choices (count,) of a region for every step, by the sum of their slacks (count, regions), the least first."""
    order = np.argsort(slacks, axis=1, kind="stable")
    ranked = np.take_along_axis(slacks, order, axis=1)
    steps = np.arange(len(slacks))
    first = tuple(itertools.repeat(0, len(slacks)))
    waiting: list[tuple[float, tuple[int, ...]]] = [(float(ranked[:, 0].sum()), first)]
    known: set[tuple[int, ...]] = {first}
    while waiting:
        total, ranks = heapq.heappop(waiting)
        yield order[steps, list(ranks)]
        for step, rank in enumerate(ranks):
            following = (*ranks[:step], rank + 1, *ranks[step + 1 :])
            if rank + 1 < slacks.shape[1] and np.isfinite(ranked[step, rank + 1]) and following not in known:
                known.add(following)
                heapq.heappush(waiting, (total + float(ranked[step, rank + 1] - ranked[step, rank]), following))


def _candidates(task: Footsteps) -> np.ndarray:
    """(count, regions) bool; regions near the straight way where a step would be after its share of the steps."""
    begin = task.start.mean_feet.position[:2]
    shares = np.arange(1, task.count + 1) / task.count
    way = begin + shares[:, None] * (task.goal - begin)
    found = np.zeros((task.count, len(task.regions)), bool)
    for number, region in enumerate(task.regions):
        low, high = extent(region)
        off = np.maximum(np.maximum(low[:2] - way, way - high[:2]), 0.0)
        found[:, number] = np.hypot(*off.T) <= _NEAR
    return found


def _slacks(builder: Builder, task: Footsteps, places: np.ndarray, candidates: np.ndarray) -> np.ndarray:
    """Slacks (count, regions) with the rows that tie them to the places; those of no candidate are free."""
    slacks = builder.variables(candidates.shape, 0.0, _MOST)
    for step, number in zip(*np.nonzero(candidates), strict=True):
        for row, bound in _rows(task.regions[number]):
            builder.row((row, places[step + 2]), (-1.0, slacks[step, number]), high=bound)
    return slacks


def _rows(region: Region) -> list[tuple[np.ndarray, float]]:
    """Rows (3,) with bounds in m that hold inside a region."""
    rows = np.vstack([region.sides, region.normal, -region.normal])
    return list(zip(rows, [*region.bounds.tolist(), region.height, -region.height], strict=True))


def _placed(task: Footsteps, chosen: np.ndarray) -> ContactSequence | None:
    """The contacts with the shortest ways of the feet in regions (count,); None where no steps fit them."""
    builder = Builder()
    places = add_places(builder, task)
    for step, number in enumerate(chosen):
        for row, bound in _rows(task.regions[number]):
            builder.row((row, places[step + 2]), high=bound)
        for along in task.axes[:2]:
            builder.absolute(1.0, _MOST, (along, places[step + 2]), (-along, places[step]))
    x = solution(builder.finished())
    return None if x is None else task.sequence(x[places[2:]], chosen)
