"""Independent checks of surfaces: MuJoCo's rays and contacts at random points."""

import mujoco
import numpy as np
import shapely
from shapely.geometry import Polygon

from toolkit.world.clearance import free_boxes
from toolkit.world.relief import height_and_slopes
from toolkit.world.source import RAY_GROUPS


def area_of(surface):
    return Polygon(surface.boundary[0], surface.boundary[1:]).area


def random_points(surface, rng, count, inset=0.0):
    """(n, 2) points of a surface's region, `inset` m away from its outline."""
    region = Polygon(surface.boundary[0], surface.boundary[1:]).buffer(-inset)
    if region.is_empty:
        return np.zeros((0, 2))
    x0, y0, x1, y1 = region.bounds
    points = rng.uniform([x0, y0], [x1, y1], (60 * count, 2))
    return points[shapely.contains_xy(region, points[:, 0], points[:, 1])][:count]


def ray_gap(model, surface, points, height=0.05):
    """(n,) signed distance along the normal from the surface to what a ray from `height` above meets first."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    gaps = []
    for x, y in points:
        start = surface.pose @ np.array([x, y, height])
        geom = np.zeros(1, np.int32)
        distance = mujoco.mj_ray(model, data, start, -surface.normal, RAY_GROUPS, True, -1, geom)
        gaps.append(height - distance if distance >= 0 else -np.inf)
    return np.array(gaps) - height_and_slopes(surface.relief, np.reshape(points, (-1, 2)))[0]


def ball_gap(model, surface, points, radius=0.005):
    """(n,) distance that a small ball resting on the plane at the points has from MuJoCo's collision geometry."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    spec = _with_ball(model, radius)
    probe = mujoco.MjData(spec)
    ball = spec.ngeom - 1
    gaps = []
    for x, y in points:
        probe.qpos[:3] = surface.pose @ np.array([x, y, radius])
        mujoco.mj_forward(spec, probe)
        distances = [c.dist for c in probe.contact if ball in c.geom]
        gaps.append(min(distances, default=np.inf))
    return np.array(gaps)


def _with_ball(model, radius):
    # The world's geoms with one free ball in place of the free box; a margin, so that a resting ball is in contact.
    spec = free_boxes(model, 1)
    ball = spec.geoms[-1]
    ball.type = mujoco.mjtGeom.mjGEOM_SPHERE
    ball.size = [radius, 0, 0]
    ball.margin = 0.01
    return spec.compile()
