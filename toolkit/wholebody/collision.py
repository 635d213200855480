"""Collisions of a whole-body motion with the world and with itself, by MuJoCo on the composed scene."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.contacts.failure import Failure
from toolkit.robot.model import RobotModel

# Rates and lengths are those of a body of the usual size (`toolkit.robot.scale`).
RATE = 25.0  # Hz; at most this many postures per second are checked: at 1 m/s a limb moves 4 cm between two
PATCH_DEPTH = 4e-3  # m; allowed depth of a limb's last link in the world, as it makes the planned contacts
BODY_DEPTH = 1e-3  # m; allowed depth of any other link in the world
SELF_DEPTH = 2e-3  # m; allowed depth of links of the robot in each other


def first_collision(robot: RobotModel, scene: mujoco.MjModel, times: np.ndarray, qpos: np.ndarray) -> Failure | None:
    """The first collision of a motion (T, 7 + n) at uniform times (T,) in s, None if there is none.

    `scene` is the robot and the world in one model. Pairs of links that touch in the home posture are left out.
    """
    model, data = scene, mujoco.MjData(scene)
    link_of = model.body_weldid[model.geom_bodyid]
    static = link_of == 0
    patch = np.isin(link_of, [model.body(limb.body).weldid for limb in robot.limbs.values()])
    resting = _touching_at_home(model, data, static, robot.home)
    length, rate = robot.scale.length, RATE / robot.scale.time
    stride = max(int(np.floor(1.0 / (rate * (times[1] - times[0])) + 1e-9)), 1)
    for index in [*range(0, len(times) - 1, stride), len(times) - 1]:
        data.qpos[:] = qpos[index]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        if not data.ncon:
            continue
        for (first, second), depth in zip(data.contact.geom, -data.contact.dist, strict=True):
            if static[first] or static[second]:
                link = second if static[first] else first
                allowed = length * (PATCH_DEPTH if patch[link] else BODY_DEPTH)
            else:
                allowed = np.inf if body_pair(model, first, second) in resting else length * SELF_DEPTH
            if depth > allowed:
                return Failure(
                    f"{_label(model, first)} and {_label(model, second)} collide at {times[index]:.2f} s, "
                    f"{depth * 1e3:.1f} mm deep (allowed {allowed * 1e3:.1f} mm)",
                    float(times[index]),
                    at_any_pace=bool(static[first] or static[second]),
                )
    return None


def _touching_at_home(
    model: mujoco.MjModel, data: mujoco.MjData, static: np.ndarray, home: np.ndarray
) -> set[tuple[int, int]]:
    """Pairs of the robot's bodies that touch in the home posture."""
    data.qpos[:] = home
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    return {body_pair(model, a, b) for a, b in data.contact.geom if not static[a] and not static[b]}


def body_pair(model: mujoco.MjModel, first: int, second: int) -> tuple[int, int]:
    """Indices of the bodies of two geoms, in ascending order."""
    low, high = sorted((int(model.geom_bodyid[first]), int(model.geom_bodyid[second])))
    return low, high


def _label(model: mujoco.MjModel, geom: int) -> str:
    """Name of a geom; where it has none, it is named after its body."""
    name = model.geom(geom).name
    return name or f"a geom of {model.body(model.geom_bodyid[geom]).name or 'the world'}"
