"""The heading of two feet: the direction between the directions in which they point."""

from __future__ import annotations

import numpy as np

from toolkit.compiled import law


@law
def mean_heading(one, other):
    """Circular mean in rad of two headings: the direction of the sum of their unit vectors.

    Args:
        one: (...,) rad.
        other: (...,) rad.
    """
    return np.arctan2(np.sin(one) + np.sin(other), np.cos(one) + np.cos(other))


@law
def wrapped(angle):
    """The same angle (...,) in [-pi, pi]."""
    return np.arctan2(np.sin(angle), np.cos(angle))
