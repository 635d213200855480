"""A strip of pictures and a video of a run, rendered off screen."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import imageio.v3 as iio
import imageio_ffmpeg
import mujoco
import numpy as np

from toolkit.report.meshes import static_bodies
from toolkit.report.offscreen import OffscreenRenderer, Patches

DISTANCE = 2.7  # m from the robot to the camera
VIEWS = [
    (side * angle, elevation) for elevation in (-14.0, -35.0, -60.0) for angle in (65, 110, 150, 25) for side in (-1, 1)
]
"""Views (degrees from the heading, elevation) in order of preference."""


def strip(
    scene: mujoco.MjModel,
    qpos: np.ndarray,
    times: np.ndarray,
    path: Path,
    count: int = 8,
    *,
    size: tuple[int, int] = (320, 420),
    patches: Patches | None = None,
) -> None:
    """Write a row of pictures at evenly spaced times, the camera following the robot.

    Args:
        scene: compiled scene.
        qpos: (C, nq) configurations.
        times: (C,) s.
        path: PNG file.
        count: number of pictures.
        size: (width, height) of one, pixels.
        patches: contact patches to draw.

    Raises:
        InputError: this machine cannot render; the message says what to install.
    """
    rows = np.unique(np.linspace(0, len(times) - 1, count).round().astype(int))
    cameras = follow(scene, qpos, times)
    with OffscreenRenderer(scene, *size) as renderer:
        pictures = [renderer.render(qpos[i], cameras[i], patches=patches, text=f"{times[i]:.1f} s") for i in rows]
    iio.imwrite(path, np.concatenate(pictures, axis=1))


def video(
    scene: mujoco.MjModel,
    qpos: np.ndarray,
    times: np.ndarray,
    path: Path,
    *,
    fps: int = 25,
    size: tuple[int, int] = (848, 480),
    patches: Patches | None = None,
) -> None:
    """Write an H.264 video in real time, the camera following the robot.

    Args:
        scene: compiled scene.
        qpos: (C, nq) configurations.
        times: (C,) s.
        path: MP4 file.
        fps: pictures per second.
        size: (width, height) in pixels, multiples of 16.
        patches: contact patches to draw.

    Raises:
        InputError: this machine cannot render; the message says what to install.
    """
    rows = np.searchsorted(times, np.arange(times[0], times[-1] + 1e-9, 1 / fps) - 1e-9)
    cameras = follow(scene, qpos, times)
    with OffscreenRenderer(scene, *size, shadows=False) as renderer:
        sink = imageio_ffmpeg.write_frames(str(path), size, fps=fps, codec="libx264", quality=7)
        sink.send(None)
        try:
            for i in rows:
                sink.send(renderer.render(qpos[i], cameras[i], patches=patches, text=f"{times[i]:.1f} s"))
        finally:
            sink.close()


class follow:
    """Cameras that follow the robot, `follow(...)[i]` for sample i; the side least hidden by the world is taken."""

    def __init__(self, scene: mujoco.MjModel, qpos: np.ndarray, times: np.ndarray, smoothing: float = 1.0):
        """Choose the view.

        Args:
            scene: compiled scene with one free joint.
            qpos: (C, nq).
            times: (C,) s.
            smoothing: s over which the robot's position is averaged.
        """
        self._target = _smoothed(qpos[:, _base(scene)], times, smoothing) - [0.0, 0.0, 0.15]
        way = self._target[-1, :2] - self._target[0, :2]
        if np.linalg.norm(way) < 0.3:
            w, x, y, z = qpos[0, _base(scene).stop : _base(scene).stop + 4]
            way = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z)])
        heading = np.degrees(np.arctan2(way[1], way[0]))
        # MuJoCo's azimuth is the direction in which the camera looks.
        views = [(heading + 180 + angle, elevation) for angle, elevation in VIEWS]
        samples = self._target[:: max(len(times) // 12, 1)]
        hidden = [sum(_hidden(scene, samples, view)) for view in views]
        self.azimuth, self.elevation = views[int(np.argmin(hidden))]

    def __getitem__(self, index: int) -> mujoco.MjvCamera:
        camera = mujoco.MjvCamera()
        camera.lookat[:] = self._target[index]
        camera.distance, camera.azimuth, camera.elevation = DISTANCE, self.azimuth, self.elevation
        return camera


def _base(scene: mujoco.MjModel) -> slice:
    """Where the position of the first free joint is in qpos."""
    free = np.flatnonzero(scene.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    first = int(scene.jnt_qposadr[free[0]])
    return slice(first, first + 3)


def _smoothed(position: np.ndarray, times: np.ndarray, span: float) -> np.ndarray:
    """(C, 3) positions averaged over `span` s around each sample."""
    total = np.vstack([np.zeros(3), np.cumsum(position, axis=0)])
    first = np.searchsorted(times, times - span / 2)
    last = np.searchsorted(times, times + span / 2, side="right")
    return (total[last] - total[first]) / (last - first)[:, None]


def _hidden(scene: mujoco.MjModel, targets: np.ndarray, view: tuple[float, float]) -> Iterator[float]:
    """For each target (k, 3), the share of the way to the camera behind the first static geom."""
    data = mujoco.MjData(scene)
    mujoco.mj_kinematics(scene, data)
    azimuth, elevation = np.radians(view)
    back = -np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    static, hit = static_bodies(scene)[scene.geom_bodyid], np.zeros(1, np.int32)
    for target in targets:
        origin, length = target.copy(), DISTANCE
        while length > 0:
            distance = mujoco.mj_ray(scene, data, origin, back, None, True, -1, hit)
            if distance < 0 or distance >= length:
                length = 0.0
            elif static[hit[0]]:
                break
            else:  # the robot itself: go on behind it
                origin, length = origin + (distance + 1e-4) * back, length - distance - 1e-4
        yield length / DISTANCE
