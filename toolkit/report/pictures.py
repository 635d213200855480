"""A strip of pictures and a video of a run, rendered off screen."""

from __future__ import annotations

import errno
from pathlib import Path

import imageio.v3 as iio
import imageio_ffmpeg
import mujoco
import numpy as np

from toolkit.report.offscreen import OffscreenRenderer, Patches
from toolkit.report.views import best_direction

DISTANCE = 2.7  # m from the robot to the camera
ELEVATIONS = (14.0, 35.0, 60.0)  # degrees


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
        OSError: the file cannot be written.
    """
    rows = np.searchsorted(times, np.arange(times[0], times[-1] + 1e-9, 1 / fps) - 1e-9)
    cameras = follow(scene, qpos, times)
    with OffscreenRenderer(scene, *size, shadows=False) as renderer:
        sink = imageio_ffmpeg.write_frames(
            str(path), size, fps=fps, codec="libx264", quality=7, ffmpeg_log_level="fatal"
        )
        try:
            sink.send(None)
            for i in rows:
                sink.send(renderer.render(qpos[i], cameras[i], patches=patches, text=f"{times[i]:.1f} s"))
            sink.close()
            whole = imageio_ffmpeg.count_frames_and_secs(str(path))[0] == len(rows)
        except (OSError, RuntimeError) as error:  # with all that the encoder has said
            raise OSError(errno.EIO, f"{path.name} is not whole, the disk may be full") from error
        finally:
            sink.close()
        if not whole:
            raise OSError(errno.EIO, f"{path.name} is not whole, the disk may be full")


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
        heading = float(np.arctan2(way[1], way[0]))
        samples = self._target[:: max(len(times) // 12, 1)]
        seen = np.concatenate([samples, samples - [0.0, 0.0, 0.5]])
        way = best_direction(scene, seen, np.tile(samples, (2, 1)), heading, DISTANCE, ELEVATIONS)
        # MuJoCo's azimuth and elevation are those of the direction in which the camera looks.
        self.azimuth = np.degrees(np.arctan2(-way[1], -way[0]))
        self.elevation = -np.degrees(np.arcsin(way[2]))

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
