"""How a network's first output changes with a transition: the part of its gradient that transitions can have.

Features lie on a surface: axes are orthonormal, the feet's mean is the origin and their mean heading is x. A gradient
means something only along it, so rotations are taken as rotation vectors, and what moves both feet alike is dropped.
"""

from __future__ import annotations

import torch

from toolkit.geometry.limb import FEET
from toolkit.learning.sensitivity import PART
from toolkit.prediction.features import CONTACT, STATE

TURN = 0.15  # rad; unit of rotations, about as much as surfaces differ; the unit of anything else is its spread
_FEET = len(FEET)


class TangentSpace:
    """Derivatives along the surface of canonical features, per unit of each.

    Args:
        features: (n, d) of the training set, whose spreads are the units.
    """

    def __init__(self, features: torch.Tensor):
        self._contacts = (features.shape[1] - STATE) // CONTACT
        spread = features.std(0)
        places = spread[: CONTACT * self._contacts].reshape(-1, CONTACT)[:, :3]
        units = torch.cat([places, torch.full_like(places, TURN)], 1)
        self._units = torch.cat([units.flatten(), spread[CONTACT * self._contacts :]])

    def of_gradient(self, features: torch.Tensor, gradient: torch.Tensor) -> torch.Tensor:
        """Derivatives (n, k) of a function whose gradient (n, d) in the features is given."""
        cut = CONTACT * self._contacts
        axes = features[:, :cut].reshape(-1, self._contacts, 3, 3)
        parts = gradient[:, :cut].reshape(-1, self._contacts, 3, 3)
        turns = torch.linalg.cross(axes[:, :, 1:], parts[:, :, 1:]).sum(2)  # d axis = rotation vector x axis
        contacts = torch.cat([parts[:, :, 0], turns], -1)
        return self.of_sensitivity(features, torch.cat([contacts.flatten(1), gradient[:, cut:]], 1))

    def of_sensitivity(self, features: torch.Tensor, sensitivity: torch.Tensor) -> torch.Tensor:
        """Derivatives (n, k) from those of `learning.sensitivity` (n, k)."""
        feet = sensitivity[:, : PART * _FEET].reshape(-1, _FEET, PART)
        heading = self._heading(features)
        places = feet[..., :3] - feet[..., :3].mean(1, keepdim=True)
        turns = feet[..., 3:] - heading * (feet[..., 3:] * heading).sum((1, 2), keepdim=True)
        contacts = torch.cat([places, turns], -1).flatten(1)
        return torch.cat([contacts, sensitivity[:, PART * _FEET :]], 1) * self._units

    @staticmethod
    def _heading(features: torch.Tensor) -> torch.Tensor:
        """(n, 2, 3) unit vectors: how the mean heading changes with the feet's rotation vectors."""
        x = features[:, : CONTACT * _FEET].reshape(-1, _FEET, 3, 3)[:, :, 1]
        level = x[..., 0] ** 2 + x[..., 1] ** 2
        change = torch.stack([-x[..., 0] * x[..., 2], -x[..., 1] * x[..., 2], level], -1) / level[..., None]
        return change / change.flatten(1).norm(dim=1)[:, None, None]
