"""Projection of soles and palms on surfaces: where the whole patch of a limb finds room.

A patch fits if its rectangle lies in the surface's region: the centre is inside by the even-odd rule over all rings,
and no boundary edge meets the rectangle. That is exact for regions that are not convex or have holes.

- A sole falls along the vertical on the HIGHEST surface in reach on which it fits. Where it fits nowhere, it may shift
  a little along its own axes. The paper has no shifts, but a discrete step set rarely hits a 0.30 m tread by chance.
- A palm follows a ray to the NEAREST surface on which it fits. It is rejected where something blocks the ray before.
  Its x axis is the heading, turned by the least rotation that takes the vertical to the normal. So a hand points
  forwards on a side wall and up on a wall ahead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import mujoco
import numpy as np

from toolkit.contacts.projected import Projected
from toolkit.contacts.projection_kernels import project_palms, project_soles
from toolkit.contacts.seats import Seats
from toolkit.contacts.surface_table import surface_table
from toolkit.geometry.limb import PALMS, Limb
from toolkit.robot.model import RobotModel
from toolkit.world.source import RAY_GROUPS
from toolkit.world.surface import Surface


@dataclass(frozen=True)
class ProjectionConfig:
    """Settings of the projection, for a body of the usual size (`toolkit.robot.scale`).

    Attributes:
        margin: Margin around a sole that must also lie in the surface, in m.
        palm_margin: The same around a palm, in m.
        shift: How far a sole may move to fit, in m; 0 for the paper's projection.
        shift_step: Spacing of the offsets that are tried, in m.
        block_tolerance: What lies nearer than a palm's surface by more than this blocks the ray, in m.
    """

    margin: float = 0.01
    palm_margin: float = 0.005
    shift: float = 0.06
    shift_step: float = 0.02
    block_tolerance: float = 0.01

    def scaled(self, factor: float) -> ProjectionConfig:
        """The same with all lengths multiplied by a factor."""
        return ProjectionConfig(*(factor * length for length in astuple(self)))


def shifts(reach: float, step: float) -> np.ndarray:
    """(n, 2) m; offsets along x and y in a disc: the nearest first, along x before y, forwards before backwards."""
    count = round(reach / step) if step > 0 else 0
    grid = [(i, j) for i in range(-count, count + 1) for j in range(-count, count + 1) if i * i + j * j <= count**2]
    grid.sort(key=lambda ij: (ij[0] ** 2 + ij[1] ** 2, abs(ij[1]), -ij[0], -ij[1]))
    return np.array(grid, float) * step


class Projector:
    """Projects the soles and palms of one robot on the surfaces of one world.

    Args:
        robot: The robot, for the sizes of its patches.
        surfaces: Surfaces of the world.
        model: The compiled world, for blocked rays.
        config: Settings; they are scaled with the robot.

    Attributes:
        config: The settings for this robot.
        bearing: (S,) m; how far from the middle of a patch each surface bears.
    """

    def __init__(
        self,
        robot: RobotModel,
        surfaces: Sequence[Surface],
        model: mujoco.MjModel,
        config: ProjectionConfig | None = None,
    ):
        self.config = (config or ProjectionConfig()).scaled(robot.scale.length)
        self._patches = robot.half_sizes
        self.half_sizes = robot.half_sizes + self.config.margin
        self.room = robot.foot_room(self.config.margin)
        self.half_sizes[list(PALMS)] = robot.half_sizes[list(PALMS)] + self.config.palm_margin
        self.bearing = np.array([surface.bearing for surface in surfaces])
        self.table = surface_table(surfaces, reach=float(np.linalg.norm(self.room)))
        self._seats = Seats(surfaces)
        self.offsets = shifts(self.config.shift, self.config.shift_step)
        self._model = model
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        self._palm_surfaces = np.flatnonzero(self.table.palm)

    def project_soles(
        self, limb: Limb, pose: np.ndarray, low: float, high: float, *, shift: bool = True, outward: float = 0.0
    ) -> Projected:
        """Drop soles on the highest surfaces that hold them; z along the surface's normal, x along yaw.

        Where there is no room for a foot that is wider than its sole, what fits is the sole alone.

        Args:
            limb: A foot.
            pose: (n, 3) float x (m), y (m) and yaw (rad) of the soles in the world.
            low: Lowest height of a sole's centre, in m.
            high: Highest height of a sole's centre, in m.
            shift: Whether soles may shift to fit.
            outward: Sign of the shifts across the foot that are tried first: +1 to the left, -1 to the right.
        """
        offsets = self.offsets if shift else self.offsets[:1]
        if outward < 0:
            offsets = offsets * [1.0, -1.0]
        pose, offsets = np.ascontiguousarray(pose, dtype=float), np.ascontiguousarray(offsets)
        sole = self.half_sizes[limb]
        soles = self._soles(pose, low, high, self.room, offsets)
        missing = np.flatnonzero(~soles.found)
        if len(missing) and (self.room > sole).any():
            found = self._soles(pose[missing], low, high, sole, offsets)
            for name in Projected.__dataclass_fields__:
                getattr(soles, name)[missing] = getattr(found, name)
        return self._seats.lay(soles, self._patches[limb])

    def _soles(self, pose: np.ndarray, low: float, high: float, half: np.ndarray, offsets: np.ndarray) -> Projected:
        """The soles of `project_soles` with the half extents (2,) m of their room, at poses (n, 3)."""
        soles = Projected.none(len(pose))
        found = soles.surface, soles.position, soles.rotation
        project_soles(pose, float(low), float(high), half, offsets, self.table, *found)
        return soles

    def project_palms(self, limb: Limb, shoulder: np.ndarray, rays: np.ndarray, yaw: float, reach: float) -> Projected:
        """Send palms along rays to the nearest surfaces that hold them; z along the surface's normal.

        Args:
            limb: A palm.
            shoulder: (3,) Start of the rays in the world, in m.
            rays: (n, 3) Unit vectors in the world.
            yaw: Heading of the body, in rad.
            reach: Length of the rays, in m.
        """
        palms, table, half = Projected.none(len(rays)), self.table, self.half_sizes[limb]
        chosen = self._palm_surfaces
        chosen = chosen[np.linalg.norm(table.centre[chosen] - shoulder, axis=1) < table.radius[chosen] + reach]
        if not len(chosen):
            return palms
        distance = np.full(len(rays), np.inf)
        shoulder, rays = np.asarray(shoulder, float), np.ascontiguousarray(rays, dtype=float)
        found = palms.surface, distance, palms.position, palms.rotation
        project_palms(shoulder, rays, float(yaw), float(reach), half, chosen, table, *found)
        if palms.found.any():
            palms.surface[self._blocked(shoulder, rays, distance, reach)] = -1
        return self._seats.lay(palms, self._patches[limb])

    def _blocked(self, origin: np.ndarray, rays: np.ndarray, distance: np.ndarray, reach: float) -> np.ndarray:
        """(n,) bool; whether anything that collides lies before `distance` (n,) m on each ray."""
        n = len(rays)
        geom, hit = np.empty(n, np.int32), np.empty(n)
        mujoco.mj_multiRay(
            self._model, self._data, origin, rays.ravel(), RAY_GROUPS, True, -1, geom, hit, None, n, reach + 1.0
        )
        return (geom >= 0) & (hit < distance - self.config.block_tolerance)
