"""What makes a robot useless though its model compiles: shapes, palms and legs that make no sense."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.robot.chain import arm_joints, bodies_above, joints_to
from toolkit.robot.description import LimbDescription
from toolkit.robot.mend import geom_spheres
from toolkit.robot.model import LegGeometry
from toolkit.robot.problems import Problems

FAR = 0.1
"""Largest distance of a padded patch from the other shapes of its body, as a share of the CoM's height."""
_BEARING = 0.002  # m; shapes as close to the plane of a patch bear it
_FACING_AWAY = -0.2  # least cosine between a palm's z axis and the direction to its elbow
_SLACK = 0.02  # least slack of a leg, as a share of its length: a step of 0.4 lengths takes as much


def bare_trunk(model: mujoco.MjModel) -> list[str]:
    """A warning where no shape above the knees collides: nothing keeps such a robot out of walls, or out of itself."""
    legs = set()
    for foot in FEET:
        joints = joints_to(model, int(model.site_bodyid[model.site(foot.label).id]))
        legs.update(model.jnt_bodyid[joints[3:]].tolist())  # from the knee down
    colliding = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    if any(not legs.intersection(bodies_above(model, int(model.geom_bodyid[geom]))) for geom in colliding):
        return []
    return ["no shape above the knees collides; add geoms to the model, or choose shapes in [mend.collision]"]


def mesh_patches(model: mujoco.MjModel, home: np.ndarray, limbs: Mapping[Limb, LimbDescription]) -> list[str]:
    """A warning where meshes alone bear a patch: MuJoCo finds few of their contact points at a time, which slide.

    Args:
        model: The robot alone.
        home: Its home posture qpos (7 + n,).
        limbs: Its limbs.
    """
    data, names = _posed(model, home), []
    for limb in limbs:
        site = model.site(limb.label).id
        position, normal = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)[:, 2]
        bearing = set()
        for geom in _shapes(model, limb):
            if model.geom_contype[geom] | model.geom_conaffinity[geom]:
                body = model.geom_bodyid[geom]
                points, radius = geom_spheres(model, geom)
                heights = (data.xpos[body] + points @ data.xmat[body].reshape(3, 3).T - position) @ normal
                if heights.min() - radius < _BEARING:
                    bearing.add(int(model.geom_type[geom]))
        if bearing == {int(mujoco.mjtGeom.mjGEOM_MESH)}:
            names.append(limb.label)
    if not names:
        return []
    return [
        f"only meshes bear the patches of {', '.join(names)}, and MuJoCo finds few of their contact points at a time: "
        "standing limbs would rock and slide; give each a `pad`"
    ]


def check_palms(
    model: mujoco.MjModel, home: np.ndarray, limbs: Mapping[Limb, LimbDescription], problems: Problems
) -> None:
    """Note palms that face their own forearm, and padded patches far from all other shapes of their body."""
    data = _posed(model, home)
    far = FAR * float(data.subtree_com[1, 2])
    for limb, item in limbs.items():
        site = model.site(limb.label).id
        position, normal = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)[:, 2]
        gap = _gap(model, data, limb)
        if item.pad is not None and gap > far:
            problems.add(
                f"the patch of [limbs.{limb.label}] lies {1e3 * gap:.0f} mm from its body (at most {1e3 * far:.0f} "
                "mm): move it onto the shape that shall touch"
            )
        if limb in PALMS:
            joints = arm_joints(model, limb)
            towards = data.xanchor[joints[min(3, len(joints) - 1)]] - position if joints else normal
            distance = float(np.linalg.norm(towards))
            if distance > 1e-6 and float(normal @ towards) / distance < _FACING_AWAY:
                problems.add(
                    f"[limbs.{limb.label}] faces its own forearm; turn it over, so that its z axis points from the "
                    "touched surface into the hand"
                )


def straight_legs(legs: Mapping[Limb, LegGeometry], home: np.ndarray, model: mujoco.MjModel) -> list[str]:
    """A warning where a leg of the home posture, qpos (7 + n,), is so straight that it cannot step far."""
    data = _posed(model, home)
    base = data.xmat[1].reshape(3, 3)
    warnings = []
    for limb, leg in legs.items():
        site = model.site(limb.label).id
        ankle = data.site_xpos[site] + data.site_xmat[site].reshape(3, 3) @ leg.ankle_in_sole
        hip = data.subtree_com[1] + base @ leg.hip_in_com
        slack, wanted = leg.max_length - float(np.linalg.norm(hip - ankle)), _SLACK * (leg.thigh + leg.shin)
        if slack < wanted:
            warnings.append(
                f"{limb.label}: the leg of the home posture is {1e3 * slack:.0f} mm short of straight (steps need "
                f"{1e3 * wanted:.0f} mm); bend the knee more in [home]"
            )
    return warnings


def _posed(model: mujoco.MjModel, home: np.ndarray) -> mujoco.MjData:
    """Places of everything and centres of mass in the home posture, qpos (7 + n,)."""
    data = mujoco.MjData(model)
    data.qpos[:] = home
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def _shapes(model: mujoco.MjModel, limb: Limb) -> list[int]:
    """Geoms that move with a limb's patch, whether they collide or not."""
    body = model.site_bodyid[model.site(limb.label).id]
    return np.flatnonzero(model.body_weldid[model.geom_bodyid] == model.body_weldid[body]).tolist()


def _gap(model: mujoco.MjModel, data: mujoco.MjData, limb: Limb) -> float:
    """Distance in m from the middle of a patch to its body's shapes but the pad, or to its frame or CoM without any."""
    site, pad = model.site(limb.label).id, mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{limb.label}_pad")
    position = data.site_xpos[site]
    body = model.site_bodyid[site]
    gaps = [min(float(np.linalg.norm(position - place[body])) for place in (data.xpos, data.xipos))]
    for geom in (geom for geom in _shapes(model, limb) if geom != pad):
        # Distance to the box around the shape, in the shape's own axes.
        local = data.geom_xmat[geom].reshape(3, 3).T @ (position - data.geom_xpos[geom]) - model.geom_aabb[geom, :3]
        gaps.append(float(np.linalg.norm(np.maximum(np.abs(local) - model.geom_aabb[geom, 3:], 0.0))))
    return min(gaps[1:], default=gaps[0])
