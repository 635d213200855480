"""Projection of soles and palms on surfaces: where a limb lands, if its whole patch finds room there.

A patch fits if its rectangle lies in the surface's region: the centre is inside by the even-odd rule over all rings,
and no boundary edge meets the rectangle. That is exact for regions that are not convex or have holes.

- A sole falls along the vertical on the HIGHEST surface in reach on which it fits. Where it fits nowhere it may shift
  a little, in a fixed order of offsets along its own axes (this goes beyond the paper: a discrete step set rarely hits
  a 0.30 m tread or a small stone by chance).
- A palm follows a ray to the NEAREST surface on which it fits, and is rejected where anything blocks the ray before.
  Its x axis is the heading, carried by the least rotation that takes the vertical to the normal: forwards on a side
  wall, up on a wall ahead, as the hand of an arm raised from hanging points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from toolkit.contacts.projection_kernels import project_palms, project_soles
from toolkit.contacts.surface_table import surface_table
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.robot.model import RobotModel
from toolkit.world.source import RAY_GROUPS
from toolkit.world.surface import Surface


@dataclass(frozen=True)
class ProjectionConfig:
    """Settings of the projection.

    Attributes:
        margin: m around a sole that must also be in the surface.
        palm_margin: m around a palm.
        shift: m; how far a sole may move to fit; 0 for the paper's projection.
        shift_step: m; spacing of the offsets tried.
        block_tolerance: m; something nearer than a palm's surface by more than this blocks the ray.
    """

    margin: float = 0.01
    palm_margin: float = 0.005
    shift: float = 0.06
    shift_step: float = 0.02
    block_tolerance: float = 0.01


@dataclass(frozen=True)
class Projected:
    """Patches of n candidates; rows with surface -1 found none.

    Attributes:
        surface: (n,) int.
        position: (n, 3) m; centre of the patch.
        rotation: (n, 3, 3); world_from_contact.
    """

    surface: np.ndarray
    position: np.ndarray
    rotation: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """(n,) bool."""
        return self.surface >= 0

    def select(self, rows: np.ndarray) -> Projected:
        """Some of the candidates, by index or by mask."""
        return Projected(self.surface[rows], self.position[rows], self.rotation[rows])


def shifts(reach: float, step: float) -> np.ndarray:
    """(n, 2) offsets along x and y in a disc, nearest first, along x before y, forwards before backwards."""
    count = round(reach / step) if step > 0 else 0
    grid = [(i, j) for i in range(-count, count + 1) for j in range(-count, count + 1) if i * i + j * j <= count**2]
    grid.sort(key=lambda ij: (ij[0] ** 2 + ij[1] ** 2, abs(ij[1]), -ij[0], -ij[1]))
    return np.array(grid, float) * step


class Projector:
    """Projects the soles and palms of one robot on the surfaces of one world.

    Args:
        robot: patch sizes.
        surfaces: of the world.
        model: the world compiled, for blocked rays.
        config: settings.
    """

    def __init__(
        self,
        robot: RobotModel,
        surfaces: Sequence[Surface],
        model: mujoco.MjModel,
        config: ProjectionConfig | None = None,
    ):
        self.config = config or ProjectionConfig()
        self.half_sizes = robot.half_sizes + self.config.margin
        self.half_sizes[list(PALMS)] = robot.half_sizes[list(PALMS)] + self.config.palm_margin
        self.table = surface_table(surfaces, reach=float(np.linalg.norm(self.half_sizes[list(FEET)], axis=1).max()))
        self.offsets = shifts(self.config.shift, self.config.shift_step)
        self._model = model
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        self._palm_surfaces = np.flatnonzero(self.table.palm)

    def project_soles(
        self, limb: Limb, pose: np.ndarray, low: float, high: float, *, shift: bool = True, outward: float = 0.0
    ) -> Projected:
        """Drop soles on the highest surfaces that hold them.

        Args:
            limb: a foot.
            pose: (n, 3) float; x m, y m, yaw rad of the sole in the world.
            low: m; lowest height of the sole's centre.
            high: m; highest.
            shift: whether soles may shift to fit.
            outward: sign of the shifts across the foot tried first: +1 to the left, -1 to the right.

        Returns:
            Soles, z along the surface's normal, x along yaw.
        """
        offsets = self.offsets if shift else self.offsets[:1]
        if outward < 0:
            offsets = offsets * [1.0, -1.0]
        n = len(pose)
        surface, position, rotation = np.empty(n, np.int64), np.zeros((n, 3)), np.zeros((n, 3, 3))
        project_soles(
            np.ascontiguousarray(pose, dtype=float),
            float(low),
            float(high),
            self.half_sizes[limb],
            np.ascontiguousarray(offsets),
            self.table,
            surface,
            position,
            rotation,
        )
        return Projected(surface, position, rotation)

    def project_palms(self, limb: Limb, shoulder: np.ndarray, rays: np.ndarray, yaw: float, reach: float) -> Projected:
        """Send palms along rays to the nearest surfaces that hold them.

        Args:
            limb: a palm.
            shoulder: (3,) m, world.
            rays: (n, 3) unit, world.
            yaw: rad; heading of the body.
            reach: m; rays end there.

        Returns:
            Palms, z along the surface's normal.
        """
        n, table = len(rays), self.table
        surface, position, rotation = np.empty(n, np.int64), np.zeros((n, 3)), np.zeros((n, 3, 3))
        chosen = self._palm_surfaces
        if len(chosen):
            near = np.linalg.norm(table.centre[chosen] - shoulder, axis=1) < table.radius[chosen] + reach
            chosen = chosen[near]
        if not len(chosen):
            surface[:] = -1
            return Projected(surface, position, rotation)
        distance = np.full(n, np.inf)
        rays = np.ascontiguousarray(rays, dtype=float)
        project_palms(
            np.asarray(shoulder, float),
            rays,
            float(yaw),
            float(reach),
            self.half_sizes[limb],
            chosen,
            table,
            surface,
            distance,
            position,
            rotation,
        )
        if (surface >= 0).any():
            surface[self._blocked(np.asarray(shoulder, float), rays, distance, reach)] = -1
        return Projected(surface, position, rotation)

    def _blocked(self, origin: np.ndarray, rays: np.ndarray, distance: np.ndarray, reach: float) -> np.ndarray:
        """(n,) bool; whether anything that collides lies before `distance` (n,) on a ray."""
        n = len(rays)
        geom, hit = np.empty(n, np.int32), np.empty(n)
        mujoco.mj_multiRay(
            self._model, self._data, origin, rays.ravel(), RAY_GROUPS, True, -1, geom, hit, None, n, reach + 1.0
        )
        return (geom >= 0) & (hit < distance - self.config.block_tolerance)
