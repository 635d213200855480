"""Planes that are not vertical: their height above a place, and the heading along them."""

from __future__ import annotations

import numpy as np

from toolkit.compiled import law


@law
def plane_height(origin, normal, x, y):
    """Height in m of the plane with the point `origin` (3,) m and the normal (3,) above places x and y (...,) in m."""
    return origin[2] - (normal[0] * (x - origin[0]) + normal[1] * (y - origin[1])) / normal[2]


@law
def along_plane(normal, c, s):
    """The unit vector, as three numbers, along a plane and above the heading with cosine c and sine s."""
    ax, ay, az = c * normal[2], s * normal[2], -(c * normal[0] + s * normal[1])
    length = np.sqrt(ax * ax + ay * ay + az * az)
    return ax / length, ay / length, az / length
