"""Robot and world in one MuJoCo model."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.errors import RobotError, WorldError
from toolkit.robot.model import RobotModel
from toolkit.world.source import read_source
from toolkit.world.world import PALM_SITES, World

WORLD_PREFIX = "world/"  # of everything in the scene that comes from the world

_SIZES = ("memory", "nemax", "njmax", "nconmax", "nstack")  # of MuJoCo's buffers; -1 leaves them to MuJoCo


def compose_scene(robot: RobotModel, world: World) -> mujoco.MjModel:
    """Compile a world and a robot into one model, ready to simulate.

    The robot's elements keep their names, the world's get the prefix `world/`. Every contact between the two has
    exactly the world's friction: the world's geoms have the higher priority. They collide with every geom of the robot
    that collides with anything; what collides within the robot is left as it is. Of the two files' options none
    counts: 2 ms steps, implicit in velocity, elliptic cone with impratio 100, gravity 9.81 m/s^2 down.

    Args:
        robot: the robot; its posture is the caller's matter (qpos0 is as in the robot's file).
        world: the world.

    Returns:
        The model: nq = 7 + n, joints and actuators in the robot's order, no keyframe.

    Raises:
        RobotError: the robot's model cannot be combined with a world.
        WorldError: the world's file changed since it was loaded.
    """
    spec = mujoco.MjSpec.from_string(robot.mjcf, assets=dict(robot.assets))
    source = read_source(world.path, world.mjcf)
    _check_unchanged(source.model, world)
    scenery = source.spec
    for key in list(spec.keys):
        spec.delete(key)
    for element in [*scenery.keys, *scenery.sensors, *scenery.pairs, *scenery.excludes]:
        scenery.delete(element)
    for site in scenery.sites:
        if site.name in PALM_SITES.values():
            scenery.delete(site)  # only sites of the robot are named after limbs
    priority = max([0, *(geom.priority for geom in spec.geoms)]) + 1
    fresh = mujoco.MjSpec().worldbody.add_geom()
    for geom in scenery.geoms:
        geom.priority, geom.condim = priority, 3
        geom.margin, geom.gap, geom.solmix = 0.0, 0.0, 1.0
        geom.solref, geom.solimp = fresh.solref, fresh.solimp
    for part in (spec, scenery):
        _set_options(part.option)
        for size in _SIZES:
            setattr(part, size, -1)
    _copy_fields(scenery.visual, spec.visual)
    _copy_fields(scenery.stat, spec.stat)
    if spec.assets and not scenery.assets:
        scenery.assets = dict(spec.assets)  # MuJoCo warns of a child without any
    try:
        spec.attach(scenery, prefix=WORLD_PREFIX, frame=spec.worldbody.add_frame())
        model = spec.compile()
    except ValueError as error:
        raise RobotError(f"{robot.folder}: cannot be put into {world.path}: {' '.join(str(error).split())}") from error
    _check_composed(model, robot, world)
    return model


def _set_options(options) -> None:
    """Default options but for the integrator, the cone and the gravity that every run uses."""
    _copy_fields(mujoco.MjSpec().option, options)
    options.timestep = 0.002
    options.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    options.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    options.impratio = 100.0
    options.gravity = [0.0, 0.0, -9.81]
    if hasattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD"):  # the default since MuJoCo 4
        options.enableflags |= int(mujoco.mjtEnableBit.mjENBL_MULTICCD)


def _copy_fields(source, target) -> None:
    """Copy the public fields of one of MuJoCo's structs to another, nested structs included."""
    for name in dir(source):
        value = getattr(source, name)
        if name.startswith("_") or callable(value):
            continue
        if isinstance(value, int | float | np.ndarray):
            setattr(target, name, value)
        else:
            _copy_fields(value, getattr(target, name))


def _colliding(model: mujoco.MjModel, index: np.ndarray) -> np.ndarray:
    """Those of the geoms that collide."""
    return index[(model.geom_contype[index] | model.geom_conaffinity[index]) != 0]


def _check_unchanged(model: mujoco.MjModel, world: World) -> None:
    loaded = world.mujoco_model
    same = model.ngeom == loaded.ngeom and model.nmesh == loaded.nmesh
    if same:
        same = np.array_equal(model.geom_size, loaded.geom_size) and np.array_equal(model.geom_pos, loaded.geom_pos)
        same = same and np.array_equal(model.mesh_vert, loaded.mesh_vert)
    if not same:
        raise WorldError(f"{world.path}: the file changed since it was loaded; load it again")


def _check_composed(model: mujoco.MjModel, robot: RobotModel, world: World) -> None:
    """Assert that the composed model is the robot plus the world and nothing else."""
    names = tuple(model.joint(i).name for i in range(1, model.njnt))
    if model.nq != 7 + len(robot.joint_names) or names != robot.joint_names or model.nu != len(names):
        raise RobotError(f"{robot.folder}: the scene's joints {names} are not the robot's {robot.joint_names}")
    if model.neq or model.nkey:
        raise RobotError(f"{robot.folder}: equality constraints are not supported; remove them from the robot's model")
    static = _colliding(model, np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0))
    alone = _colliding(world.mujoco_model, np.arange(world.mujoco_model.ngeom))
    if not np.array_equal(np.sort(model.geom_friction[static, 0]), np.sort(world.mujoco_model.geom_friction[alone, 0])):
        raise RobotError(f"{robot.folder}: static geoms of the robot are part of the scene; remove them")
