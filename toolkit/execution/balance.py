"""Whether a run ends in balance, and not in a fall that has only begun.

Reference:
    Pratt, Carff, Drakunov, Goswami: Capture point: a step toward humanoid push recovery, Humanoids 2006.
"""

from __future__ import annotations

import numpy as np
import shapely


def unbalance(
    com: np.ndarray,
    velocity: np.ndarray,
    centres: np.ndarray,
    rotations: np.ndarray,
    halves: np.ndarray,
    gravity: float,
) -> float:
    """Distance in m by which the capture point lies outside the convex hull of the patches that bear the robot.

    Within the hull the robot can come to rest without another contact, beyond it it falls. A palm's patch counts as
    the soles do, by its place in the plane.

    Args:
        com: (3,) m.
        velocity: (3,) m/s; of the CoM.
        centres: (k, 3) m; of the patches, one at least.
        rotations: (k, 3, 3) world_from_patch.
        halves: (k, 2) m; half extents of the patches.
        gravity: m/s^2.
    """
    height = max(com[2] - centres[:, 2].min(), 1e-3)
    capture = com[:2] + velocity[:2] * np.sqrt(height / gravity)
    signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)])
    local = np.concatenate([signs * halves[:, None], np.zeros((len(halves), 4, 1))], axis=2)
    corners = centres[:, None] + np.einsum("kij,kcj->kci", rotations, local)
    support = shapely.convex_hull(shapely.multipoints(corners.reshape(-1, 3)[:, :2]))
    return float(shapely.distance(support, shapely.points(capture)))
