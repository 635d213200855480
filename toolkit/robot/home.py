"""The home posture: joints by pattern, and a base pose that puts the soles on the ground."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from scipy.optimize import least_squares

from toolkit.errors import RobotError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose, rolled_onto, yaw_of
from toolkit.robot.assemble import Assembly
from toolkit.robot.chain import joints_to
from toolkit.robot.description import RobotDescription
from toolkit.robot.mend import geom_spheres
from toolkit.robot.rolling import sole_rolls
from toolkit.robot.skeleton import colliding_only

MAX_SOLE_TILT = 0.02  # rad
MAX_SOLE_STEP = 0.005  # m
MAX_NEIGHBOUR_JOINTS = 5  # joints on the path between bodies whose shapes may overlap by construction
MAX_GAP = 0.005  # m; largest distance from a contact patch to the shapes of its limb
MAX_SINK = 0.003  # m; largest depth below the soles of other parts of the robot


def home_posture(description: RobotDescription, model: mujoco.MjModel, values: Mapping[str, float]) -> np.ndarray:
    """Home qpos (7 + n,) of a robot alone: soles on z = 0, mean of the feet above the origin, heading +x.

    Args:
        description: What the robot.toml says.
        model: The robot alone.
        values: Positions of joints, rad; those that are not there are at 0.

    Raises:
        RobotError: The soles are not level with each other, or the CoM is not above the feet.
    """
    where = description.path
    data = mujoco.MjData(model)
    data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    for joint in range(1, model.njnt):
        data.qpos[model.jnt_qposadr[joint]] = values.get(model.joint(joint).name, 0.0)
    if description.flat_soles:
        for foot in FEET:
            _flatten(model, data, foot)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)

    sites = [model.site(foot.label).id for foot in FEET]
    turns = [data.site_xmat[site].reshape(3, 3) for site in sites]
    turns = [
        rolled_onto(turn, np.array([0.0, 0.0, 1.0])) if sole_rolls(model, foot) else turn
        for foot, turn in zip(FEET, turns, strict=True)
    ]
    soles = [Pose(turn, data.site_xpos[site]) for turn, site in zip(turns, sites, strict=True)]
    _check_level(description, soles)
    up = soles[0].normal + soles[1].normal
    up = up / np.linalg.norm(up)
    x = soles[0].rotation[:, 0] + soles[1].rotation[:, 0]
    x = x - up * (up @ x)
    x = x / np.linalg.norm(x)
    level = np.stack([x, np.cross(up, x), up])  # rows: the world's axes in the base
    centre = (soles[0].position + soles[1].position) / 2
    base = Pose(level, -level @ centre)
    if abs(yaw_of(base.rotation)) > np.pi / 2:
        raise RobotError(f"{where}: the feet point against the base's x axis; correct the poses of the contact limbs")
    data.qpos[:3], data.qpos[3:7] = base.position, base.quaternion_wxyz
    _check_balance(description, base @ data.subtree_com[1], [base @ sole for sole in soles])
    _check_lowest(description, model, data)
    return data.qpos.copy()


def _flatten(model: mujoco.MjModel, data: mujoco.MjData, foot: Limb) -> None:
    """Turn the joints below the knee until the sole's normal is the base's z axis, or as near to it as they go.

    A sole that rolls is turned until its x axis is level.
    """
    site = model.site(foot.label).id
    ankle = np.array(joints_to(model, int(model.site_bodyid[site]))[4:], int)
    address, rolls = model.jnt_qposadr[ankle], sole_rolls(model, foot)

    def tilt(angles: np.ndarray) -> np.ndarray:
        data.qpos[address] = angles
        mujoco.mj_kinematics(model, data)
        turn = data.site_xmat[site].reshape(3, 3)  # the base stands upright while this is solved
        return turn[2, :1].copy() if rolls else turn[:2, 2].copy()

    low, high = model.jnt_range[ankle].T
    start = np.clip(data.qpos[address], low + 1e-6, high - 1e-6)
    data.qpos[address] = least_squares(tilt, start, bounds=(low, high), xtol=1e-14, ftol=1e-14, gtol=1e-14).x


def check_patches(description: RobotDescription, assembly: Assembly) -> None:
    """Check that every contact patch lies on a shape of its limb, so that the planned patch is what touches.

    Raises:
        RobotError: No colliding shape of the body, or of a body fixed to it, is near the patch.
    """
    spec = mujoco.MjSpec.from_string(assembly.mjcf, assets=assembly.assets)
    for limb, item in description.limbs.items():
        site = spec.site(limb.label)
        spec.body(assembly.bodies[limb]).add_geom(
            name=f"{limb.label}_patch",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=site.pos,
            quat=site.quat,
            size=[*(item.patch / 2), 1e-4],
            mass=0.0,
            contype=1,
            conaffinity=1,
        )
    model = colliding_only(spec).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    colliding = (model.geom_contype | model.geom_conaffinity) != 0
    for limb in description.limbs:
        patch, body = model.geom(f"{limb.label}_patch").id, assembly.bodies[limb]
        rigid = model.body_weldid[model.geom_bodyid] == model.body_weldid[model.body(body).id]
        others = np.arange(model.ngeom) != patch
        shapes = np.flatnonzero(colliding & rigid & others).tolist()
        gap = min((mujoco.mj_geomDistance(model, data, patch, shape, 1e3, None) for shape in shapes), default=np.inf)
        if gap > MAX_GAP:
            far = f"{1e3 * gap:.0f} mm from the nearest" if shapes else "on a body without any"
            raise RobotError(
                f"{description.path}: the patch of [limbs.{limb.label}] is {far} collision shape of '{body}' (at most "
                f"{1e3 * MAX_GAP:.0f} mm); move it onto the shape that touches, or give it a `pad`"
            )


def touching_neighbours(
    description: RobotDescription, model: mujoco.MjModel, home: np.ndarray
) -> list[tuple[str, str]]:
    """Names of pairs of bodies close in the chain whose collision shapes overlap in the home qpos (7 + n,).

    Such shapes overlap by construction (meshes around a joint), so their contacts must be ignored.

    Raises:
        RobotError: Bodies further apart in the chain touch, so the posture itself is wrong.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = home
    mujoco.mj_fwdPosition(model, data)
    pairs = sorted({(int(min(pair)), int(max(pair))) for pair in model.geom_bodyid[data.contact.geom]})
    for first, second in pairs:
        if _joints_between(model, first, second) > MAX_NEIGHBOUR_JOINTS:
            raise RobotError(
                f"{description.path}: in the home posture '{model.body(first).name}' touches "
                f"'{model.body(second).name}'; correct [home], or <exclude> the pair in the model"
            )
    return [(model.body(first).name, model.body(second).name) for first, second in pairs]


def _joints_between(model: mujoco.MjModel, first: int, second: int) -> int:
    """Number of joints on the path between two bodies of one tree."""
    count = 0
    while first != second:
        deeper = max(first, second)  # a child's index is larger than its parent's
        count += int(model.body_jntnum[deeper])
        first, second = min(first, second), int(model.body_parentid[deeper])
    return count


def _check_level(description: RobotDescription, soles: list[Pose]) -> None:
    tilt = float(np.arccos(np.clip(soles[0].normal @ soles[1].normal, -1, 1)))
    step = abs(float((soles[1].position - soles[0].position) @ soles[0].normal))
    if tilt > MAX_SOLE_TILT or step > MAX_SOLE_STEP:
        raise RobotError(
            f"{description.path}: [home] leaves the soles {np.degrees(tilt):.1f}° and {1e3 * step:.1f} mm apart from "
            f"one plane (at most {np.degrees(MAX_SOLE_TILT):.1f}° and {1e3 * MAX_SOLE_STEP:.0f} mm); correct [home] or "
            "the poses in [limbs], or let `flat_soles = true` in [home] turn the ankles"
        )


def _check_balance(description: RobotDescription, com: np.ndarray, soles: list[Pose]) -> None:
    half = np.array([description.limbs[foot].patch[0] / 2 for foot in FEET])
    front = max(sole.position[0] + h for sole, h in zip(soles, half, strict=True))
    back = min(sole.position[0] - h for sole, h in zip(soles, half, strict=True))
    left, right = max(sole.position[1] for sole in soles), min(sole.position[1] for sole in soles)
    if not (back < com[0] < front and right <= com[1] <= left and com[2] > 0):
        raise RobotError(
            f"{description.path}: [home] puts the CoM at {com[0]:.3f}, y {com[1]:.3f}, z {com[2]:.3f} m, not over the "
            f"feet (x {back:.3f} to {front:.3f}, y {right:.3f} to {left:.3f}); correct [home] or the poses in [limbs]"
        )


def _check_lowest(description: RobotDescription, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Raise if a shape reaches below the soles, because only the patches may touch the ground."""
    mujoco.mj_kinematics(model, data)
    for geom in range(model.ngeom):
        if not model.geom_contype[geom] | model.geom_conaffinity[geom]:
            continue
        points, radius = geom_spheres(model, geom)
        body = int(model.geom_bodyid[geom])
        lowest = float((points @ data.xmat[body].reshape(3, 3).T + data.xpos[body])[:, 2].min()) - radius
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_BOX:
            lowest = max(lowest, float(data.geom_xpos[geom][2] - model.geom_rbound[geom]))
        if lowest < -MAX_SINK:
            raise RobotError(
                f"{description.path}: in the home posture a collision shape of body '{model.body(body).name}' reaches "
                f"{-1e3 * lowest:.1f} mm below the soles; move the [limbs] poses down, or correct [home] or the model"
            )
