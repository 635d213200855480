"""Robot and world in one MuJoCo model."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.errors import InputError, RobotError
from toolkit.mjcf import SIZES, compile_spec, copy_fields, one_line
from toolkit.robot.model import RobotModel
from toolkit.world.options import set_options
from toolkit.world.world import PALM_SITES, World

WORLD_PREFIX = "world/"  # prefix of every name in the scene that comes from the world
_CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER
_CONTACTS = 2.0  # that a sole makes with each triangle of a height field under it, at most, as measured


def compose_scene(robot: RobotModel, world: World) -> mujoco.MjModel:
    """Compile a world and a robot into one model, ready to simulate.

    The robot's elements keep their names, the world's get the prefix `world/`. Every contact between the two has
    exactly the world's friction, because the world's geoms have the higher priority. They collide with every geom of
    the robot that collides with anything; collisions within the robot stay as they are. Where the world has cylinders,
    those of feet and palms become boxes, since MuJoCo fails on cylinders that lie on cylinders. The options of both
    files are ignored: steps are 2 ms, implicit in velocity, with an elliptic cone of impratio 100 and gravity
    9.81 m/s^2 down.

    Args:
        robot: The robot; qpos0 stays as in its file.
        world: The world.

    Returns:
        The model: nq = 7 + n, joints and actuators in the robot's order, no keyframe.

    Raises:
        RobotError: The robot's model cannot be combined with a world.
    """
    spec = mujoco.MjSpec.from_string(robot.mjcf, assets=dict(robot.assets))
    scenery = world.scenery.copy()
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
    if any(geom.type == _CYLINDER and geom.contype | geom.conaffinity for geom in scenery.geoms):
        _box_cylinders(spec, robot)
    for part in (spec, scenery):
        set_options(part.option)
        for size in SIZES:
            setattr(part, size, -1)
    copy_fields(scenery.visual, spec.visual)
    copy_fields(scenery.stat, spec.stat)
    _share_assets(spec, scenery)
    try:
        spec.attach(scenery, prefix=WORLD_PREFIX, frame=spec.worldbody.add_frame())
        model = compile_spec(spec)
    except (ValueError, InputError) as error:
        raise RobotError(f"{robot.folder}: cannot be put into {world.path}: {one_line(error)}") from error
    _check_composed(model, robot, world)
    return model


def doubts(robot: RobotModel, world: World) -> list[str]:
    """What is doubtful about a robot in a world: a line for each height field too fine for the robot's soles.

    MuJoCo keeps `mjMAXCONPAIR` contacts of two geoms, so that part of a sole on more triangles than that is left in the
    air.
    """
    model, lines = world.mujoco_model, []
    sole = max(float(4.0 * foot.half_size.prod()) for limb, foot in robot.limbs.items() if limb.is_foot)
    for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD).tolist():
        field = int(model.geom_dataid[geom])
        points = np.array([model.hfield_ncol[field], model.hfield_nrow[field]])
        cell = float((2.0 * model.hfield_size[field, :2] / (points - 1)).prod())
        contacts = 2.0 * _CONTACTS * sole / cell
        if contacts > mujoco.mjMAXCONPAIR and model.geom_contype[geom] | model.geom_conaffinity[geom]:
            apart = np.sqrt(2.0 * _CONTACTS * sole / mujoco.mjMAXCONPAIR)
            lines.append(
                f"height field {model.hfield(field).name!r}: a sole makes some {contacts:.0f} contacts with it, and "
                f"MuJoCo keeps {mujoco.mjMAXCONPAIR}: part of it hangs in the air, and it may slide; put the field's "
                f"points at least {100 * apart:.1f} cm apart"
            )
    return lines


def _box_cylinders(spec: mujoco.MjSpec, robot: RobotModel) -> None:
    """Put boxes of the same extents in the place of the cylinders of feet and palms; masses and inertias stay.

    In one of 10,000 places MuJoCo (4.0) finds a lying cylinder 20 cm deep, sideways, in the end of another one on which
    it rests, and throws the robot into the air; its other collision of convex shapes (libccd) lets such feet sink in.
    """
    for limb in robot.limbs.values():
        body, own = spec.body(limb.body), robot.mujoco_model.body(limb.body)
        for geom in body.geoms:
            if geom.type == _CYLINDER and geom.contype | geom.conaffinity:
                geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, geom.size[[0, 0, 1]]
                body.explicitinertial, body.mass, body.inertia = True, own.mass[0], own.inertia
                body.ipos, body.iquat = own.ipos, own.iquat


def _share_assets(spec: mujoco.MjSpec, scenery: mujoco.MjSpec) -> None:
    """Give both parts of a scene the files of both; the world's files get names that no file of the robot has."""
    files, names = dict(spec.assets), {}
    for name, content in scenery.assets.items():
        names[name] = name
        while names[name] in files:
            names[name] = f"world_{names[name]}"
        files[names[name]] = content
    for item in [*scenery.meshes, *scenery.hfields, *scenery.skins, *scenery.textures]:
        item.file = names.get(item.file, item.file)
    for texture in scenery.textures:
        texture.cubefiles = [names.get(name, name) for name in texture.cubefiles]
    spec.assets, scenery.assets = files, dict(files)  # MuJoCo warns if a child has no files


def _colliding(model: mujoco.MjModel, index: np.ndarray) -> np.ndarray:
    """The geoms among `index` that collide."""
    return index[(model.geom_contype[index] | model.geom_conaffinity[index]) != 0]


def _check_composed(model: mujoco.MjModel, robot: RobotModel, world: World) -> None:
    """Raise unless the composed model is the robot plus the world and nothing else."""
    names = tuple(model.joint(i).name for i in range(1, model.njnt))
    if model.nq != 7 + len(robot.joint_names) or names != robot.joint_names or model.nu != len(names):
        raise RobotError(f"{robot.folder}: the scene's joints {names} are not the robot's {robot.joint_names}")
    if model.neq or model.nkey:
        raise RobotError(f"{robot.folder}: equality constraints are not supported; remove them from the robot's model")
    static = _colliding(model, np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0))
    alone = _colliding(world.mujoco_model, np.arange(world.mujoco_model.ngeom))
    if not np.array_equal(np.sort(model.geom_friction[static, 0]), np.sort(world.mujoco_model.geom_friction[alone, 0])):
        raise RobotError(f"{robot.folder}: static geoms of the robot are part of the scene; remove them")
