"""What the tree and the shapes of a model nobody has described say, on the console."""

from __future__ import annotations

import mujoco
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.tree import Tree

from toolkit.geometry.limb import FEET, PALMS
from toolkit.robot.draft import Draft
from toolkit.robot.motors import file_torques
from toolkit.robot.source import ModelSource


def print_inspection(console: Console, draft: Draft, source: ModelSource) -> None:
    """Print the tree of bodies and joints, the limbs that were found, and the keyframes."""
    model, anatomy = draft.model, draft.anatomy
    console.print(_tree(model, source))
    limbs = Table("limb", "body", "joints", "patch, m", "position in the body, m")
    for found, labels in ((anatomy.feet, FEET), (anatomy.palms, PALMS)):
        for patch, limb in zip(found, labels, strict=False):
            size = " x ".join(f"{side:.3f}" for side in patch.size)
            place = ", ".join(f"{value:.4f}" for value in patch.pose.position + 0.0)
            limbs.add_row(limb.label, escape(patch.body), str(len(patch.joints)), size, place)
    console.print(limbs)
    keys = ", ".join(model.key(k).name or f"number {k}" for k in range(model.nkey))
    mass = float(model.body_subtreemass[model.body(anatomy.base).id])
    facts = f"base {anatomy.base}, {mass:.1f} kg, toes along ({anatomy.forward[0]:.2f}, {anatomy.forward[1]:.2f})"
    console.print(f"{facts}; keyframes: {keys or 'none'}", markup=False)


def _tree(model: mujoco.MjModel, source: ModelSource) -> Tree:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    torques, top = file_torques(model), Tree(escape(source.path.name))
    branches = {0: top}
    for body in range(1, model.nbody):
        shapes = np.flatnonzero(model.geom_bodyid == body)
        colliding = int(((model.geom_contype[shapes] | model.geom_conaffinity[shapes]) != 0).sum())
        text = f"{escape(model.body(body).name)}  {model.body_mass[body]:.2f} kg"
        text += f", {colliding} of {len(shapes)} shapes collide" if len(shapes) else ""
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])):
            text += f"\n[bold]{escape(_joint(model, data, source, torques, joint))}[/bold]"
        branches[body] = branches[int(model.body_parentid[body])].add(text)
    return top


def _joint(
    model: mujoco.MjModel, data: mujoco.MjData, source: ModelSource, torques: dict[str, float], joint: int
) -> str:
    name, dof = model.joint(joint).name, model.jnt_dofadr[joint]
    if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
        return f"{name or 'free joint'}: floats"
    axis = data.xaxis[joint]
    along = int(np.abs(axis).argmax())
    sign = "" if axis[along] > 0 else "-"
    shown = f"{sign}{'xyz'[along]}" if abs(axis[along]) > 0.999 else ", ".join(f"{value:.2f}" for value in axis + 0.0)
    low, high = model.jnt_range[joint]
    limits = f"{low:.3f}…{high:.3f} rad" if model.jnt_limited[joint] else "no range"
    torque = f"{torques[name]:g} N m" if torques.get(name) else "no torque limit"
    speed = f"{source.velocity[name]:g} rad/s" if name in source.velocity else "no speed limit"
    return f"{name}: about {shown}, {limits}, {torque}, {speed}, armature {model.dof_armature[dof]:g}"
