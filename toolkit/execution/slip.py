"""The contacts of a run and how far their patches slipped, from recorded forces and poses alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.robot.scale import force_factor

_BEARING_FORCE = 20.0  # N for a body of the usual size; a patch that carries more is in contact; less is a mere touch
# Times belong to the simulated contacts and not to the body. So they are the same for all sizes, as the limit on slip
# is, which users know in m.
CONTACT_GAP = 0.03  # s; shorter interruptions do not end a contact: soles chatter
SETTLE_TIME = 0.02  # s; from touchdown to the pose that slip is counted from, because the impact moves the patch


def bearing_force(mass: float) -> float:
    """N; a patch of a robot of a mass in kg that carries more is in contact, one that carries less merely touches."""
    return force_factor(mass) * _BEARING_FORCE


@dataclass(frozen=True)
class ContactInterval:
    """A contact of a limb, with its first and last sample.

    Attributes:
        slip: Largest tangential displacement of any corner of the patch from its settled pose, in m.
    """

    limb: Limb
    first: int
    last: int
    slip: float


def contact_intervals(
    limb: Limb,
    normal_force: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
    half_size: np.ndarray,
    period: float,
    bearing: float,
) -> list[ContactInterval]:
    """Contacts of one limb, in order of time.

    A contact lasts while the force is above `bearing`, interruptions of up to `CONTACT_GAP` included. Slip is
    counted from the pose `SETTLE_TIME` after its begin (the impact belongs to the touchdown error) to its end, and for
    the whole of contacts that are shorter.

    Args:
        limb: The limb.
        normal_force: Forces (C,) in N.
        position: Centres (C, 3) of the patch in m.
        rotation: Rotations (C, 3, 3), world_from_patch.
        half_size: Half extents (2,) of the patch in m.
        period: Time between samples in s.
        bearing: N; see `bearing_force`.
    """
    gap, settle = round(CONTACT_GAP / period), round(SETTLE_TIME / period)
    loaded = np.flatnonzero(normal_force > bearing)
    if not len(loaded):
        return []
    breaks = np.flatnonzero(np.diff(loaded) > gap)
    firsts, lasts = loaded[np.r_[0, breaks + 1]], loaded[np.r_[breaks, len(loaded) - 1]]
    corners = np.array([[a, b, 0.0] for a in (-1.0, 1.0) for b in (-1.0, 1.0)]) * np.r_[half_size, 0.0]
    result = []
    for first, last in zip(firsts, lasts, strict=True):
        start = first + settle if first > 0 and first + settle < last else first
        span = slice(start, last + 1)
        points = position[span, None] + np.einsum("kij,cj->kci", rotation[span], corners)
        moved = (points - points[0]) @ rotation[start]
        slip = np.hypot(moved[..., 0], moved[..., 1]).max()
        result.append(ContactInterval(limb, int(first), int(last), float(slip)))
    return result
