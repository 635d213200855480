"""The joints that lead to a limb from the base or from the trunk, and those of arms without palms."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from toolkit.geometry.limb import FEET, Limb

_ASIDE = 0.02  # m; a shoulder is at least this far from the middle of the body, and a neck or a waist is not
_LEAST_ARM = 3  # joints; what has fewer is an eye or an ear


def joints_to(model: mujoco.MjModel, body: int) -> list[int]:
    """Indices of the hinge and slide joints of a model from the base to a body, in order."""
    bodies = set(bodies_above(model, body))  # joints are numbered from the base down
    free = mujoco.mjtJoint.mjJNT_FREE
    return [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in bodies and model.jnt_type[j] != free]


def arm_joints(model: mujoco.MjModel, limb: Limb) -> list[int]:
    """Indices of the joints of a model from the trunk to a palm, in order.

    The trunk is the first body above the palm that carries another limb. If the chain already has the four joints of an
    arm, it is the first body that carries other joints (a head, or an arm without palm).
    """
    trunk = {0}
    for other in (item for item in Limb if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, item.label) >= 0):
        if other != limb:
            trunk.update(bodies_above(model, model.site_bodyid[model.site(other.label).id]))
    # Bodies with a joint at or below them.
    carrying = {above for body in model.jnt_bodyid for above in bodies_above(model, body)}
    joints: list[int] = []
    body = int(model.site_bodyid[model.site(limb.label).id])
    while body not in trunk:
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        joints = [*range(first, first + count), *joints]
        parent = int(model.body_parentid[body])
        siblings = [b for b in range(1, model.nbody) if model.body_parentid[b] == parent and b != body]
        if len(joints) >= 4 and carrying.intersection(siblings):
            break
        body = parent
    return joints


def side_joints(model: mujoco.MjModel, home: np.ndarray) -> tuple[list[int], list[int]]:
    """Indices of the joints of the left and of the right arm of a robot alone, whether they have palms or not.

    An arm is the largest part of the tree without a foot whose first joint lies beside the middle of the body in the
    home posture qpos (7 + n,), and which has three joints or more. A side without one has no joints.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = home
    mujoco.mj_kinematics(model, data)
    turn, origin = data.xmat[1].reshape(3, 3), data.xpos[1]
    feet = {above for foot in FEET for above in bodies_above(model, model.site_bodyid[model.site(foot.label).id])}
    sides: tuple[list[int], list[int]] = [], []
    for joint in range(1, model.njnt):
        body, aside = int(model.jnt_bodyid[joint]), float(turn[:, 1] @ (data.xanchor[joint] - origin))
        side = sides[0] if aside > 0.0 else sides[1]
        if body in feet or abs(aside) < _ASIDE or joint in sides[0] or joint in sides[1]:
            continue
        below = [j for j in range(joint, model.njnt) if body in bodies_above(model, model.jnt_bodyid[j])]
        if len(below) >= max(_LEAST_ARM, len(side) + 1):
            side[:] = below
    return sides


def bodies_above(model: mujoco.MjModel, body: int) -> Iterator[int]:
    """A body and the bodies above it, without the world."""
    while body:
        yield int(body)
        body = model.body_parentid[body]
