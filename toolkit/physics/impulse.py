"""The impulses that contacts can give.

A contact's force lies in its friction cone, which is convex, and so does the force's integral over time with any
weights that are not negative: the impulse, and its first moment, in which a force counts by the time that is left.
What several contacts give lies in the sum of their cones.
"""

from __future__ import annotations

import numpy as np

_SWEEPS = 20
_CLOSE = 1e-9  # change of a part, per its vector, below which the nearest sum is found


def nearest_sum(vectors: np.ndarray, normals: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """The vectors nearest to given ones that are sums of vectors of friction cones.

    Args:
        vectors: (n, 3).
        normals: (k, 3) unit vectors; axes of the cones.
        friction: (k,) Coulomb coefficients.

    Returns:
        (n, 3). Cones with the same axis count once, as the widest of them. The parts in different cones are moved in
        turn, each as near as it can be to what the others leave, until a part in a thousand is left or less.
    """
    cones: list[tuple[np.ndarray, float]] = []
    for normal, mu in sorted(zip(normals, friction, strict=True), key=lambda cone: -cone[1]):
        if not any(np.allclose(normal, other) for other, _ in cones):
            cones.append((normal, float(mu)))
    if len(cones) == 1:
        return _nearest(vectors, *cones[0])
    parts, size = np.zeros((len(cones), *vectors.shape)), np.linalg.norm(vectors)
    for _ in range(_SWEEPS):
        before = parts.copy()
        for index, cone in enumerate(cones):
            parts[index] = _nearest(vectors - parts.sum(0) + parts[index], *cone)
        if np.abs(parts - before).max(initial=0.0) <= _CLOSE * size:
            break
    return parts.sum(0)


def _nearest(vectors: np.ndarray, normal: np.ndarray, friction: float) -> np.ndarray:
    """(n, 3); the vectors of one cone that are nearest to given ones."""
    along = vectors @ normal
    across = vectors - along[:, None] * normal
    length = np.linalg.norm(across, axis=1)
    outside = length > friction * along
    pressed = np.maximum(along + friction * length, 0.0) / (1.0 + friction**2)
    turned = across / np.maximum(length, 1e-12)[:, None]
    return np.where(outside[:, None], pressed[:, None] * (normal + friction * turned), vectors)
