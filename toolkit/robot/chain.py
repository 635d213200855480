"""The joints that lead to a limb from the base, or from the trunk."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco

from toolkit.geometry.limb import Limb


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


def bodies_above(model: mujoco.MjModel, body: int) -> Iterator[int]:
    """A body and the bodies above it, without the world."""
    while body:
        yield int(body)
        body = model.body_parentid[body]
