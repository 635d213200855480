"""Turn a model file into the robot's own MJCF: free base, locked joints, torque actuators, contact sites."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from toolkit.errors import InputError, RobotError
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.mjcf import compile_spec, copy_fields, one_line
from toolkit.robot.description import LimbDescription, RobotDescription, match_joints
from toolkit.robot.locking import lock_joints
from toolkit.robot.mend import mended
from toolkit.robot.motors import set_motors
from toolkit.robot.problems import Problems
from toolkit.robot.reader import suggestion
from toolkit.robot.skeleton import skeleton
from toolkit.robot.source import ModelSource

ROOT_JOINT = "root_joint"


@dataclass(frozen=True)
class Assembly:
    """A robot's model in its final form.

    Attributes:
        path: The model file.
        mjcf: Self-contained MJCF text.
        assets: Content of each file by its name.
        mujoco_model: The compiled model: that of `mjcf` after `finish`, which differs from the one before by the digits
            of the text.
        velocity: Velocity limit of each actuated joint, rad/s.
        bodies: Name of the body that carries the site of each limb.
        home: Positions of joints in the home posture, rad; those that are not there are at 0.
        warnings: What was assumed or changed, one line each.
    """

    path: Path
    mjcf: str
    assets: dict[str, bytes] = field(repr=False)
    mujoco_model: mujoco.MjModel = field(repr=False)
    velocity: dict[str, float]
    bodies: dict[Limb, str]
    home: dict[str, float]
    warnings: tuple[str, ...]


def assemble(description: RobotDescription, source: ModelSource) -> Assembly:
    """Turn a model file into the robot that the toolkit works with; the spec of `source` is changed.

    The result is the robot alone, with a free joint `root_joint`, one torque actuator per joint in joint order, and the
    contact sites. Everything in the file that acts on the robot from outside is removed (actuators, gravity
    compensation, floor).

    Raises:
        RobotError: Unknown or unsupported names, joints or constraints, or missing limits; the message names all of
            them that can be found at once.
    """
    problems = Problems(description.path)
    try:
        source = mended(source, description.mend, description.base, problems)
    except ValueError as error:
        raise RobotError(f"{source.path}: MuJoCo cannot compile it: {one_line(error)}") from None
    problems.check()
    spec = source.spec
    _check_tree(description, source, problems)
    problems.check()
    keyframe = _keyframe(description, source)
    names = [joint.name for joint in spec.joints if joint.type != mujoco.mjtJoint.mjJNT_FREE]
    locked = match_joints(problems, "model.locked_joints", description.locked_joints, names)
    try:
        lock_joints(spec, locked)
    except RobotError as error:
        raise RobotError(f"{source.path}: {error}") from None
    except ValueError as error:
        raise RobotError(f"{source.path}: MuJoCo cannot compile it: {one_line(error)}") from None
    _strip(source, problems)
    _check_names(source, problems)
    problems.check()
    bare = _compiled(source, skeleton(spec))
    for site in list(spec.sites):  # one may have a body's name, and placo has one list of both; `bare` keeps them
        spec.delete(site)
    motors = set_motors(description, source, bare, problems)
    bodies = {limb: _add_site(item, spec, bare, problems) for limb, item in description.limbs.items()}
    problems.check()
    model = _compiled(source, spec)
    mjcf, assets = spec.to_xml(), dict(spec.assets)
    home = _home(description, model, keyframe, problems)
    problems.check()
    return Assembly(source.path, mjcf, assets, model, motors.velocity, bodies, home, motors.warnings)


def _keyframe(description: RobotDescription, source: ModelSource) -> dict[str, float]:
    """Positions of hinges and slides in the keyframe that the home posture begins with; nothing where none is named.

    Raises:
        RobotError: The model has no such keyframe.
    """
    if description.keyframe is None:
        return {}
    names = [key.name for key in source.spec.keys]
    if description.keyframe not in names:
        wanted = f"[home] keyframe '{description.keyframe}' does not exist in {source.path.name}"
        raise RobotError(f"{description.path}: {wanted}; {suggestion(description.keyframe, names)}")
    model = _compiled(source, skeleton(source.spec))
    qpos = model.key(description.keyframe).qpos
    single = [j for j in range(model.njnt) if model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE]
    return {model.joint(j).name: float(qpos[model.jnt_qposadr[j]]) for j in single}


def _home(
    description: RobotDescription, model: mujoco.MjModel, keyframe: dict[str, float], problems: Problems
) -> dict[str, float]:
    names = [model.joint(j).name for j in range(1, model.njnt)]
    said = match_joints(problems, "home", description.home, names)
    home = {name: keyframe[name] for name in names if name in keyframe} | said
    for name in names:
        low, high = model.joint(name).range
        value = home.get(name, 0.0)
        if not low <= value <= high:
            problems.add(f"[home] joint '{name}' = {value:g} is outside its range {low:g} to {high:g}")
    return home


def _compiled(source: ModelSource, spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a spec of a source, or of a part of it."""
    try:
        return compile_spec(spec)
    except InputError as error:
        raise RobotError(f"{source.path}: {error}") from None
    except ValueError as error:
        raise RobotError(f"{source.path}: MuJoCo cannot compile it: {one_line(error)}") from None


def finish(assembly: Assembly, pairs: Sequence[tuple[str, str]]) -> Assembly:
    """The same robot, compiled from its text, without contacts between pairs of its bodies.

    Raises:
        RobotError: MuJoCo cannot compile the text.
    """
    mjcf = assembly.mjcf
    if pairs:
        lines = [f"<exclude body1={quoteattr(first)} body2={quoteattr(second)}/>" for first, second in pairs]
        end = mjcf.rindex("</mujoco>")  # MuJoCo merges sections of one kind
        mjcf = "\n    ".join([f"{mjcf[:end]}\n  <contact>", *lines]) + "\n  </contact>\n</mujoco>\n"
    try:
        model = compile_spec(mujoco.MjSpec.from_string(mjcf, assets=assembly.assets))
    except (ValueError, InputError) as error:
        raise RobotError(f"{assembly.path}: MuJoCo cannot compile it: {one_line(error)}") from None
    return replace(assembly, mjcf=mjcf, mujoco_model=model)


def _check_tree(description: RobotDescription, source: ModelSource, problems: Problems) -> None:
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
            f"{source.path.name}; found {', '.join(roots)}; drop the others in [mend]"
        )
    for joint in spec.joints:
        body = joint.parent.name
        if joint.type == mujoco.mjtJoint.mjJNT_BALL:
            problems.add(f"joint '{joint.name}' on body '{body}' is a ball joint; use three hinges", source.path)
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            if body != description.base:
                problems.add(f"body '{body}' floats freely; only the base may", source.path)
        elif body == description.base:
            problems.add(
                f"joint '{joint.name}' moves the base '{body}'; only a free joint may stand there", source.path
            )
        elif not joint.name:
            problems.add(f"a joint on body '{body}' has no name; name it", source.path)
    free = [joint for joint in base.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]
    root = free[0] if free else base.add_freejoint()
    root.name, root.align = ROOT_JOINT, mujoco.mjtAlignFree.mjALIGNFREE_FALSE
    unnamed = [body for body in spec.bodies if not body.name]
    for index, body in enumerate(unnamed):
        body.name = f"unnamed_body_{index}"


def _strip(source: ModelSource, problems: Problems) -> None:
    spec = source.spec
    joints = {joint.name for joint in spec.joints}
    for equality in list(spec.equalities):
        # A constraint between locked joints has no effect any more.
        if equality.type != mujoco.mjtEq.mjEQ_JOINT or equality.name1 in joints or equality.name2 in joints:
            what = f"'{equality.name}'" if equality.name else f"on '{equality.name1}'"
            problems.add(
                f"equality or mimic constraint {what} is not supported; remove it, or lock the joints in robot.toml "
                "[model.locked_joints]",
                source.path,
            )
        else:
            spec.delete(equality)
    if spec.tendons:
        problems.add(
            "tendons are not supported; remove them, or say without_tendons = true in robot.toml [mend]",
            source.path,
        )
    world = spec.worldbody
    for group in (spec.keys, spec.sensors, spec.cameras, spec.lights, world.geoms, world.sites):
        for item in list(group):
            spec.delete(item)
    for body in spec.bodies:
        body.gravcomp = 0.0
    for geom in spec.geoms:
        geom.priority = 0  # so that the world's friction is used
    copy_fields(mujoco.MjSpec().option, spec.option)


def _check_names(source: ModelSource, problems: Problems) -> None:
    bodies = {body.name for body in source.spec.bodies}
    for joint in source.spec.joints:
        if joint.name in bodies:
            problems.add(
                f"'{joint.name}' names both a joint and a body; rename the body to '{joint.name}_link', here or in "
                "[mend.rename_bodies]",
                source.path,
            )
    # A contact site is named after its limb, and no body may have that name in placo's list of frames.
    for limb in Limb:
        if limb.label in bodies:
            name = f"{limb.label}_link"
            if name in bodies:
                problems.add(f"has bodies '{limb.label}' and '{name}'; rename one of them", source.path)
            else:
                source.spec.body(limb.label).name = name


def _add_site(item: LimbDescription, spec: mujoco.MjSpec, bare: mujoco.MjModel, problems: Problems) -> str:
    """Add the contact site of a limb, and its pad; returns the name of its body, empty where there is a problem."""
    label = item.limb.label
    bodies = [bare.body(i).name for i in range(1, bare.nbody)]
    sites = [bare.site(i).name for i in range(bare.nsite) if bare.site(i).name]
    if item.site is not None:
        if item.site not in sites:
            problems.add(f"[limbs.{label}] site '{item.site}' does not exist; {suggestion(item.site, sites)}")
            return ""
        site = bare.site(item.site)
        body, pose = bare.body(site.bodyid[0]).name, Pose.from_quaternion(site.pos, site.quat) @ item.pose
    else:
        wanted = item.body or ""
        body = f"{wanted}_link" if wanted in {limb.label for limb in Limb} else wanted
        if body not in bodies:
            problems.add(f"[limbs.{label}] body '{item.body}' does not exist; {suggestion(body, bodies)}")
            return ""
        pose = item.pose
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
