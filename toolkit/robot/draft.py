"""Draft of a robot.toml for a model that nobody has described yet."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import mujoco
import numpy as np

from toolkit.geometry.limb import Limb
from toolkit.robot.anatomy import Anatomy, FoundPatch, find_anatomy
from toolkit.robot.motors import file_torques, most_torque
from toolkit.robot.posture import standing, stands, within
from toolkit.robot.source import ModelSource

_LEAST_MASS, _LEAST_INERTIA = 1e-3, 1e-6  # kg and kg m^2, of bodies without any
_STANDING = ("home", "stand", "standing", "default")  # names of keyframes that are likely to be postures to stand in
_GAIN = 3.0  # stiffness of the joints that carry the robot, as a multiple of m g h
_DAMPING = 0.01  # s; damping over stiffness


@dataclass(frozen=True)
class Draft:
    """A robot.toml to begin with.

    Attributes:
        text: The robot.toml.
        missing: What the file does not have and a person has to look up, one line each.
        anatomy: What the tree and the shapes suggest.
        model: The compiled file.
    """

    text: str
    missing: tuple[str, ...]
    anatomy: Anatomy
    model: mujoco.MjModel


def draft(source: ModelSource, where: Sequence[str]) -> Draft:
    """A robot.toml for a model file.

    Args:
        source: The model file, read without the collision shapes that cannot be read.
        where: Lines of [model] that name the file.

    Raises:
        ValueError: MuJoCo cannot compile the file.
    """
    model, inertia = compiled(source.spec)
    anatomy = find_anatomy(model)
    locked = _locked(model, anatomy)
    moved = [name for name in _joints(model) if name not in locked]
    missing = [*_missing_structure(model, anatomy), *_missing_numbers(model, source, moved)]
    parts = [
        ['description = ""', 'licence = "unknown"   # look it up', f'source = "{source.path.name}"'],
        ["[model]", *where, f'base = "{anatomy.base}"', *_lock_lines(model, locked)],
        _mend(model, source, anatomy, inertia),
        *(_limb(limb, patch) for limb, patch in zip(list(Limb)[:2], anatomy.feet, strict=False)),
        *(_palm(limb, patch, model) for limb, patch in zip(list(Limb)[2:], anatomy.palms, strict=False)),
        _home(model, anatomy, moved),
        _gains(model, anatomy),
        _limits(model, source, anatomy, moved),
    ]
    text = "\n\n".join("\n".join(part) for part in parts if part) + "\n"
    return Draft(text, tuple(missing), anatomy, model)


def compiled(spec: mujoco.MjSpec) -> tuple[mujoco.MjModel, list[str]]:
    """A compiled spec, and the lines of [mend] that it takes because of inertias which no body can have."""
    try:
        return spec.compile(), []
    except ValueError as error:
        if "inertia" not in str(error):
            raise
    spec = spec.copy()
    compiler = spec.compiler
    compiler.balanceinertia, compiler.boundmass, compiler.boundinertia = True, _LEAST_MASS, _LEAST_INERTIA
    lines = ["balance_inertia = true   # some bodies have an inertia that no body can have, or none"]
    return spec.compile(), [*lines, f"least_mass = {_LEAST_MASS}", f"least_inertia = {_LEAST_INERTIA}"]


def _missing_structure(model: mujoco.MjModel, anatomy: Anatomy) -> list[str]:
    missing = []
    if not anatomy.feet:
        missing.append("two legs of five joints or more, whose ends are equally low in the zero posture")
    for limb, patch in zip(Limb, [*anatomy.feet, *anatomy.palms], strict=False):
        if not patch.seen:
            missing.append(f"[limbs.{limb.label}]: '{patch.body}' has no shape that can be read")
    for name in anatomy.backward:
        low, high = model.joint(name).range
        missing.append(
            f"[limits.position] of '{name}', which bends against the other knee and the toes: perhaps "
            f"[{0.0 - high:.4g}, {0.0 - low:.4g}]"
        )
    for j in range(model.njnt):
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
            missing.append(f"hinges in place of the ball joint '{model.joint(j).name}'")
    return missing


def _missing_numbers(model: mujoco.MjModel, source: ModelSource, moved: list[str]) -> list[str]:
    return [
        f"[{table}] of {len(names)} joint{'s' * (len(names) > 1)} ({', '.join(names[:3])}{', ...' * (len(names) > 3)})"
        for table, names in _lacking(model, source, moved).items()
    ]


def _lacking(model: mujoco.MjModel, source: ModelSource, moved: list[str]) -> dict[str, list[str]]:
    """The joints for which a file has no limit that can be used, by the table of the robot.toml that names one."""
    torques = _torques(model)
    lacking = {
        "limits.position": [name for name in moved if not model.jnt_limited[model.joint(name).id]],
        "limits.torque": [name for name in moved if not torques.get(name)],
        "limits.velocity": [name for name in moved if name not in source.velocity],
    }
    return {table: names for table, names in lacking.items() if names}


def _torques(model: mujoco.MjModel) -> dict[str, float]:
    """The file's torque limits by joint, N m, that a motor can have."""
    most = most_torque(model) or np.inf
    return {name: torque for name, torque in file_torques(model).items() if torque <= most}


def _joints(model: mujoco.MjModel) -> list[str]:
    """Names of all joints but the free one."""
    free = mujoco.mjtJoint.mjJNT_FREE
    return [model.joint(j).name for j in range(model.njnt) if model.jnt_type[j] != free]


def _locked(model: mujoco.MjModel, anatomy: Anatomy) -> list[str]:
    """Joints that the toolkit cannot move: those that carry both legs, fingers and toes, and those tied to others."""
    tied = set()
    for equality in np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)):
        tied.update(model.joint(j).name for j in (model.eq_obj1id[equality], model.eq_obj2id[equality]) if j >= 0)
    return [*anatomy.shared, *anatomy.beyond, *sorted(tied - {*anatomy.shared, *anatomy.beyond})]


def _lock_lines(model: mujoco.MjModel, names: list[str]) -> list[str]:
    if not names:
        return []
    values = ", ".join(f"{_key(name)} = {within(model, model.joint(name).id, 0.0):g}" for name in names)
    return [f"locked_joints = {{ {values} }}"]


def _mend(model: mujoco.MjModel, source: ModelSource, anatomy: Anatomy, inertia: list[str]) -> list[str]:
    lines = list(inertia)
    bodies = [model.body(b).name for b in range(1, model.nbody)]
    same = [name for name in _joints(model) if name in bodies and name not in anatomy.shared]
    if same:
        lines.append("rename_bodies = { " + ", ".join(f'{_key(name)} = "{name}_link"' for name in same) + " }")
    empty = [name for name in anatomy.others if not float(model.body_subtreemass[model.body(name).id])]
    if empty:
        lines.append(f"drop = [{', '.join(_text(name) for name in empty)}]")
    if anatomy.up[2] < 0.98:
        lines.append(f"up = {_numbers(np.round(anatomy.up, 6) + 0.0)}   # in the axes of the base")
    if anatomy.toes[0] < 0.98:
        x, y = np.round(anatomy.toes, 6) + 0.0
        lines.append(f"forward = [{float(x)}, {float(y)}]   # the knees say where the toes point")
    if model.ntendon:
        lines.append("without_tendons = true   # what they limit or pull together, [limits.position] can narrow")
    if source.turned:
        lines.append("up_axis = true   # so the shapes lie around the links' centres of mass")
    if source.unread:
        shapes = ", ".join(f'{_key(name)} = "none"' for name in source.unread)
        lines.append(f"collision = {{ {shapes} }}   # their files cannot be read; boxes [[centre], [size]] are better")
    elif not (model.geom_contype | model.geom_conaffinity).any() and model.ngeom:
        groups = sorted(set(model.geom_group.tolist()))
        lines.append(f'collision = {{ "*" = "group {groups[-1]}" }}   # nothing collides; groups: {groups}')
    return ["[mend]", *lines] if lines else []


def _limb(limb: Limb, patch: FoundPatch) -> list[str]:
    pose = patch.pose
    quaternion = pose.quaternion_wxyz * (1.0 if pose.quaternion_wxyz[0] >= 0 else -1.0)
    lines = [f"[limbs.{limb.label}]", f"body = {_text(patch.body)}", f"position = {_numbers(pose.position)}"]
    if abs(quaternion[0]) < 1 - 1e-9:
        lines.append(f"quaternion_wxyz = {_numbers(quaternion, 9)}")
    lines.append(f"patch = {_numbers(np.floor(patch.size * 1e3 + 1e-6) / 1e3)}")
    return [*lines, "pad = 0.01"] if patch.pad else lines


def _palm(limb: Limb, patch: FoundPatch, model: mujoco.MjModel) -> list[str]:
    joints = list(patch.joints)
    elbow = joints[-4] if len(joints) >= 7 else joints[-2]
    torque = _torques(model).get(elbow)
    lines = _limb(limb, patch)
    if patch.weighed:
        lines[0] += "   # the hand has no shape: this is the end of a box with its inertia"
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body = model.body(patch.body).id
    palm = data.xmat[body].reshape(3, 3) @ patch.pose.position + data.xpos[body]
    lever = max(float(np.linalg.norm(palm - data.xanchor[model.joint(elbow).id])), 0.05)
    holds = f"what '{elbow}' holds on a lever of {lever:.2f} m"
    return [*lines, f"max_force = {torque / lever:.0f}.0   # {holds}" if torque else f"# max_force =    # N; {holds}"]


def _home(model: mujoco.MjModel, anatomy: Anatomy, moved: list[str]) -> list[str]:
    """The posture of a keyframe, with bent knees where its own are straight; else one that hangs its arms."""
    if not anatomy.feet:
        return []
    keys = [key for key in (model.key(k).name for k in range(model.nkey)) if key]
    likely = [*(name for name in _STANDING if name in keys), *keys]
    standing_key = next((name for name in likely if stands(model, anatomy, model.key(name).id)), None)
    lines, start = ["[home]", "flat_soles = true"], dict[str, float]()
    if standing_key:
        lines.append(f"keyframe = {_text(standing_key)}")
        start = {name: float(model.key(standing_key).qpos[model.jnt_qposadr[model.joint(name).id]]) for name in moved}
    angles = standing(model, anatomy, start)
    if start and angles:
        lines.append("# the keyframe's legs are too straight to step")
    ankles = {name for foot in anatomy.feet for name in foot.joints} - set(angles)
    said = {name: within(model, model.joint(name).id, angles.get(name, 0.0)) for name in moved if name not in ankles}
    said = {name: value for name, value in said.items() if value and (name in angles or not start)}
    patterns = _patterns(model, anatomy, list(said))
    for pattern in patterns:
        values = [value for name, value in said.items() if fnmatchcase(name, pattern)]
        if len(set(values)) == 1:
            lines.append(f"{_key(pattern)} = {values[0]:g}")
        else:
            lines += [f"{_key(name)} = {value:g}" for name, value in said.items() if fnmatchcase(name, pattern)]
    return lines


def _gains(model: mujoco.MjModel, anatomy: Anatomy) -> list[str]:
    """Stiff legs, and a tenth of that elsewhere."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    base = model.body(anatomy.base).id
    height = float(data.subtree_com[base, 2] - data.xpos[1:, 2].min())
    stiffness = float(f"{_GAIN * 9.81 * float(model.body_subtreemass[base]) * height:.1g}")
    lines = ["[gains]", f'"*" = [{stiffness / 10}, {_DAMPING * stiffness / 10:g}]']
    legs = [name for foot in anatomy.feet for name in foot.joints if name not in anatomy.shared]
    return lines + [
        f"{_key(name)} = [{stiffness}, {_DAMPING * stiffness:g}]" for name in _patterns(model, anatomy, legs)
    ]


def _limits(model: mujoco.MjModel, source: ModelSource, anatomy: Anatomy, moved: list[str]) -> list[str]:
    """Tables of what a file does not say, to be filled in."""
    said = {
        "limits.position": ("rad", "[-1.5, 1.5]"),
        "limits.torque": ("N m, of the motors' data sheets", "100.0"),
        "limits.velocity": ("rad/s, of the motors' data sheets", "10.0"),
    }
    lines = []
    for table, names in _lacking(model, source, moved).items():
        what, value = said[table]
        lines += [f'# {what}; remove the # before the lines, or say "*" = {value} of all', f"# [{table}]"]
        lines += [f"# {_key(name)} =" for name in _patterns(model, anatomy, names)]
    return lines


def _patterns(model: mujoco.MjModel, anatomy: Anatomy, names: Sequence[str]) -> list[str]:
    """The shortest list of names of joints and patterns, each of which means a joint and its mirror image."""
    arms, every = anatomy.arms or ((), ()), _joints(model)
    chains = [tuple(foot.joints for foot in anatomy.feet) or ((), ()), arms]
    pairs = {name: pair for left, right in chains for pair in zip(left, right, strict=False) for name in pair}
    found: list[str] = []
    for name in names:
        pair = pairs.get(name, (name, name))
        pattern = _pattern_of(*pair)
        fits = set(pair) <= set(names) and {other for other in every if fnmatchcase(other, pattern)} == set(pair)
        if (chosen := pattern if fits and len(set(pair)) == 2 else name) not in found:
            found.append(chosen)
    return found


def _pattern_of(first: str, second: str) -> str:
    """What the names of a left and a right joint have in common, with a wildcard where they differ."""
    before = len(os.path.commonprefix([first, second]))
    ends = [name[before:] for name in (first, second)]
    words = [end[: len(word)] for end, word in zip(ends, ("left", "right"), strict=True)]
    if [word.lower() for word in words] == ["left", "right"]:
        ends = [end[len(word) :] for end, word in zip(ends, words, strict=True)]
        return f"{first[:before]}*{ends[0]}"
    after = len(os.path.commonprefix([end[::-1] for end in ends]))
    middle = max(len(end) for end in ends) - after
    return f"{first[:before]}{'?' if middle == 1 else '*'}{ends[0][len(ends[0]) - after :]}"


def _key(name: str) -> str:
    bare = name.replace("_", "").replace("-", "")
    return name if bare.isascii() and bare.isalnum() else _text(name)


def _text(name: str) -> str:
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _numbers(values: Iterable[float], digits: int = 5) -> str:
    return "[" + ", ".join(repr(float(np.round(value, digits)) + 0.0) for value in values) + "]"
