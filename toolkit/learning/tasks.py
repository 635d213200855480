"""What networks learn: whether a transition is feasible, and its outcome."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import nn

from toolkit.prediction.features import TARGETS
from toolkit.world.timing import Timing

WIDTH = 0.02  # standard deviations of an output; below this the smooth L1 loss is quadratic
OBJECTIVE_WEIGHT = 3.0  # weight of the objective's loss; the six other outputs have the weight 1
USUAL_WEIGHT = 3.0  # samples with other timings than the usual ones take part in one of so many epochs


class Classification:
    """Learns from inputs (n, d) whether each is feasible (n, 1); all samples take part in every epoch."""

    def __init__(self, inputs: torch.Tensor, targets: torch.Tensor):
        self._inputs, self._targets = inputs, targets
        self.share = torch.ones(len(inputs), dtype=torch.float64, device=inputs.device)

    def loss(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        """Logistic loss of these rows, for training and validation."""
        return nn.functional.binary_cross_entropy_with_logits(net(self._inputs[rows]).float(), self._targets[rows])

    error = loss


class Regression:
    """Learns outputs by the smooth L1 loss.

    `share` (n,) is the share of the epochs in which each sample takes part.

    Args:
        timing: (n, 2) shift and swing of each sample in s.
        inputs: (n, d) z-scored features.
        targets: (n, 7) scaled outputs.
        usual: Timings that matter most.
    """

    def __init__(self, timing: torch.Tensor, inputs: torch.Tensor, targets: torch.Tensor, usual: Iterable[Timing]):
        self._inputs, self._targets = inputs, targets
        self._weights = torch.ones(TARGETS, device=targets.device)
        self._weights[0] = OBJECTIVE_WEIGHT
        times = timing.new_tensor([(item.shift, item.swing) for item in usual])
        others = ((timing[:, None] - times).abs() > 1e-5).any(2).all(1)
        self.share = torch.where(others, 1.0 / USUAL_WEIGHT, 1.0).double()
        if others.all():
            self.share[:] = 1.0

    def loss(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        """Loss of these rows for training."""
        return self._of_values(net(self._inputs[rows]), rows).mean()

    def error(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        """Loss of these rows for validation, each sample weighted by its share."""
        share = self.share[rows].float()
        return (self._of_values(net(self._inputs[rows]), rows) * share).sum() / share.sum()

    def _of_values(self, outputs: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
        """(n,) loss of each sample's outputs."""
        each = nn.functional.smooth_l1_loss(outputs.float(), self._targets[rows], beta=WIDTH, reduction="none")
        return (each * self._weights).mean(1)
