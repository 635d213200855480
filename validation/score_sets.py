"""Scores of the networks over several test sets: the median set, the worst one, and the tails of the errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from toolkit.learning.evaluate import score
from toolkit.learning.samples import Samples
from toolkit.prediction.features import ahead
from toolkit.prediction.network import TransitionNetwork

TAILS = (50.0, 90.0, 99.0)  # %; quantiles of the errors


@dataclass(frozen=True)
class SetScore:
    """Figures of one category on one test set, or one figure each of several sets.

    Attributes:
        infeasible: Share of infeasible transitions.
        accuracy: Share of the transitions whose feasibility is predicted correctly.
        mean_objective: Mean objective of those whose outcome is known.
        objective_error: Mean absolute error of the objective.
        relative_error: The same over the mean objective.
        com_error: m; mean distance between the predicted and the true final CoM.
        velocity_error: m/s; the same of its velocity.
    """

    infeasible: float
    accuracy: float
    mean_objective: float
    objective_error: float
    relative_error: float
    com_error: float
    velocity_error: float

    @classmethod
    def of(cls, network: TransitionNetwork, samples: Samples) -> SetScore:
        """Figures of a network on a set."""
        row = score(network, samples)
        return cls(
            1.0 - row.feasible_share,
            row.accuracy,
            row.mean_objective,
            row.objective_error,
            row.relative_objective_error,
            row.com_error,
            row.velocity_error,
        )


@dataclass(frozen=True)
class Scores:
    """A category on several test sets.

    Attributes:
        median: Median over the sets of every figure.
        worst: The worst set: the highest errors, the lowest accuracy, each figure by itself.
        relative, com, velocity: Errors at the quantiles `TAILS` of the transitions of all sets together: of the
            objective over its mean, of the CoM in m, of its velocity in m/s.
    """

    median: SetScore
    worst: SetScore
    relative: list[float]
    com: list[float]
    velocity: list[float]

    @classmethod
    def of(cls, network: TransitionNetwork, sets: Sequence[Samples]) -> Scores:
        """Figures of a network on the sets of its category."""
        rows = [SetScore.of(network, samples) for samples in sets]
        columns = {item.name: [getattr(row, item.name) for row in rows] for item in fields(SetScore)}
        worst = {name: min(column) if name == "accuracy" else max(column) for name, column in columns.items()}
        errors = [np.concatenate(parts) for parts in zip(*(_errors(network, samples) for samples in sets), strict=True)]
        return cls(
            SetScore(**{name: float(np.median(column)) for name, column in columns.items()}),
            SetScore(**worst),
            *(np.percentile(error, TAILS).tolist() for error in errors),
        )


def _errors(network: TransitionNetwork, samples: Samples) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of transitions with a known outcome: of the objective over the set's mean, CoM (m), velocity (m/s)."""
    samples = samples.select(samples.known)
    targets, outputs = samples.targets, network.predict(samples.features, ahead(samples.goal))
    relative = np.abs(outputs[:, 0] - targets[:, 0]) / targets[:, 0].mean()
    com, velocity = (np.linalg.norm((outputs - targets)[:, part], axis=1) for part in (slice(1, 4), slice(4, 7)))
    return relative, com, velocity
