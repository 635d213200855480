"""What networks learn: whether a transition is feasible, and its outcome."""

from __future__ import annotations

import torch
from torch import nn

from toolkit.geometry.limb import FEET
from toolkit.learning.layers import with_gradient
from toolkit.learning.samples import AT_DEFAULT
from toolkit.learning.sensitivity import PART
from toolkit.prediction.features import CONTACT, STATE, TARGETS

WIDTH = 0.02  # standard deviations of an output; below this the smooth L1 loss is quadratic
SENSITIVITY_WIDTH = 0.005  # the same for derivatives; small, because the objective has edges
OBJECTIVE_WEIGHT = 3.0  # weight of the objective's loss; the six other outputs have the weight 1
DEFAULT_WEIGHT = 3.0  # samples without the paper's timing and friction take part in one of this many epochs
TURN = 0.15  # rad; unit of rotations, about as much as surfaces differ; the unit of other features is their spread
_FEET = len(FEET)


class Classification:
    """Learns from inputs (n, d) whether each is feasible (n, 1); all samples take part in every epoch."""

    def __init__(self, inputs: torch.Tensor, targets: torch.Tensor):
        self._inputs, self._targets = inputs, targets
        self.share = torch.ones(len(inputs), dtype=torch.float64, device=inputs.device)

    def loss(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        """Logistic loss of these rows, for training and validation."""
        return nn.functional.binary_cross_entropy_with_logits(net(self._inputs[rows]).float(), self._targets[rows])

    error = loss


class TangentSpace:
    """Derivatives of a network's first output along the surface of canonical features, per unit of each.

    Features lie on a surface: axes are orthonormal, the feet's mean is the origin and their mean heading is x. A
    gradient means something only along this surface. So rotations are taken as rotation vectors, and motions that move
    both feet alike are left out.

    Args:
        features: (n, d) Features of the training set, whose spreads are the units.
    """

    def __init__(self, features: torch.Tensor):
        self._contacts = (features.shape[1] - STATE) // CONTACT
        spread = features.std(0)
        places = spread[: CONTACT * self._contacts].reshape(-1, CONTACT)[:, :3]
        units = torch.cat([places, torch.full_like(places, TURN)], 1)
        self._units = torch.cat([units.flatten(), spread[CONTACT * self._contacts :]])

    def of_gradient(self, features: torch.Tensor, gradient: torch.Tensor) -> torch.Tensor:
        """Derivatives (n, k) of a function that has the gradient (n, d) in the features."""
        cut = CONTACT * self._contacts
        axes = features[:, :cut].reshape(-1, self._contacts, 3, 3)
        parts = gradient[:, :cut].reshape(-1, self._contacts, 3, 3)
        turns = torch.linalg.cross(axes[:, :, 1:], parts[:, :, 1:]).sum(2)  # d axis = rotation vector x axis
        contacts = torch.cat([parts[:, :, 0], turns], -1)
        return self.of_sensitivity(features, torch.cat([contacts.flatten(1), gradient[:, cut:]], 1))

    def of_sensitivity(self, features: torch.Tensor, sensitivity: torch.Tensor) -> torch.Tensor:
        """Derivatives (n, k) from sensitivities (n, k), see `learning.sensitivity`."""
        feet = sensitivity[:, : PART * _FEET].reshape(-1, _FEET, PART)
        heading = self._heading(features)
        places = feet[..., :3] - feet[..., :3].mean(1, keepdim=True)
        turns = feet[..., 3:] - heading * (feet[..., 3:] * heading).sum((1, 2), keepdim=True)
        contacts = torch.cat([places, turns], -1).flatten(1)
        return torch.cat([contacts, sensitivity[:, PART * _FEET :]], 1) * self._units

    @staticmethod
    def _heading(features: torch.Tensor) -> torch.Tensor:
        """(n, 2, 3) change of the mean heading with the feet's rotation vectors, normalised."""
        x = features[:, : CONTACT * _FEET].reshape(-1, _FEET, 3, 3)[:, :, 1]
        level = x[..., 0] ** 2 + x[..., 1] ** 2
        change = torch.stack([-x[..., 0] * x[..., 2], -x[..., 1] * x[..., 2], level], -1) / level[..., None]
        return change / change.flatten(1).norm(dim=1)[:, None, None]


class Regression:
    """Learns outputs by the smooth L1 loss, and the derivatives of the objective where they are known.

    `share` (n,) is the share of the epochs in which each sample takes part.

    Args:
        features: (n, d) Features as data sets hold them.
        inputs: (n, d) The same features, z-scored.
        std: (d,) Standard deviations that divided the features.
        targets: (n, 7) Scaled outputs.
        slopes: (n, k) Derivatives of the first target (`learning.sensitivity`), NaN where unknown.
        sensitivity_weight: Weight of the loss of the derivatives; 0 leaves them out.
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
        """Loss of these rows for training."""
        if not self._differentiates:
            return self._of_values(net(self._inputs[rows]), rows).mean()
        outputs, gradient = with_gradient(net, self._inputs[rows])
        found = self._tangent.of_gradient(self._features[rows], gradient.float() / self._std)
        each = nn.functional.smooth_l1_loss(found, self._slopes[rows], beta=SENSITIVITY_WIDTH, reduction="none").mean(1)
        slope = (each * self._known[rows]).mean()
        return self._of_values(outputs, rows).mean() + self._sensitivity_weight * slope

    def error(self, net: nn.Sequential, rows: torch.Tensor) -> torch.Tensor:
        """Loss of these rows for validation: that of the values alone, each sample weighted by its share."""
        share = self.share[rows].float()
        return (self._of_values(net(self._inputs[rows]), rows) * share).sum() / share.sum()

    def _of_values(self, outputs: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
        """(n,) loss of each sample's outputs."""
        each = nn.functional.smooth_l1_loss(outputs.float(), self._targets[rows], beta=WIDTH, reduction="none")
        return (each * self._weights).mean(1)
