"""A whole run in one picture: the world, and the robot in several moments of its way."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.mjcf import mujoco_warnings
from toolkit.report.offscreen import OffscreenRenderer, Patches
from toolkit.report.views import ahead_of, best_direction

SPACING = 0.7  # m between two moments, so that the robot does not hide itself
_MOST = 8  # moments
_NEAREST, _BESIDE = 2.9, 1.5  # m; least distance of the camera, and how much farther it is than the way is long
_ELEVATIONS = (18.0, 35.0, 60.0)  # degrees


def stroboscope(
    scene: mujoco.MjModel,
    qpos: np.ndarray,
    *,
    size: tuple[int, int] = (640, 480),
    patches: Patches | None = None,
) -> np.ndarray:
    """(height, width, 3) uint8; the robot in moments that are `SPACING` apart on its way, seen from beside.

    Args:
        scene: Compiled scene.
        qpos: (C, nq) configurations, at least one.
        size: Width and height in pixels.
        patches: Contact patches to draw.

    Raises:
        InputError: This machine cannot render.
    """
    base = int(scene.jnt_qposadr[np.flatnonzero(scene.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0]])
    way = qpos[:, base : base + 3]
    moments = qpos[_moments(way)]
    with mujoco_warnings(), OffscreenRenderer(scene, *size) as renderer:  # a picture decides nothing
        return renderer.render(moments[-1], overview(scene, way), patches=patches, others=list(moments[:-1]))


def overview(scene: mujoco.MjModel, way: np.ndarray) -> mujoco.MjvCamera:
    """A camera that sees a whole way (C, 3) m of the robot's base, from where least of it is hidden."""
    ahead, length = ahead_of(way)
    middle = (way.min(0) + way.max(0)) / 2 - [0.0, 0.0, 0.2]
    distance = max(_NEAREST, length + _BESIDE)
    samples = way[_moments(way)]
    seen = np.concatenate([samples, samples - [0.0, 0.0, 0.6]])
    heading = float(np.arctan2(ahead[1], ahead[0]))
    direction = best_direction(scene, seen, middle, heading, distance, _ELEVATIONS)
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance = middle, distance
    # MuJoCo's azimuth and elevation are those of the direction in which the camera looks.
    camera.azimuth = np.degrees(np.arctan2(-direction[1], -direction[0]))
    camera.elevation = -np.degrees(np.arcsin(direction[2]))
    return camera


def _moments(way: np.ndarray) -> np.ndarray:
    """Rows of a way (C, 3) m that are evenly apart along it, with the first and the last."""
    gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way[:, :2], axis=0), axis=1))])
    count = int(np.clip(round(gone[-1] / SPACING) + 1, 2, _MOST))
    return np.unique(np.searchsorted(gone, np.linspace(0.0, gone[-1], count) - 1e-9).clip(0, len(way) - 1))
