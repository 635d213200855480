"""Off-screen rendering of MuJoCo scenes on machines with or without a screen."""

from __future__ import annotations

import copy
import importlib
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from toolkit.contacts.stance import Contact
from toolkit.errors import InputError
from toolkit.report.colors import LIMB_COLORS

BACKENDS = ("egl", "osmesa")
_PROBE = """
import importlib, os, sys
import mujoco
context = importlib.import_module(f"mujoco.{sys.argv[1]}").GLContext(16, 16)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
sys.stdout.flush()
os._exit(0)
"""
REMEDY = "apt-get install -y libegl1 libgl1-mesa-dri libosmesa6, or leave pictures and video out"


def working_backend(backends: Sequence[str] = BACKENDS) -> str:
    """The first of MuJoCo's context modules that renders without a screen; one that MUJOCO_GL names is tried first.

    Each is tried in its own process: after a module that does not work, no other can be loaded.

    Raises:
        InputError: No module works; the message says what to install.
    """
    wanted = os.environ.get("MUJOCO_GL", "").lower()
    reasons = []
    for backend in sorted(backends, key=lambda name: name != wanted):
        reason = why_not(backend)
        if not reason:
            return backend
        reasons.append(f"{backend}: {reason}")
    raise InputError(f"cannot render off screen ({'; '.join(reasons)}): {REMEDY}")


def why_not(backend: str, environment: Mapping[str, str] = os.environ) -> str:
    """Why one of MuJoCo's context modules does not render here; "" where it does. It is tried in its own process."""
    command = [sys.executable, "-c", _PROBE, backend]
    outcome = subprocess.run(command, capture_output=True, text=True, env={**environment, "MUJOCO_GL": backend})
    if outcome.returncode == 0:
        return ""
    last = outcome.stderr.strip().splitlines()[-1:] or [f"exit code {outcome.returncode}"]
    return last[0][:100]


def open_context(width: int, height: int) -> Any:
    """An OpenGL context without a screen, made current.

    Raises:
        InputError: This machine cannot render.
    """
    loaded = [backend for backend in BACKENDS if f"mujoco.{backend}" in sys.modules]
    backend = loaded[0] if loaded else working_backend()
    try:
        context = importlib.import_module(f"mujoco.{backend}").GLContext(width, height)
        context.make_current()
    except (ImportError, RuntimeError, AttributeError) as error:
        raise InputError(f"cannot render off screen ({backend}: {error}): {REMEDY}") from error
    return context


def require_rendering() -> None:
    """Check early that this machine can render.

    Raises:
        InputError: It cannot; the message says what to install.
    """
    open_context(16, 16).free()


@dataclass(frozen=True)
class Patches:
    """Contact patches to draw as thin plates coloured by limb, with half sizes (4, 2) in m by limb."""

    contacts: Sequence[Contact]
    half_sizes: np.ndarray


class OffscreenRenderer:
    """Renders configurations of one model; close it, or use it as a context manager."""

    def __init__(self, model: mujoco.MjModel, width: int, height: int, *, shadows: bool = True):
        """Open a renderer of pictures with `width` and `height` in pixels, for a copy of the model.

        Shadows and reflections double the time on a software renderer.

        Raises:
            InputError: This machine cannot render.
        """
        self._model = copy.copy(model)
        self._model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
        self._model.vis.global_.offheight = max(height, model.vis.global_.offheight)
        self._data = mujoco.MjData(self._model)
        self._gl = open_context(width, height)
        self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._scene = mujoco.MjvScene(self._model, maxgeom=20000 + 2 * model.ngeom)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self._scene.flags[flag] = shadows
        self._option = mujoco.MjvOption()
        self._rectangle = mujoco.MjrRect(0, 0, width, height)
        self._pixels = np.empty((height, width, 3), np.uint8)

    def render(
        self,
        qpos: np.ndarray,
        camera: mujoco.MjvCamera,
        *,
        patches: Patches | None = None,
        text: str = "",
        others: Sequence[np.ndarray] = (),
    ) -> np.ndarray:
        """(height, width, 3) uint8; picture of a configuration (nq,), with a text in the lower left corner.

        What moves is drawn in `others`, further configurations, too.
        """
        self._gl.make_current()
        self._data.qpos[:] = qpos
        mujoco.mj_forward(self._model, self._data)
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, self._data, self._option, None, camera, everything, self._scene)
        for configuration in others:
            self._data.qpos[:] = configuration
            mujoco.mj_kinematics(self._model, self._data)
            moving = mujoco.mjtCatBit.mjCAT_DYNAMIC.value
            mujoco.mjv_addGeoms(self._model, self._data, self._option, mujoco.MjvPerturb(), moving, self._scene)
        if patches is not None:
            for contact in patches.contacts:
                self._add_patch(contact, patches.half_sizes[contact.limb])
        mujoco.mjr_render(self._rectangle, self._scene, self._context)
        if text:
            corner = mujoco.mjtGridPos.mjGRID_BOTTOMLEFT.value
            font = mujoco.mjtFont.mjFONT_NORMAL.value
            mujoco.mjr_overlay(font, corner, self._rectangle, text, "", self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._rectangle, self._context)
        return self._pixels[::-1].copy()

    def _add_patch(self, contact: Contact, half_size: np.ndarray) -> None:
        """Add one plate to the scene."""
        if self._scene.ngeom >= self._scene.maxgeom:
            return
        rgba = np.array([*np.array(LIMB_COLORS[contact.limb]) / 255, 0.7], np.float32)
        geom, size, pose = self._scene.geoms[self._scene.ngeom], np.array([*half_size, 0.003]), contact.pose
        box = mujoco.mjtGeom.mjGEOM_BOX.value
        mujoco.mjv_initGeom(geom, box, size, pose.position, pose.rotation.ravel(), rgba)
        self._scene.ngeom += 1

    def close(self) -> None:
        """Free the graphics memory; the renderer cannot be used afterwards."""
        self._gl.make_current()
        self._context.free()
        self._gl.free()

    def __enter__(self) -> OffscreenRenderer:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
