"""Change what is wrong in a model file, in memory: names, empty bodies, collision shapes, forward axis, inertias."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from fnmatch import fnmatchcase

import mujoco
import numpy as np

from toolkit.geometry.pose import Pose, rotation_about_z, rotation_to_z
from toolkit.geometry.triangles import mesh_vertices
from toolkit.robot.mend_table import Box, Mend
from toolkit.robot.problems import Problems
from toolkit.robot.reader import suggestion
from toolkit.robot.source import ModelSource


def mended(source: ModelSource, mend: Mend, base: str, problems: Problems) -> ModelSource:
    """A model file with the changes of [mend]; its spec is changed.

    Args:
        source: The model file.
        mend: What is changed.
        base: Name of the base body, after bodies are renamed.
        problems: Where names are noted that the file does not have.

    Raises:
        ValueError: MuJoCo cannot compile the file, and boxes around its shapes are wanted.
    """
    spec = source.spec
    _rename(spec, mend, problems)
    for pattern in mend.drop:
        for body in _matching(spec, pattern, "drop", problems):
            if base in (item.name for item in [body, *_below(body)]):
                problems.add(f"[mend] drop '{pattern}' would remove the base '{base}'")
            else:
                spec.delete(body)
    if mend.without_tendons:
        _leave_out_tendons(spec)
    if spec.body(base) is not None:
        if mend.up is not None:
            _turn(spec.body(base), rotation_to_z(np.array(mend.up)))
        if mend.forward is not None:
            _turn(spec.body(base), rotation_about_z(-np.arctan2(mend.forward[1], mend.forward[0])))
    if mend.collision:
        _set_shapes(spec, mend.collision, problems)
    _exclude(spec, mend.exclude, problems)
    if mend.balance_inertia:
        spec.compiler.balanceinertia = True
    spec.compiler.boundmass = max(spec.compiler.boundmass, mend.least_mass)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, mend.least_inertia)
    return replace(source, velocity={mend.joints.get(name, name): value for name, value in source.velocity.items()})


def _rename(spec: mujoco.MjSpec, mend: Mend, problems: Problems) -> None:
    bodies, joints = {body.name: body for body in spec.bodies}, {joint.name: joint for joint in spec.joints}
    for table, renamed, there in (("rename_bodies", mend.bodies, bodies), ("rename_joints", mend.joints, joints)):
        for old, new in renamed.items():
            if old not in there:
                problems.add(f"[mend.{table}] '{old}' does not exist; {suggestion(old, there)}")
            elif new in there and new not in renamed:
                problems.add(f"[mend.{table}] '{new}' exists already; give '{old}' another name")
            else:
                there[old].name = new
    for exclude in spec.excludes:
        exclude.bodyname1 = mend.bodies.get(exclude.bodyname1, exclude.bodyname1)
        exclude.bodyname2 = mend.bodies.get(exclude.bodyname2, exclude.bodyname2)
    for actuator in spec.actuators:
        if actuator.trntype == mujoco.mjtTrn.mjTRN_JOINT:
            actuator.target = mend.joints.get(actuator.target, actuator.target)
    for equality in spec.equalities:
        if equality.type == mujoco.mjtEq.mjEQ_JOINT:
            equality.name1 = mend.joints.get(equality.name1, equality.name1)
            equality.name2 = mend.joints.get(equality.name2, equality.name2)


def _leave_out_tendons(spec: mujoco.MjSpec) -> None:
    actuators = [item for item in spec.actuators if item.trntype == mujoco.mjtTrn.mjTRN_TENDON]
    sensors = [item for item in spec.sensors if item.objtype == mujoco.mjtObj.mjOBJ_TENDON]
    equalities = [item for item in spec.equalities if item.type == mujoco.mjtEq.mjEQ_TENDON]
    for item in [*actuators, *sensors, *equalities, *spec.tendons]:
        spec.delete(item)


def _matching(spec: mujoco.MjSpec, pattern: str, table: str, problems: Problems) -> list[mujoco.MjsBody]:
    bodies = [body for body in spec.bodies if body.name != "world"]
    found = [body for body in bodies if fnmatchcase(body.name, pattern)]
    if not found:
        problems.add(f"[mend] {table} '{pattern}' matches no body; {suggestion(pattern, (b.name for b in bodies))}")
    return found


def _below(body: mujoco.MjsBody) -> Iterable[mujoco.MjsBody]:
    for child in body.bodies:
        yield child
        yield from _below(child)


def _turn(base: mujoco.MjsBody, back: np.ndarray) -> None:
    """Turn the axes of a body by the inverse of a rotation (3, 3); everything on it stays where it is."""
    frame = base.add_frame(quat=Pose(back, np.zeros(3)).quaternion_wxyz)
    for child in [*base.bodies, *base.geoms, *base.sites, *base.cameras, *base.lights]:
        if child.frame is None:
            child.set_frame(frame)
    for inner in base.frames:
        if inner != frame and inner.frame is None:
            inner.set_frame(frame)
    if base.explicitinertial:
        inertia = np.array(base.fullinertia)
        base.ipos = back @ np.array(base.ipos)
        if np.isfinite(inertia).all() and inertia.any():
            xx, yy, zz, xy, xz, yz = inertia
            full = back @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ back.T
            base.fullinertia = full[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        else:
            principal = Pose.from_quaternion(np.zeros(3), np.array(base.iquat)).rotation
            base.iquat = Pose(back @ principal, np.zeros(3)).quaternion_wxyz


def _set_shapes(spec: mujoco.MjSpec, wanted: dict[str, str | int | Box], problems: Problems) -> None:
    chosen: dict[str, str | int | Box] = {}
    for pattern, shape in wanted.items():
        chosen |= {body.name: shape for body in _matching(spec, pattern, "collision", problems)}
    model = spec.compile() if "box" in chosen.values() else None
    for name, shape in chosen.items():
        body = spec.body(name)
        for geom in body.geoms:
            kept = isinstance(shape, int) and geom.group == shape
            geom.contype = geom.conaffinity = int(kept)
        if shape == "box" and model is not None:
            shape = _bounds(model, model.body(name).id)
            if shape is None and name in wanted:  # a pattern may name bodies without any shape
                problems.add(f"[mend] collision '{name}': the body has no shape to put a box around")
        if isinstance(shape, Box):
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=shape.centre,
                size=np.array(shape.size) / 2,
                mass=0.0,
                contype=1,
                conaffinity=1,
                condim=3,
                group=3,
            )
    changed = {geom.name for name in chosen for geom in spec.body(name).geoms}
    for pair in list(spec.pairs):
        if {pair.geomname1, pair.geomname2} & changed:
            spec.delete(pair)


def _bounds(model: mujoco.MjModel, body: int) -> Box | None:
    """Box around the colliding shapes of a body, or around those that are only drawn; None where there are none."""
    of_body = np.flatnonzero(model.geom_bodyid == body)
    colliding = of_body[(model.geom_contype[of_body] | model.geom_conaffinity[of_body]) != 0]
    chosen = colliding if len(colliding) else of_body
    if not len(chosen):
        return None
    points = np.concatenate([geom_points(model, int(geom)) for geom in chosen])
    low, high = points.min(0), points.max(0)
    return Box(tuple((low + high) / 2), tuple(np.maximum(high - low, 1e-3)))


def geom_points(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Points (n, 3) m in its body whose hull holds a shape: vertices of a mesh, else corners of a box around it."""
    pose = Pose.from_quaternion(model.geom_pos[geom], model.geom_quat[geom])
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        points = mesh_vertices(model, model.geom_dataid[geom])
    else:
        points = model.geom_aabb[geom, :3] + box_corners(model.geom_aabb[geom, 3:])
    return pose @ points


def box_corners(half: np.ndarray) -> np.ndarray:
    """(8, 3) m; corners of a box with half extents (3,) m around the origin."""
    return np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), -1).reshape(-1, 3) * half


def geom_spheres(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, float]:
    """Centres (n, 3) m in its body and the radius in m of equal spheres whose hull holds a shape.

    They are exact for spheres, capsules, boxes and meshes; the radius of the latter two is 0.
    """
    kind, size = model.geom_type[geom], model.geom_size[geom]
    round_ends = kind == mujoco.mjtGeom.mjGEOM_CAPSULE
    if not (round_ends or kind == mujoco.mjtGeom.mjGEOM_SPHERE):
        return geom_points(model, geom), 0.0
    pose = Pose.from_quaternion(model.geom_pos[geom], model.geom_quat[geom])
    half = float(size[1]) if round_ends else 0.0
    return pose @ np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]), float(size[0])


def _exclude(spec: mujoco.MjSpec, pairs: Iterable[tuple[str, str]], problems: Problems) -> None:
    there = {frozenset((exclude.bodyname1, exclude.bodyname2)) for exclude in spec.excludes}
    for first, second in pairs:
        left, right = (_matching(spec, pattern, "exclude", problems) for pattern in (first, second))
        for pair in sorted({tuple(sorted((a.name, b.name))) for a in left for b in right if a.name != b.name}):
            if frozenset(pair) not in there:
                spec.add_exclude(bodyname1=pair[0], bodyname2=pair[1])
                there.add(frozenset(pair))
