"""Turn a model file into the robot's own MJCF: free base, locked joints, torque actuators, contact sites."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from toolkit.errors import InputError, RobotError
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.mjcf import compile_spec, copy_fields, one_line
from toolkit.robot.description import LimbDescription, RobotDescription, match_joints, suggestion
from toolkit.robot.locking import lock_joints
from toolkit.robot.source import ModelSource

ROOT_JOINT = "root_joint"


@dataclass(frozen=True)
class Assembly:
    """A robot's model in its final form.

    Attributes:
        mjcf: Self-contained MJCF text.
        assets: Content of each file by its name.
        mujoco_model: The compiled `mjcf`.
        velocity: Velocity limit of each actuated joint, rad/s.
        bodies: Name of the body that carries the site of each limb.
    """

    mjcf: str
    assets: dict[str, bytes] = field(repr=False)
    mujoco_model: mujoco.MjModel = field(repr=False)
    velocity: dict[str, float]
    bodies: dict[Limb, str]


def assemble(description: RobotDescription, source: ModelSource) -> Assembly:
    """Turn a model file into the robot that the toolkit works with; the spec of `source` is changed.

    The result is the robot alone, with a free joint `root_joint`, one torque actuator per joint in joint order, and the
    contact sites. Everything in the file that acts on the robot from outside is removed (actuators, gravity
    compensation, floor).

    Raises:
        RobotError: Unknown or unsupported names, joints or constraints, or missing limits.
    """
    spec, where = source.spec, description.path
    _check_tree(description, source)
    names = [joint.name for joint in spec.joints if joint.type != mujoco.mjtJoint.mjJNT_FREE]
    locked = match_joints(where, "model.locked_joints", description.locked_joints, names)
    try:
        lock_joints(spec, locked)
    except RobotError as error:
        raise RobotError(f"{source.path}: {error}") from None
    _strip(source)
    _check_names(source)
    bare = _compiled(source, spec)
    velocity = _set_joints(description, source, bare)
    bodies = {limb: _add_site(description, item, spec, bare) for limb, item in description.limbs.items()}
    _compiled(source, spec)
    mjcf, assets = spec.to_xml(), dict(spec.assets)
    return Assembly(mjcf, assets, _compiled(source, mjcf), velocity, bodies)


def _compiled(source: ModelSource, what: mujoco.MjSpec | str) -> mujoco.MjModel:
    """Compile a spec, or MJCF text with the files of the source."""
    try:
        if isinstance(what, str):
            what = mujoco.MjSpec.from_string(what, assets=dict(source.spec.assets))
        return compile_spec(what)
    except InputError as error:
        raise RobotError(f"{source.path}: {error}") from None
    except ValueError as error:
        raise RobotError(f"{source.path}: MuJoCo cannot compile it: {one_line(error)}") from None


def exclude_pairs(assembly: Assembly, pairs: Sequence[tuple[str, str]]) -> Assembly:
    """The same robot without contacts between pairs of its bodies."""
    if not pairs:
        return assembly
    lines = [f"<exclude body1={quoteattr(first)} body2={quoteattr(second)}/>" for first, second in pairs]
    end = assembly.mjcf.rindex("</mujoco>")  # MuJoCo merges sections of one kind
    mjcf = "\n    ".join([f"{assembly.mjcf[:end]}\n  <contact>", *lines]) + "\n  </contact>\n</mujoco>\n"
    return replace(assembly, mjcf=mjcf, mujoco_model=mujoco.MjModel.from_xml_string(mjcf, assembly.assets))


def _check_tree(description: RobotDescription, source: ModelSource) -> None:
    spec = source.spec
    roots = [body.name for body in spec.worldbody.bodies]
    base = spec.body(description.base)
    if base is None or base.name == "world":
        names = [body.name for body in spec.bodies if body.name != "world"]
        raise RobotError(
            f"{description.path}: model.base '{description.base}' is no body of {source.path.name}; "
            f"{suggestion(description.base, names)}"
        )
    if roots != [description.base]:
        raise RobotError(
            f"{description.path}: model.base '{description.base}' must be the only body at the root of "
            f"{source.path.name}; found {', '.join(roots)}"
        )
    for joint in spec.joints:
        body = joint.parent.name
        if joint.type == mujoco.mjtJoint.mjJNT_BALL:
            raise RobotError(f"{source.path}: joint '{joint.name}' on body '{body}' is a ball joint; use three hinges")
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            if body != description.base:
                raise RobotError(f"{source.path}: body '{body}' floats freely; only the base may")
            continue
        if body == description.base:
            raise RobotError(
                f"{source.path}: joint '{joint.name}' moves the base '{body}'; only a free joint may stand there"
            )
        if not joint.name:
            raise RobotError(f"{source.path}: a joint on body '{body}' has no name; name it")
    free = [joint for joint in base.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]
    root = free[0] if free else base.add_freejoint()
    root.name, root.align = ROOT_JOINT, mujoco.mjtAlignFree.mjALIGNFREE_FALSE
    unnamed = [body for body in spec.bodies if not body.name]
    for index, body in enumerate(unnamed):
        body.name = f"unnamed_body_{index}"


def _strip(source: ModelSource) -> None:
    spec = source.spec
    joints = {joint.name for joint in spec.joints}
    for equality in list(spec.equalities):
        # A constraint between locked joints has no effect any more.
        if equality.type != mujoco.mjtEq.mjEQ_JOINT or equality.name1 in joints or equality.name2 in joints:
            what = f"'{equality.name}'" if equality.name else f"on '{equality.name1}'"
            raise RobotError(
                f"{source.path}: equality or mimic constraint {what} is not supported; "
                "remove it, or lock the joints in robot.toml [model.locked_joints]"
            )
        spec.delete(equality)
    if spec.tendons:
        raise RobotError(f"{source.path}: tendons are not supported; remove them")
    world = spec.worldbody
    for group in (spec.keys, spec.sensors, spec.cameras, spec.lights, world.geoms, world.sites):
        for item in list(group):
            spec.delete(item)
    for body in spec.bodies:
        body.gravcomp = 0.0
    for geom in spec.geoms:
        geom.priority = 0  # so that the world's friction is used
    copy_fields(mujoco.MjSpec().option, spec.option)


def _check_names(source: ModelSource) -> None:
    bodies = {body.name for body in source.spec.bodies}
    for joint in source.spec.joints:
        if joint.name in bodies:
            raise RobotError(
                f"{source.path}: '{joint.name}' names both a joint and a body; rename the body to '{joint.name}_link'"
            )
    # A contact site is named after its limb, and no body may have that name in placo's list of frames.
    for limb in Limb:
        if limb.label in bodies:
            name = f"{limb.label}_link"
            if name in bodies:
                raise RobotError(f"{source.path}: has bodies '{limb.label}' and '{name}'; rename one of them")
            source.spec.body(limb.label).name = name


def _set_joints(description: RobotDescription, source: ModelSource, bare: mujoco.MjModel) -> dict[str, float]:
    spec, where = source.spec, description.path
    names = [bare.joint(j).name for j in range(bare.njnt) if bare.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE]
    position = match_joints(where, "limits.position", description.position, names)
    torque = _file_torques(bare) | match_joints(where, "limits.torque", description.torque, names)
    velocity = source.velocity | match_joints(where, "limits.velocity", description.velocity, names)
    armature = match_joints(where, "armature", description.armature, names)
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for name in names:
        joint, index = spec.joint(name), bare.joint(name).id
        lower, upper = position.get(name, bare.jnt_range[index])
        if name not in position and not bare.jnt_limited[index]:
            raise RobotError(
                f"{source.path}: joint '{name}' has no position limit; add it to {where} [limits.position]"
            )
        if not lower < upper:
            raise RobotError(f"{where}: joint '{name}' has the empty range {lower:g} to {upper:g}")
        for table, values in (("torque", torque), ("velocity", velocity)):
            if not np.isfinite(values.get(name, np.nan)) or values[name] <= 0:
                raise RobotError(
                    f"{source.path}: joint '{name}' has no {table} limit; add it to {where} [limits.{table}]"
                )
        scale = 1.0 if not spec.compiler.degree or joint.type != mujoco.mjtJoint.mjJNT_HINGE else 180.0 / np.pi
        joint.limited, joint.range = mujoco.mjtLimited.mjLIMITED_TRUE, [lower * scale, upper * scale]
        joint.actfrclimited, joint.actgravcomp = mujoco.mjtLimited.mjLIMITED_FALSE, False
        if name in armature:
            joint.armature = armature[name]
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        motor.gear = [1.0, 0, 0, 0, 0, 0]
        motor.ctrllimited = motor.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        motor.ctrlrange = motor.forcerange = [-torque[name], torque[name]]
    return {name: float(velocity[name]) for name in names}


def _file_torques(bare: mujoco.MjModel) -> dict[str, float]:
    """Torque limits of a compiled model by joint: the smaller of the joint's and its actuators' limits, N m."""
    torques: dict[str, float] = {}

    def tighten(joint: int, low: float, high: float) -> None:
        name = bare.joint(joint).name
        torques[name] = min(torques.get(name, np.inf), abs(float(low)), abs(float(high)))

    for joint in range(bare.njnt):
        if bare.jnt_actfrclimited[joint]:
            tighten(joint, *bare.jnt_actfrcrange[joint])
    for actuator in range(bare.nu):
        if bare.actuator_trntype[actuator] != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        joint, gear = bare.actuator_trnid[actuator, 0], abs(bare.actuator_gear[actuator, 0])
        if bare.actuator_forcelimited[actuator]:
            tighten(joint, *(gear * bare.actuator_forcerange[actuator]))
        if bare.actuator_ctrllimited[actuator] and not bare.actuator_biastype[actuator]:
            tighten(joint, *(gear * bare.actuator_gainprm[actuator, 0] * bare.actuator_ctrlrange[actuator]))
    return torques


def _add_site(description: RobotDescription, item: LimbDescription, spec: mujoco.MjSpec, bare: mujoco.MjModel) -> str:
    label, where = item.limb.label, description.path
    bodies = [bare.body(i).name for i in range(1, bare.nbody)]
    sites = [bare.site(i).name for i in range(bare.nsite) if bare.site(i).name]
    if item.site is not None:
        if item.site not in sites:
            raise RobotError(
                f"{where}: [limbs.{label}] site '{item.site}' does not exist; {suggestion(item.site, sites)}"
            )
        site = bare.site(item.site)
        body, pose = bare.body(site.bodyid[0]).name, Pose.from_quaternion(site.pos, site.quat) @ item.pose
    else:
        wanted = item.body or ""
        body = f"{wanted}_link" if wanted in {limb.label for limb in Limb} else wanted
        if body not in bodies:
            raise RobotError(f"{where}: [limbs.{label}] body '{item.body}' does not exist; {suggestion(body, bodies)}")
        pose = item.pose
    if label in sites:
        spec.delete(spec.site(label))
    spec.body(body).add_site(
        name=label, pos=pose.position, quat=pose.quaternion_wxyz, size=[0.008] * 3, group=4, rgba=[0.9, 0.2, 0.2, 1.0]
    )
    if item.pad is not None:
        centre = pose @ np.array([0.0, 0.0, item.pad / 2])
        spec.body(body).add_geom(
            name=f"{label}_pad",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=centre,
            quat=pose.quaternion_wxyz,
            size=[*(item.patch / 2), item.pad / 2],
            mass=0.0,
            contype=1,
            conaffinity=1,
            condim=3,
        )
    return body
