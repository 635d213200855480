"""Derivatives of the optimiser's objective in the canonical frame of features, and transitions decoded from features.

Derivatives are taken with respect to the place (3) and a rotation vector (3) of each contact, in the order of
`features.encode`, then to the CoM (3), its velocity (3), shift, swing and friction. They are NaN where unknown.
"""

from __future__ import annotations

import numpy as np

from toolkit.centroidal import fast
from toolkit.contacts.category import Category
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.prediction.features import MIRROR, STATE, TIMING_AND_FRICTION, Canonical
from toolkit.world.timing import Timing

PART = 6  # numbers per contact
_NEW = len(Limb)  # row of the new contact in `fast.Sensitivity.contacts`


def sensitivity_size(category: Category) -> int:
    """Number of derivatives of a category."""
    return PART * len(category.contact_limbs) + STATE


def unknown_sensitivity(category: Category, count: int) -> np.ndarray:
    """(count, sensitivity_size) float32 derivatives that are all unknown."""
    return np.full((count, sensitivity_size(category)), np.nan, np.float32)


def canonical(frame: Canonical, category: Category, found: fast.Sensitivity) -> np.ndarray:
    """(sensitivity_size,) derivatives in the frame of a transition's features, from those in the world."""
    rows = [int(limb.mirrored if frame.mirrored else limb) for limb in category.before] + [_NEW] * category.makes
    parts = found.contacts[rows].reshape(-1, 2, 3)
    turned = frame.vector(parts)
    if frame.mirrored:
        turned[:, 1] *= -1.0  # a mirror reverses rotations
    others = found.others.copy()
    others[:3], others[3:6] = frame.vector(others[:3]), frame.vector(others[3:6])
    return np.concatenate([turned.ravel(), others])


def decode(
    features: np.ndarray, category: Category, *, mirrored: bool = False
) -> tuple[Stance, np.ndarray, np.ndarray, ContactTransition]:
    """The transition that has given features: the inverse of `features.encode`.

    Args:
        features: (d,) Features of one transition. Axes are made orthonormal again.
        category: Category of the transition.
        mirrored: Whether a right limb moves. This is the mirror image, which has the same features.

    Returns:
        Stance, CoM (3,) in m, its velocity (3,) in m/s, and the transition, all in the canonical frame.
    """
    limbs = [limb.mirrored if mirrored else limb for limb in category.contact_limbs]
    values = np.asarray(features, float)
    vectors = values[: TIMING_AND_FRICTION.start].reshape(-1, 3) * (MIRROR if mirrored else 1.0)
    shift, swing, friction = values[TIMING_AND_FRICTION].tolist()
    contacts = []
    for limb, (place, x, z) in zip(limbs, vectors[:-2].reshape(-1, 3, 3), strict=True):
        z = z / np.linalg.norm(z)
        x = x - (x @ z) * z
        x /= np.linalg.norm(x)
        contacts.append(Contact(limb, Pose(np.column_stack([x, np.cross(z, x), z]), place), friction))
    new = contacts.pop() if category.makes else None
    stance = Stance(tuple(sorted(contacts, key=lambda contact: contact.limb)))
    moving = category.moving.mirrored if mirrored else category.moving
    return stance, vectors[-2], vectors[-1], ContactTransition(moving, new, Timing(shift, swing))
