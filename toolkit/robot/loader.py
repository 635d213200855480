"""Find robots and load them."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import mujoco
import numpy as np

from toolkit.errors import RobotError
from toolkit.geometry.limb import FEET
from toolkit.geometry.pose import Pose
from toolkit.mjcf import warnings_refused
from toolkit.robot.agreement import check_agreement
from toolkit.robot.assemble import Assembly, assemble, finish
from toolkit.robot.chain import joints_to
from toolkit.robot.description import FILE_NAME, RobotDescription, match_joints, read_description
from toolkit.robot.geometry import derive_limbs
from toolkit.robot.home import check_patches, home_posture, touching_neighbours
from toolkit.robot.model import LimbModel, RobotModel
from toolkit.robot.problems import Problems
from toolkit.robot.reader import suggestion
from toolkit.robot.rolling import sole_rolls
from toolkit.robot.soundness import bare_trunk, check_palms, mesh_patches, straight_legs
from toolkit.robot.source import find_model_file, read_model
from toolkit.robot.urdf import urdf_from_model
from toolkit.shipped import shipped

STIFFNESS = 3.0
"""Default stiffness of legs, as a multiple of m g h, which an ankle needs to hold the robot up; arms take a tenth."""
DAMPING = 0.01
"""Default damping over stiffness, s."""


def robots_folder(robots_dir: Path | None = None) -> Path:
    """The folder in which robots are looked for first: the given one, else `robots/` here, else the toolkit's own."""
    return _folders(robots_dir)[0]


def find_robots(robots_dir: Path | None = None) -> tuple[str, ...]:
    """Sorted names of the robots in the given folder; where none is given, in `robots/` here and of those shipped."""
    return tuple(sorted({name for folder in _folders(robots_dir) for name in _names(folder)}))


def _folders(robots_dir: Path | None) -> tuple[Path, ...]:
    """Where robots are looked for, in order: in the given folder alone, or in `robots/` here and among the shipped."""
    if robots_dir is not None:
        return (Path(robots_dir),)
    return (Path.cwd() / "robots", shipped("robots")) if os.path.isdir("robots") else (shipped("robots"),)


def _names(folder: Path) -> list[str]:
    """Names of the robots in a folder."""
    return [path.parent.name for path in folder.glob(f"*/{FILE_NAME}")]


def _robot_folder(name: str, robots_dir: Path | None) -> Path:
    """The existing folder of a robot by its name, or by a path to a folder with a robot.toml.

    A path comes before a shipped robot of that name, and after those in `robots_folder`.
    """
    first, *others = _folders(robots_dir)
    for path in (first / name, Path(name), *(folder / name for folder in others)):
        if name and os.path.isfile(path / FILE_NAME):
            return path.resolve()
    if name and os.path.isdir(name):
        raise RobotError(f"{name}: no {FILE_NAME} in this folder")
    raise RobotError(f"robot '{name}' is not in {first}; {suggestion(name, find_robots(robots_dir))}")


def default_robot(robots_dir: Path | None = None) -> str:
    """Name of the robot that is used if none is named: the one in the file `default`, else the only robot.

    Where `robots/` here holds neither, it is that of the toolkit.

    Raises:
        RobotError: There is no such file, and there is no robot or more than one.
    """
    folders = _folders(robots_dir)
    folder = next((each for each in folders if (each / "default").is_file() or _names(each)), folders[0])
    if os.path.isfile(folder / "default"):
        try:
            return (folder / "default").read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise RobotError(f"{folder / 'default'}: cannot be read ({error}); name a robot with --robot") from None
    names = sorted(_names(folder))
    if len(names) != 1:
        found = ", ".join(names) or "none"
        raise RobotError(f"{folder}: which robot is meant? Found {found}; name one with --robot")
    return names[0]


def load_robot(name: str | None, robots_dir: Path | None = None) -> RobotModel:
    """Load a robot and check that MuJoCo, Pinocchio and placo agree about it.

    Args:
        name: Name of a robot (see `find_robots`), or a path to a folder with a robot.toml; None for `default_robot`.
        robots_dir: The only folder in which names are looked for; None for `robots/` here, then the shipped robots.

    Returns:
        The robot.

    Raises:
        RobotError: There is no such robot, or its description is broken, incomplete or inconsistent.
    """
    folder = _robot_folder(default_robot(robots_dir) if name is None else name, robots_dir)
    with warnings_refused(str(folder), RobotError):
        description = read_description(folder / FILE_NAME)
        assembly = assemble(description, read_model(find_model_file(description), description.mend))
        where, problems = description.path, Problems(description.path)
        home = home_posture(description, assembly.mujoco_model, assembly.home)
        assembly = finish(assembly, touching_neighbours(description, assembly.mujoco_model, home))
        model = assembly.mujoco_model
        home = home_posture(description, model, assembly.home)  # with the digits of the text
        check_patches(description, assembly)
        joint_names = tuple(model.joint(j).name for j in range(1, model.njnt))
        try:
            urdf = urdf_from_model(model, folder.name)
            legs, arms = derive_limbs(model, home, assembly.bodies)
        except RobotError as error:
            raise RobotError(f"{where}: {error}") from None
        check_palms(model, home, description.limbs, problems)
        problems.check()
        data = mujoco.MjData(model)
        data.qpos[:] = home
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        kp, kd = _gains(description, assembly, joint_names, float(data.subtree_com[1, 2]))
        robot = RobotModel(
            name=folder.name,
            folder=folder,
            mjcf=assembly.mjcf,
            assets=assembly.assets,
            mujoco_model=model,
            urdf=urdf,
            base=model.body(1).name,
            joint_names=joint_names,
            lower=model.jnt_range[1:, 0].copy(),
            upper=model.jnt_range[1:, 1].copy(),
            velocity_limit=np.array([assembly.velocity[joint] for joint in joint_names]),
            torque_limit=model.actuator_forcerange[:, 1].copy(),
            armature=model.dof_armature[6:].copy(),
            kp=kp,
            kd=kd,
            home=home,
            mass=float(model.body_subtreemass[1]),
            com_height=float(data.subtree_com[1, 2]),
            limbs={
                limb: LimbModel(
                    limb, limb.label, assembly.bodies[limb], item.patch / 2, item.max_force, sole_rolls(model, limb)
                )
                for limb, item in description.limbs.items()
            },
            legs=legs,
            arms=arms,
            fingerprint=_fingerprint(description, assembly, home),
            warnings=(
                *assembly.warnings,
                *bare_trunk(model),
                *mesh_patches(model, home, description.limbs),
                *straight_legs(legs, home, model),
            ),
        )
        check_agreement(robot)
        return robot


def _gains(
    description: RobotDescription, assembly: Assembly, joint_names: tuple[str, ...], com_height: float
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (n,) in N m/rad and damping (n,) in N m s/rad; by the body where the robot.toml says nothing."""
    model = assembly.mujoco_model
    said = match_joints(Problems(description.path), "gains", description.gains, joint_names)
    legs = {model.joint(j).name for foot in FEET for j in joints_to(model, model.body(assembly.bodies[foot]).id)}
    stiff = STIFFNESS * float(model.body_subtreemass[1]) * 9.81 * com_height
    usual = {name: stiff if name in legs else stiff / 10 for name in joint_names}
    kp, kd = np.array([said.get(name, (usual[name], DAMPING * usual[name])) for name in joint_names]).T
    return kp, kd


def _fingerprint(description: RobotDescription, assembly: Assembly, home: np.ndarray) -> str:
    """Hash of everything that the dynamics depend on: kinematics, inertia, limits, shapes, contact patches and home.

    It is taken over numbers of the compiled model rounded to 1e-6, so that colours, comments and the XML format of a
    release of MuJoCo have no effect. It has 64 hexadecimal digits.
    """
    model = assembly.mujoco_model
    joints = [model.joint(j).name for j in range(1, model.njnt)]
    rotations = [Pose.from_quaternion(np.zeros(3), q).rotation for q in model.body_iquat]
    inertia = [r @ np.diag(i) @ r.T for r, i in zip(rotations, model.body_inertia, strict=True)]
    shapes = [model.geom_bodyid, model.geom_type, model.geom_contype, model.geom_conaffinity, model.geom_condim]
    numbers = [
        model.body_parentid, model.body_pos[2:], _signless(model.body_quat[2:]),
        model.body_mass, model.body_ipos, inertia,
        model.jnt_type, model.jnt_bodyid, model.jnt_pos, model.jnt_axis, model.jnt_range, model.qpos0[7:],
        model.jnt_stiffness, model.dof_armature, model.dof_damping, model.dof_frictionloss,
        model.actuator_forcerange, [assembly.velocity[joint] for joint in joints],
        *shapes, model.geom_size, model.geom_pos, _signless(model.geom_quat), model.geom_friction,
        model.site_bodyid, model.site_pos, _signless(model.site_quat),
        *[[*item.patch, min(item.max_force, 1e9)] for item in description.limbs.values()],
        home,
    ]  # fmt: skip
    digest = hashlib.sha256(json.dumps([joints, [int(limb) for limb in description.limbs]]).encode())
    for array in numbers:
        rounded = np.round(np.asarray(array, float), 6) + 0.0  # no negative zero
        digest.update(json.dumps([rounded.shape, rounded.ravel().tolist()]).encode())
    return digest.hexdigest()


def _signless(quaternions: np.ndarray) -> np.ndarray:
    """Outer products q qᵀ: the same for q and -q."""
    return quaternions[:, :, None] * quaternions[:, None, :]
