"""Calibration within one world: what ranks its sequences as their motions do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from validation.jobs import Record

PREDICTORS = {"predicted": "judged", "contacts": "transitions", "duration": "walking_seconds"}
"""Predictors of J, and where an entry has them."""


@dataclass(frozen=True)
class WorldFigures:
    """Figures of one world.

    Attributes:
        sequences: Comparable sequences: different ones that are feasible and that the networks accept.
        ranks: Rank correlation of each predictor with J; None where either is the same for all sequences.
        ratios: J over the prediction of each sequence.
        regret: True cost of the search's favourite over that of the truly best sequence that it returned, minus 1.
        regrets: The same of the sequences that each predictor would choose among them.
    """

    sequences: int
    ranks: dict[str, float | None]
    ratios: list[float]
    regret: float | None
    regrets: dict[str, float | None]


def world_figures(records: Sequence[Record], ours: str) -> WorldFigures:
    """Figures of a world.

    Args:
        records: Of the planners' searches in this world, with their `entries`.
        ours: The planner whose first search's choice is judged.
    """
    entries = [entry for record in records for entry in record["entries"]]
    compared = list({_identity(entry): entry for entry in entries if entry.get("judged")}.values())
    truth = [entry["objective"] for entry in compared]
    first = (record for record in records if record["planner"] == ours and record["search"] == 0)
    returned = [entry for record in first for entry in record["entries"]]
    feasible = [entry for entry in returned if entry["feasible"]]
    return WorldFigures(
        sequences=len(compared),
        ranks={name: rank_correlation([e[key] for e in compared], truth) for name, key in PREDICTORS.items()},
        ratios=[entry["objective"] / entry["judged"] for entry in compared],
        regret=regret(feasible, "search_cost"),
        regrets={name: regret(feasible, key) for name, key in PREDICTORS.items()},
    )


def _identity(entry: Record) -> tuple:
    """What tells different sequences of a world apart."""
    return entry["transitions"], entry["objective"], entry["judged"]


def rank_correlation(predicted: Sequence[float], truth: Sequence[float]) -> float | None:
    """Spearman's rank correlation; None where either is the same for all."""
    if len(set(predicted)) < 2 or len(set(truth)) < 2:
        return None
    return float(np.asarray(spearmanr(predicted, truth))[0])


def regret(feasible: Sequence[Record], key: str) -> float | None:
    """How far the true cost of the entry with the least `key` is above the least true cost; None without entries."""
    known = [entry for entry in feasible if entry.get(key) is not None]
    if not known:
        return None
    best = min(entry["true_cost"] for entry in feasible)
    return min(known, key=lambda entry: entry[key])["true_cost"] / best - 1.0
