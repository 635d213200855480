"""What drives each joint: limits, armature and passive forces, from the model file and the robot.toml."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from toolkit.robot.description import RobotDescription, match_joints
from toolkit.robot.problems import Problems
from toolkit.robot.source import ModelSource

SPIN_UP = 0.005
"""Seconds in which a motor alone reaches its top speed at full torque; gives the armature of joints without any.

Unitree's G1, whose rotors are known, needs 0.004 to 0.019 s, humanoids with gears of 1:100 about 0.002 to 0.025 s.
"""
PASSIVE_SHARE = 0.05
"""Largest share of a motor's torque that passive friction, or passive damping at the joint's top speed, may take.

The toolkit plans and controls torques without passive forces, and servo models carry damping of a servo's own.
"""
_MOST_LEVER = 20.0  # largest torque, as a multiple of the robot's weight on a lever as long as the robot
_MOST_NAMES = 6  # most joints that a message names
_MOST_SPEED = 100.0  # rad/s; joints of legged robots stay below 40


@dataclass(frozen=True)
class Motors:
    """What `set_motors` found.

    Attributes:
        velocity: Velocity limit by joint, rad/s.
        warnings: What was assumed or changed, one line each.
    """

    velocity: dict[str, float]
    warnings: tuple[str, ...]


def set_motors(description: RobotDescription, source: ModelSource, bare: mujoco.MjModel, problems: Problems) -> Motors:
    """Give every joint of a spec a torque actuator, its limits, its armature and its passive forces.

    Args:
        description: What the robot.toml says.
        source: The model; its spec is changed.
        bare: The compiled spec.
        problems: Where missing and impossible limits are noted; the spec is not changed where there are any.
    """
    names = [bare.joint(j).name for j in range(bare.njnt) if bare.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE]
    said = {table: match_joints(problems, table, patterns, names) for table, patterns in description.tables.items()}
    torque, velocity = file_torques(bare) | said["limits.torque"], source.velocity | said["limits.velocity"]
    position = _positions(description, source, bare, said["limits.position"], names, problems)
    for table, values in (("torque", torque), ("velocity", velocity)):
        lacking = [name for name in names if not np.isfinite(values.get(name, np.nan)) or values[name] <= 0]
        _note_lacking(description, source, table, lacking, problems)
    most = most_torque(bare)
    strong = [name for name in names if torque.get(name, 0.0) > most]
    if strong and most > 0:
        problems.add(
            f"{_listed(strong)}: a torque limit of {max(torque[name] for name in strong):g} N m is out of any motor's "
            f"reach (this body needs less than {most:.0f}); give the motor's own in [limits.torque]"
        )
    if problems.found:
        return Motors({}, ())
    limits = {name: (torque[name], velocity[name]) for name in names}
    warnings = [*_fast(limits), *_set_passive(source.spec, bare, limits, said["damping"], said["friction_loss"])]
    warnings += _set_armature(source.spec, bare, limits, said["armature"])
    for actuator in list(source.spec.actuators):
        source.spec.delete(actuator)
    for name in names:
        _set_actuator(source.spec, name, position[name], torque[name])
    return Motors({name: float(velocity[name]) for name in names}, tuple(warnings))


def _positions(
    description: RobotDescription,
    source: ModelSource,
    bare: mujoco.MjModel,
    said: Mapping[str, tuple[float, float]],
    names: list[str],
    problems: Problems,
) -> dict[str, tuple[float, float]]:
    position, lacking = {}, []
    for name in names:
        index = bare.joint(name).id
        lower, upper = said.get(name, bare.jnt_range[index])
        if name not in said and not bare.jnt_limited[index]:
            lacking.append(name)
        elif not lower < upper:
            problems.add(f"joint '{name}' has the empty range {lower:g} to {upper:g}")
        position[name] = float(lower), float(upper)
    _note_lacking(description, source, "position", lacking, problems)
    return position


def _note_lacking(
    description: RobotDescription, source: ModelSource, table: str, names: list[str], problems: Problems
) -> None:
    if names:
        has, them = ("has", "it") if len(names) == 1 else ("have", "them")
        problems.add(
            f"{_listed(names)} {has} no {table} limit; add {them} to {description.path} [limits.{table}]", source.path
        )


def _listed(names: Iterable[str]) -> str:
    quoted = [f"'{name}'" for name in names]
    shown = ", ".join(quoted[:_MOST_NAMES]) + (f" and {len(quoted) - _MOST_NAMES} more" if quoted[_MOST_NAMES:] else "")
    return f"joint{'s' if len(quoted) > 1 else ''} {shown}"


def most_torque(bare: mujoco.MjModel) -> float:
    """Torque in N m that no motor of a model reaches."""
    return _MOST_LEVER * 9.81 * float(bare.body_mass.sum()) * _height(bare)


def _height(bare: mujoco.MjModel) -> float:
    """Height in m of the zero posture, from one body's frame to another's."""
    data = mujoco.MjData(bare)
    mujoco.mj_kinematics(bare, data)
    return float(np.ptp(data.xpos[1:], axis=0).max())


def file_torques(bare: mujoco.MjModel) -> dict[str, float]:
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


def _fast(limits: Mapping[str, tuple[float, float]]) -> list[str]:
    fast = [name for name, (_, velocity) in limits.items() if velocity > _MOST_SPEED]
    if not fast:
        return []
    return [
        f"{_listed(fast)}: a speed limit above {_MOST_SPEED:g} rad/s is out of most motors' reach; give the motor's "
        "own in [limits.velocity]"
    ]


def _set_passive(
    spec: mujoco.MjSpec,
    bare: mujoco.MjModel,
    limits: Mapping[str, tuple[float, float]],
    damping: Mapping[str, float],
    friction: Mapping[str, float],
) -> list[str]:
    cut: dict[str, list[str]] = {"damping": [], "friction_loss": []}
    for name, (torque, velocity) in limits.items():
        joint, dof = spec.joint(name), bare.jnt_dofadr[bare.joint(name).id]
        most = {"damping": PASSIVE_SHARE * torque / velocity, "friction_loss": PASSIVE_SHARE * torque}
        found = {"damping": bare.dof_damping[dof], "friction_loss": bare.dof_frictionloss[dof]}
        values = {}
        for what, said in (("damping", damping), ("friction_loss", friction)):
            if name not in said and found[what] > most[what]:
                cut[what].append(name)
            values[what] = float(said.get(name, min(found[what], most[what])))
        joint.damping = [values["damping"], 0.0, 0.0]
        joint.frictionloss = values["friction_loss"]
    return [
        f"{_listed(names)}: the file's passive {what.replace('_', ' ')} takes more than {PASSIVE_SHARE:.0%} of the "
        f"motor's torque and is cut to that; say what is left of it in [{what}]"
        for what, names in cut.items()
        if names
    ]


def _set_armature(
    spec: mujoco.MjSpec,
    bare: mujoco.MjModel,
    limits: Mapping[str, tuple[float, float]],
    said: Mapping[str, float],
) -> list[str]:
    assumed = {}
    for name, (torque, velocity) in limits.items():
        found = float(bare.dof_armature[bare.jnt_dofadr[bare.joint(name).id]])
        if name not in said and found == 0.0:
            assumed[name] = SPIN_UP * torque / velocity
        spec.joint(name).armature = said.get(name, assumed.get(name, found))
    if not assumed:
        return []
    low, high = min(assumed.values()), max(assumed.values())
    return [
        f"{_listed(assumed)}: the file has no armature; {low:.2g} to {high:.2g} kg m^2 are assumed, with which a motor "
        f"alone reaches its top speed in {SPIN_UP:g} s; say what the rotors have in [armature]"
    ]


def _set_actuator(spec: mujoco.MjSpec, name: str, position: tuple[float, float], torque: float) -> None:
    joint = spec.joint(name)
    scale = 1.0 if not spec.compiler.degree or joint.type != mujoco.mjtJoint.mjJNT_HINGE else 180.0 / np.pi
    joint.limited, joint.range = mujoco.mjtLimited.mjLIMITED_TRUE, [position[0] * scale, position[1] * scale]
    joint.actfrclimited, joint.actgravcomp = mujoco.mjtLimited.mjLIMITED_FALSE, False
    motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.set_to_motor()
    motor.gear = [1.0, 0, 0, 0, 0, 0]
    motor.ctrllimited = motor.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    motor.ctrlrange = motor.forcerange = [-torque, torque]
