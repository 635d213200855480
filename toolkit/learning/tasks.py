"""What networks learn: whether a transition is feasible, and what comes of it."""

from __future__ import annotations

import torch
from torch import nn

from toolkit.learning.layers import with_gradient
from toolkit.learning.samples import AT_DEFAULT
from toolkit.learning.tangent import TangentSpace
from toolkit.prediction.features import TARGETS

WIDTH = 0.02  # of the smooth L1 loss, below which it is quadratic, in standard deviations of an output
SENSITIVITY_WIDTH = 0.005  # the same for derivatives: nearly L1, for the objective has edges
OBJECTIVE_WEIGHT = 3.0  # of the objective's loss beside those of the six other outputs
DEFAULT_WEIGHT = 3.0  # samples without the paper's timing and friction take part in one of so many epochs


class Classification:
    """Inputs (n, d), and whether each is feasible (n, 1)."""

    def __init__(self, inputs: torch.Tensor, targets: torch.Tensor):
        self._inputs, self._targets = inputs, targets
        self.share = torch.ones(len(inputs), dtype=torch.float64, device=inputs.device)

    def loss(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        """See `Task`."""
        return nn.functional.binary_cross_entropy_with_logits(net(self._inputs[rows]).float(), self._targets[rows])

    error = loss


class Regression:
    """Inputs (n, d) and scaled outputs (n, 7), by the smooth L1 loss; the derivatives of the objective where known.

    Args:
        features: (n, d) as data sets hold them.
        inputs: (n, d) the same, z-scored.
        std: (d,) by which they were divided.
        targets: (n, 7) scaled outputs.
        slopes: (n, k) derivatives of the first target (`learning.sensitivity`), NaN where unknown.
        sensitivity_weight: weight of the loss of the derivatives; 0: they are left out.
    """

    def __init__(
        self,
        features: torch.Tensor,
        inputs: torch.Tensor,
        std: torch.Tensor,
        targets: torch.Tensor,
        slopes: torch.Tensor,
        sensitivity_weight: float,
    ):
        self._features, self._inputs, self._std, self._targets = features, inputs, std, targets
        self._sensitivity_weight = sensitivity_weight
        self._weights = torch.ones(TARGETS, device=targets.device)
        self._weights[0] = OBJECTIVE_WEIGHT
        default = features.new_tensor(AT_DEFAULT)
        others = ((features[:, -3:] - default).abs() > 1e-5).any(1)
        self.share = torch.where(others, 1.0 / DEFAULT_WEIGHT, 1.0).double()
        if others.all():
            self.share[:] = 1.0
        self._known = ~slopes.isnan().any(1)
        self._differentiates = sensitivity_weight > 0.0 and bool(self._known.any())
        if self._differentiates:
            self._tangent = TangentSpace(features)
            self._slopes = self._tangent.of_sensitivity(features, slopes.nan_to_num())

    def loss(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        """See `Task`."""
        if not self._differentiates:
            return self._of_values(net(self._inputs[rows]), rows).mean()
        outputs, gradient = with_gradient(net, self._inputs[rows])
        found = self._tangent.of_gradient(self._features[rows], gradient.float() / self._std)
        each = nn.functional.smooth_l1_loss(found, self._slopes[rows], beta=SENSITIVITY_WIDTH, reduction="none").mean(1)
        slope = (each * self._known[rows]).mean()
        return self._of_values(outputs, rows).mean() + self._sensitivity_weight * slope

    def error(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        """See `Task`: the loss of the values alone, each sample by its share."""
        share = self.share[rows].float()
        return (self._of_values(net(self._inputs[rows]), rows) * share).sum() / share.sum()

    def _of_values(self, outputs: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
        """(n,) loss of each sample's outputs."""
        each = nn.functional.smooth_l1_loss(outputs.float(), self._targets[rows], beta=WIDTH, reduction="none")
        return (each * self._weights).mean(1)
