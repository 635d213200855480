"""How well the networks predict the optimiser on transitions that they have not seen (paper, Fig. 8)."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from toolkit.errors import DatasetError
from toolkit.learning.samples import Samples
from toolkit.prediction.features import AHEAD, ahead
from toolkit.prediction.network import TransitionNetwork


@dataclass(frozen=True)
class Score:
    """One row of the table.

    Attributes:
        samples: Number of test transitions.
        feasible_share: Share of them that are feasible.
        accuracy: Share of them whose feasibility is predicted correctly.
        mean_objective: Mean objective of those whose outcome is known.
        objective_error: Mean absolute error of the objective.
        com_error: Mean distance between the predicted and the optimised final CoM, in m.
        velocity_error: The same for the final CoM velocity, in m/s.
        objective_tail: Error of the objective that one in a hundred exceeds.
    """

    samples: int
    feasible_share: float
    accuracy: float
    mean_objective: float
    objective_error: float
    com_error: float
    velocity_error: float
    objective_tail: float

    @property
    def relative_objective_error(self) -> float:
        """Mean absolute error of the objective over its mean."""
        return self.objective_error / self.mean_objective


def score(network: TransitionNetwork, samples: Samples) -> Score:
    """Score a network; the regressor is tested on the transitions whose outcome is known.

    Raises:
        DatasetError: There is none.
    """
    known = samples.known
    if not known.any():
        raise DatasetError(f"category {int(network.category)}: no outcome to test on; collect more")
    targets = samples.targets[known]
    outputs = network.predict(samples.features[known], ahead(samples.goal[known]))
    error = np.abs(outputs[:, 0] - targets[:, 0])
    return Score(
        samples=len(samples),
        feasible_share=float(samples.feasible.mean()),
        accuracy=float((network.feasible(samples.features) == samples.feasible).mean()),
        mean_objective=float(targets[:, 0].mean()),
        objective_error=float(error.mean()),
        com_error=float(np.linalg.norm(outputs[:, 1:4] - targets[:, 1:4], axis=1).mean()),
        velocity_error=float(np.linalg.norm(outputs[:, 4:7] - targets[:, 4:7], axis=1).mean()),
        objective_tail=float(np.percentile(error, 99.0)),
    )


def balanced(samples: Samples, count: int, rng: np.random.Generator) -> Samples:
    """A random test set of `count` transitions; the rarer label is raised to a share of 25 % where it has less.

    Of the feasible transitions, those whose outcome is known come first.
    """
    order = rng.permutation(len(samples))
    order = order[np.argsort(~(samples.known | ~samples.feasible)[order], kind="stable")]
    labels = samples.feasible[order]
    head = labels[:count]
    least = int(np.ceil(0.25 * count))
    wanted = int(np.clip(head.sum(), least, count - least))
    return samples.select(np.concatenate([order[labels][:wanted], order[~labels][: count - wanted]]))


def query_seconds(network: TransitionNetwork, batch: int) -> float:
    """Median time in s to predict the feasibility, objective and CoM state of a batch of transitions."""
    features = np.random.default_rng(0).uniform(network.lower, network.upper, (batch, len(network.lower)))
    features = features.astype(np.float32)
    times = []
    for _ in range(200):
        start = time.perf_counter()
        network.feasible(features)
        network.predict(features, np.zeros(AHEAD))
        times.append(time.perf_counter() - start)
    return float(np.median(times))
