"""Which joints lead to a limb: from the base, and from the trunk."""

from __future__ import annotations

import mujoco

from toolkit.geometry.limb import Limb


def joints_to(model: mujoco.MjModel, body: int) -> list[int]:
    """Indices of the hinge and slide joints of a model from the base to a body, in order."""
    joints: list[int] = []
    while body > 0:
        first = model.body_jntadr[body]
        own = [int(first + k) for k in range(model.body_jntnum[body])]
        joints = [joint for joint in own if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE] + joints
        body = int(model.body_parentid[body])
    return joints


def arm_joints(model: mujoco.MjModel, limb: Limb) -> list[int]:
    """Indices of the joints of a model from the trunk to a palm, in order.

    The trunk is the first body above the palm that carries another limb, or that carries other joints (a head, an arm
    without palm) once the chain has the four joints of an arm.
    """
    trunk = {0}
    for other in (item for item in Limb if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, item.label) >= 0):
        body = model.site_bodyid[model.site(other.label).id]
        while other != limb and body:
            trunk.add(int(body))
            body = model.body_parentid[body]
    moving = {int(body) for body in model.jnt_bodyid}
    joints: list[int] = []
    body = int(model.site_bodyid[model.site(limb.label).id])
    while body not in trunk:
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        joints = [*range(first, first + count), *joints]
        parent = int(model.body_parentid[body])
        siblings = [b for b in range(1, model.nbody) if model.body_parentid[b] == parent and b != body]
        if len(joints) >= 4 and any(_carries(model, sibling, moving) for sibling in siblings):
            break
        body = parent
    return joints


def _carries(model: mujoco.MjModel, body: int, moving: set[int]) -> bool:
    """Whether a body or one below it has a joint."""
    children = [b for b in range(body + 1, model.nbody) if model.body_parentid[b] == body]
    return body in moving or any(_carries(model, child, moving) for child in children)
