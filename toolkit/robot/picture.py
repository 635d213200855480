"""A picture of a robot in its home posture, rendered off screen."""

from __future__ import annotations

import importlib
import os
from typing import Any

import mujoco
import numpy as np

from toolkit.errors import ToolkitError
from toolkit.mjcf import mujoco_warnings
from toolkit.robot.model import RobotModel

_WIDTH, _HEIGHT = 900, 1200  # pixels
_AZIMUTH, _ELEVATION = 150.0, -8.0  # deg; direction of view about z and above the horizon


def standing_scene(robot: RobotModel, friction: float = 1.0) -> mujoco.MjModel:
    """The robot over a checkered plane at z = 0 with this friction, with lights; qpos and ctrl are the robot's."""
    spec = mujoco.MjSpec.from_string(robot.mjcf, assets=robot.assets)
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 100.0
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    sky = mujoco.mjtTexture.mjTEXTURE_SKYBOX
    spec.add_texture(name="sky", type=sky, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, width=256, height=1536,
                     rgb1=[0.75, 0.83, 0.92], rgb2=[1.0, 1.0, 1.0])  # fmt: skip
    spec.add_texture(name="tiles", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
                     width=512, height=512, rgb1=[0.80, 0.82, 0.84], rgb2=[0.72, 0.74, 0.77])  # fmt: skip
    material = spec.add_material(name="tiles", texrepeat=[2, 2], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1], priority=1, condim=3,
                            contype=1, conaffinity=1, friction=[friction, 0.005, 0.0001], material="tiles")  # fmt: skip
    spec.worldbody.add_light(type=mujoco.mjtLightType.mjLIGHT_SPOT, pos=[3, 2, 5], dir=[-0.5, -0.33, -0.7], cutoff=60,
                             diffuse=[0.7] * 3, castshadow=True)  # fmt: skip
    spec.worldbody.add_light(type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, pos=[0, 0, 4], dir=[0.3, 0.6, -0.6],
                             diffuse=[0.25] * 3, castshadow=False)  # fmt: skip
    spec.visual.quality.shadowsize = 4096
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1440
    return spec.compile()


@mujoco_warnings()  # a picture decides nothing
def render_home(robot: RobotModel) -> np.ndarray:
    """Picture (1200, 900, 3) uint8 of the home posture on a plane.

    Raises:
        ToolkitError: There is no off-screen OpenGL context; the message says what to set.
    """
    model = standing_scene(robot)
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = [0.0, 0.0, 0.88 * robot.com_height]
    camera.distance, camera.azimuth, camera.elevation = 2.75 * robot.com_height, _AZIMUTH, _ELEVATION

    model.vis.global_.offwidth, model.vis.global_.offheight = _WIDTH, _HEIGHT
    window = _context()
    context = None
    try:
        window.make_current()
        scene = mujoco.MjvScene(model, maxgeom=1000 + model.ngeom)
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        options, rectangle = mujoco.MjvOption(), mujoco.MjrRect(0, 0, _WIDTH, _HEIGHT)
        mujoco.mjv_updateScene(model, data, options, None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
        mujoco.mjr_render(rectangle, scene, context)
        pixels = np.empty((_HEIGHT, _WIDTH, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, rectangle, context)
    finally:
        if context is not None:
            context.free()
        window.free()
    return pixels[::-1]


def _context() -> Any:
    """An off-screen OpenGL context by MUJOCO_GL if set, else EGL, else OSMesa; MuJoCo would choose on import."""
    wanted = os.environ.get("MUJOCO_GL", "").lower()
    failures = []
    for name in [wanted] if wanted else ["egl", "osmesa"]:
        try:
            return importlib.import_module(f"mujoco.{name}").GLContext(_WIDTH, _HEIGHT)
        except (ImportError, AttributeError, RuntimeError, OSError) as error:
            failures.append(f"{name}: {error}")
    raise ToolkitError(f"no off-screen rendering ({'; '.join(failures)}); install EGL (libegl1) and set MUJOCO_GL=egl")
