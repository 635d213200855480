"""A strip of pictures and a video of a run, rendered off screen."""

from __future__ import annotations

import errno
from pathlib import Path

import imageio.v3 as iio
import imageio_ffmpeg
import mujoco
import numpy as np

from toolkit.mjcf import mujoco_warnings
from toolkit.report.offscreen import OffscreenRenderer, Patches
from toolkit.report.views import best_direction

DISTANCE = 2.7  # m from the robot to the camera
ELEVATIONS = (14.0, 35.0, 60.0)  # degrees
SMOOTHING = 1.0  # s over which the robot's position is averaged for the camera


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
    """Write a PNG file with a row of pictures at evenly spaced times; the camera follows the robot.

    Args:
        scene: Compiled scene.
        qpos: (C, nq) configurations.
        times: (C,) s.
        path: The file.
        count: Number of pictures.
        size: Width and height of one picture in pixels.
        patches: Contact patches to draw.

    Raises:
        InputError: This machine cannot render; the message says what to install.
    """
    rows = np.unique(np.linspace(0, len(times) - 1, count).round().astype(int))
    cameras = follow(scene, qpos, times)
    with mujoco_warnings(), OffscreenRenderer(scene, *size) as renderer:  # a picture decides nothing
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
    """Write an MP4 file with an H.264 video in real time, `fps` pictures per second; else as `strip`.

    Width and height must be multiples of 16 pixels.

    Raises:
        InputError: This machine cannot render.
        OSError: The file cannot be written.
    """
    rows = np.searchsorted(times, np.arange(times[0], times[-1] + 1e-9, 1 / fps) - 1e-9)
    cameras = follow(scene, qpos, times)
    with mujoco_warnings(), OffscreenRenderer(scene, *size, shadows=False) as renderer:
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


def follow(scene: mujoco.MjModel, qpos: np.ndarray, times: np.ndarray) -> list[mujoco.MjvCamera]:
    """A camera for each configuration (C, nq) at (C,) s of a scene; it is beside the robot, where least is hidden."""
    base = int(scene.jnt_qposadr[np.flatnonzero(scene.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0]])
    target = _smoothed(qpos[:, base : base + 3], times) - [0.0, 0.0, 0.15]
    way = target[-1, :2] - target[0, :2]
    if np.linalg.norm(way) < 0.3:
        w, x, y, z = qpos[0, base + 3 : base + 7]
        way = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z)])
    heading = float(np.arctan2(way[1], way[0]))
    samples = target[:: max(len(times) // 12, 1)]
    seen = np.concatenate([samples, samples - [0.0, 0.0, 0.5]])
    way = best_direction(scene, seen, np.tile(samples, (2, 1)), heading, DISTANCE, ELEVATIONS)
    cameras = [mujoco.MjvCamera() for _ in target]
    for camera, place in zip(cameras, target, strict=True):
        camera.lookat[:], camera.distance = place, DISTANCE
        # MuJoCo's azimuth and elevation are those of the direction in which the camera looks.
        camera.azimuth, camera.elevation = np.degrees(np.arctan2(-way[1], -way[0])), -np.degrees(np.arcsin(way[2]))
    return cameras


def _smoothed(position: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(C, 3) positions averaged over `SMOOTHING` around each sample."""
    total = np.vstack([np.zeros(3), np.cumsum(position, axis=0)])
    first = np.searchsorted(times, times - SMOOTHING / 2)
    last = np.searchsorted(times, times + SMOOTHING / 2, side="right")
    return (total[last] - total[first]) / (last - first)[:, None]
