"""How well the networks predict the optimiser, on transitions that they have not seen (paper, Fig. 8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.errors import DatasetError
from toolkit.learning.dataset import Samples
from toolkit.prediction.network import TransitionNetwork
from toolkit.world.timing import Timing

DEFAULT_FRICTION = 0.5
AT_DEFAULT = (Timing().shift, Timing().swing, DEFAULT_FRICTION)
"""Last features of transitions with the paper's timing and friction."""


@dataclass(frozen=True)
class Score:
    """One row of the table.

    Attributes:
        samples: transitions tested.
        feasible_share: of them that are feasible.
        accuracy: share whose feasibility is predicted right.
        mean_objective: of the feasible ones.
        objective_error: mean absolute error.
        com_error: mean distance between predicted and optimised final CoM, m.
        velocity_error: the same for the final CoM velocity, m/s.
    """

    samples: int
    feasible_share: float
    accuracy: float
    mean_objective: float
    objective_error: float
    com_error: float
    velocity_error: float

    @property
    def relative_objective_error(self) -> float:
        """Mean absolute error of the objective over its mean."""
        return self.objective_error / self.mean_objective


def score(network: TransitionNetwork, samples: Samples) -> Score:
    """Score a network; the regressor is judged on the transitions that are feasible.

    Raises:
        DatasetError: none of the samples is feasible.
    """
    if not samples.feasible.any():
        raise DatasetError(f"category {int(network.category)}: no feasible transition to test on; collect more")
    targets = samples.targets[samples.feasible]
    outputs = network.predict(samples.features[samples.feasible])
    return Score(
        samples=len(samples),
        feasible_share=float(samples.feasible.mean()),
        accuracy=float((network.feasible(samples.features) == samples.feasible).mean()),
        mean_objective=float(targets[:, 0].mean()),
        objective_error=float(np.abs(outputs[:, 0] - targets[:, 0]).mean()),
        com_error=float(np.linalg.norm(outputs[:, 1:4] - targets[:, 1:4], axis=1).mean()),
        velocity_error=float(np.linalg.norm(outputs[:, 4:7] - targets[:, 4:7], axis=1).mean()),
    )


def at_default(samples: Samples) -> Samples:
    """The samples with the paper's timing (1 s + 1 s) and friction (0.5)."""
    wanted = np.array(AT_DEFAULT, np.float32)
    return samples.select(np.flatnonzero(np.isclose(samples.features[:, -3:], wanted, rtol=0, atol=1e-5).all(1)))


def balanced(samples: Samples, count: int, rng: np.random.Generator, *, least_share: float = 0.25) -> Samples:
    """A test set of `count` transitions in which neither label falls under `least_share`.

    Takes the samples as they come and replaces only as many of the commoner label as it must.
    """
    order = rng.permutation(len(samples))
    labels = samples.feasible[order]
    head = labels[:count]
    least = int(np.ceil(least_share * count))
    wanted = int(np.clip(head.sum(), least, count - least))
    return samples.select(np.concatenate([order[labels][:wanted], order[~labels][: count - wanted]]))
