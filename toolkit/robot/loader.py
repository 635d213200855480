"""Find robots and load them."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import mujoco
import numpy as np

from toolkit.errors import RobotError
from toolkit.geometry.pose import Pose
from toolkit.mjcf import warnings_refused
from toolkit.robot.agreement import check_agreement
from toolkit.robot.assemble import Assembly, assemble, exclude_pairs
from toolkit.robot.description import FILE_NAME, RobotDescription, match_joints, read_description
from toolkit.robot.geometry import derive_limbs
from toolkit.robot.home import check_patches, home_posture, touching_neighbours
from toolkit.robot.model import LimbModel, RobotModel
from toolkit.robot.problems import Problems
from toolkit.robot.reader import suggestion
from toolkit.robot.soundness import bare_trunk, check_palms, straight_legs
from toolkit.robot.source import find_model_file, read_model
from toolkit.robot.urdf import urdf_from_model
from toolkit.shipped import shipped

DEFAULT_GAINS = (200.0, 8.0)


def robots_folder(robots_dir: Path | None = None) -> Path:
    """The folder with one folder per robot: the given one, else `robots/` here, else the toolkit's own."""
    if robots_dir is not None:
        return Path(robots_dir)
    return Path.cwd() / "robots" if os.path.isdir("robots") else shipped("robots")


def find_robots(robots_dir: Path | None = None) -> tuple[str, ...]:
    """Sorted names of the folders with a robot.toml in the `robots_folder`."""
    return tuple(sorted(path.parent.name for path in robots_folder(robots_dir).glob(f"*/{FILE_NAME}")))


def _robot_folder(name: str, robots_dir: Path | None) -> Path:
    """The existing folder of a robot by its name in the robots folder or by a path to a folder with a robot.toml."""
    folder = robots_folder(robots_dir)
    for path in (folder / name, Path(name)):
        if name and os.path.isfile(path / FILE_NAME):
            return path.resolve()
    if name and os.path.isdir(name):
        raise RobotError(f"{name}: no {FILE_NAME} in this folder")
    raise RobotError(f"robot '{name}' is not in {folder}; {suggestion(name, find_robots(robots_dir))}")


def default_robot(robots_dir: Path | None = None) -> str:
    """Name of the robot that is used if none is named: the one in the file `default`, else the only robot.

    Raises:
        RobotError: There is no such file, and there is no robot or more than one.
    """
    folder = robots_folder(robots_dir)
    if os.path.isfile(folder / "default"):
        try:
            return (folder / "default").read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise RobotError(f"{folder / 'default'}: cannot be read ({error}); name a robot with --robot") from None
    names = find_robots(robots_dir)
    if len(names) != 1:
        found = ", ".join(names) or "none"
        raise RobotError(f"{folder}: which robot is meant? Found {found}; name one with --robot")
    return names[0]


def load_robot(name: str | None, robots_dir: Path | None = None) -> RobotModel:
    """Load a robot and check that MuJoCo, Pinocchio and placo agree about it.

    Args:
        name: Name of a folder in the robots folder, or a path to a folder with a robot.toml; None for `default_robot`.
        robots_dir: The robots folder; see `robots_folder`.

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
        check_patches(description, assembly)
        assembly = exclude_pairs(assembly, touching_neighbours(description, assembly.mujoco_model, home))
        model = assembly.mujoco_model
        joint_names = tuple(model.joint(j).name for j in range(1, model.njnt))
        gains = match_joints(problems, "gains", description.gains, joint_names)
        kp, kd = np.array([gains.get(joint, DEFAULT_GAINS) for joint in joint_names]).T
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
                limb: LimbModel(limb, limb.label, assembly.bodies[limb], item.patch / 2, item.max_force)
                for limb, item in description.limbs.items()
            },
            legs=legs,
            arms=arms,
            fingerprint=_fingerprint(description, assembly, home),
            warnings=(*assembly.warnings, *bare_trunk(model), *straight_legs(legs, home, model)),
        )
        check_agreement(robot)
        return robot


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
