"""Contacts of a run and how far their patches slipped, from recorded forces and poses alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.limb import Limb

BEARING_FORCE = 20.0  # N; a patch that carries more is in contact: less is the noise of a touch
CONTACT_GAP = 0.03  # s; shorter interruptions do not end a contact: soles chatter
SETTLE_TIME = 0.02  # s; from touchdown to the pose that slip is counted from: the impact belongs to the touchdown error


@dataclass(frozen=True)
class ContactInterval:
    """A patch bore force from one sample to another.

    Attributes:
        limb: which.
        first, last: samples, both included.
        slip: m; largest tangential displacement of any corner of the patch from its pose once settled.
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
    *,
    threshold: float,
    gap: int,
    settle: int,
) -> list[ContactInterval]:
    """Contacts of one limb.

    A contact begins with the first sample above `threshold` and ends with the last before at least `gap` samples below
    it. Slip is counted from the pose `settle` samples after its beginning (the impact of touchdown belongs to the
    touchdown error) to its very end, and for the whole of contacts that are shorter.

    Args:
        limb: which.
        normal_force: (C,) N.
        position: (C, 3) m.
        rotation: (C, 3, 3) world_from_patch.
        half_size: (2,) m.
        threshold: N.
        gap: samples.
        settle: samples.

    Returns:
        Contacts in order of time.
    """
    loaded = np.flatnonzero(normal_force > threshold)
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
