"""Pictures of a run: one of the whole way, and one that moves."""

from __future__ import annotations

import io

import mujoco
import numpy as np
from PIL import Image

from toolkit.mjcf import mujoco_warnings
from toolkit.report.offscreen import OffscreenRenderer, Patches
from toolkit.report.stroboscope import overview

FPS, SPEED = 12.5, 1.5
"""Pictures per second of what moves, and how much faster than the run it does."""
_PAUSE = 1.2  # s on the last picture
_COLORS = 192  # of the palette that all pictures share, so that what stands still is stored once


def moving_picture(
    scene: mujoco.MjModel,
    qpos: np.ndarray,
    times: np.ndarray,
    *,
    size: tuple[int, int] = (640, 400),
    patches: Patches | None = None,
) -> bytes:
    """A GIF of a run from a camera that stands still.

    Args:
        scene: Compiled scene.
        qpos: (C, nq) configurations.
        times: (C,) s.
        size: Width and height in pixels.
        patches: Contact patches to draw.

    Raises:
        InputError: This machine cannot render.
    """
    rows = np.searchsorted(times, np.arange(times[0], times[-1] + 1e-9, SPEED / FPS) - 1e-9).clip(0, len(times) - 1)
    base = int(scene.jnt_qposadr[np.flatnonzero(scene.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0]])
    camera = overview(scene, qpos[:, base : base + 3])
    with mujoco_warnings(), OffscreenRenderer(scene, *size) as renderer:
        frames = [Image.fromarray(renderer.render(qpos[row], camera, patches=patches)) for row in rows]
    palette = _palette(frames)
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    times_ms = [round(1000.0 / FPS)] * (len(frames) - 1) + [round(1000.0 * _PAUSE)]
    content = io.BytesIO()
    first.save(content, "GIF", save_all=True, append_images=others, duration=times_ms, loop=0, optimize=True)
    return content.getvalue()


def _palette(frames: list[Image.Image]) -> Image.Image:
    """Colours of some frames together."""
    some = frames[:: max(len(frames) // 6, 1)]
    width, height = frames[0].size
    page = Image.new("RGB", (width, height * len(some)))
    for index, frame in enumerate(some):
        page.paste(frame, (0, index * height))
    return page.quantize(_COLORS, dither=Image.Dither.NONE)
