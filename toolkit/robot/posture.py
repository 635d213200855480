"""A posture to stand in for a model that nobody has described yet: knees bent, the CoM over the soles, arms hanging."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from scipy.optimize import least_squares, minimize_scalar

from toolkit.geometry.pose import Pose
from toolkit.robot.anatomy import Anatomy, FoundPatch, left_of

_KNEE = 0.7  # rad; flexion of the knees
_STRAIGHT = 0.3  # rad; a keyframe whose knees bend less has no room to step
# rad; more flexion of the knees, and a larger difference of the two, than a keyframe has that stands at ease
_DEEP, _UNEQUAL = 1.2, 0.15
_UPRIGHT = 0.95  # least cosine between the vertical and that of the base in such a keyframe
_SPREADS = (0.3, 0.5, 0.7, 0.9)  # rad; upper arms out to the sides, as far as the forearms need to be free
_FREE = 0.02  # share of the CoM's height that forearms stay away from the rest of the robot
_ELBOW = 0.5  # rad; forearms forward of the upper arms
_EASE = 0.05  # weight of a joint's angle beside the directions of the arm, so that no joint turns without need
_EDGE = 0.1  # share of a joint's range that a posture keeps away from its ends
_PITCH = 0.72  # least cosine between the axis of a pitch joint and the direction to the left
_LEAN = 0.6  # rad; most that the thighs turn to bring the CoM over the soles
_UPPER_ARM = 0.2  # share of the way from the shoulder to the hand; the elbow is the first joint beyond it
_ARM_JOINTS = 5  # most joints that bring an arm down; what comes after them turns the hand


def standing(model: mujoco.MjModel, anatomy: Anatomy, start: Mapping[str, float]) -> dict[str, float]:
    """Angles in rad of hips, knees and arms in which a robot stands at ease; ankles are left to `flat_soles`.

    Args:
        model: The compiled file.
        anatomy: What its tree suggests, with both feet.
        start: Angles of a keyframe, whose arms stay and whose legs only change where they are straight; empty without.
    """
    data = mujoco.MjData(model)
    for joint in np.flatnonzero(model.jnt_type != mujoco.mjtJoint.mjJNT_FREE).tolist():
        data.qpos[model.jnt_qposadr[joint]] = within(model, joint, start.get(model.joint(joint).name, 0.0))
    legs = [_Leg(model, foot, anatomy) for foot in anatomy.feet]
    mujoco.mj_kinematics(model, data)
    bends = not start or any(leg.flexion(data) < _STRAIGHT for leg in legs if len(leg.joints) == 3)
    bends = bends and all(len(leg.joints) == 3 for leg in legs)
    found = _bent(model, data, legs) if bends else {}
    if not start:
        arms = [[model.joint(name).id for name in names] for names in anatomy.arms]
        for arm, side in zip(arms, (1.0, -1.0), strict=False):
            found |= _hanging(model, data, arm, anatomy.forward, side)
    if bends:
        found |= _bent(model, data, legs)  # the arms have moved the CoM
    return {model.joint(joint).name: float(np.round(found[joint], 2)) + 0.0 for joint in sorted(found)}


def stands(model: mujoco.MjModel, anatomy: Anatomy, key: int) -> bool:
    """Whether a robot stands upright at ease in a keyframe, on both legs alike.

    Args:
        model: The compiled file.
        anatomy: What its tree suggests, with both feet.
        key: Number of the keyframe.
    """
    data, base = mujoco.MjData(model), model.body(anatomy.base).id
    mujoco.mj_kinematics(model, data)
    before = data.xmat[base].copy().reshape(3, 3)
    mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_kinematics(model, data)
    if (data.xmat[base].reshape(3, 3) @ before.T)[2, 2] < _UPRIGHT:
        return False
    legs = [_Leg(model, foot, anatomy) for foot in anatomy.feet]
    if any(len(leg.joints) != 3 for leg in legs):
        return True
    left, right = (leg.flexion(data) for leg in legs)
    return max(left, right) < _DEEP and abs(left - right) < _UNEQUAL


def within(model: mujoco.MjModel, joint: int, value: float) -> float:
    """A position, moved into the joint's range by a tenth of it where it is out."""
    low, high = model.jnt_range[joint]
    if not model.jnt_limited[joint] or low <= value <= high:
        return value
    edge = _EDGE * (high - low)
    return float(np.round(low + edge if value < low else high - edge, 4))


def _bounds(model: mujoco.MjModel, joints: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Ends (n,) of ranges in rad, without what is near to them; half a turn where there is no range."""
    limited = model.jnt_limited[joints].astype(bool)
    low, high = np.where(limited, model.jnt_range[joints].T, [[-np.pi], [np.pi]])
    edge = 0.5 * _EDGE * (high - low)
    return low + edge, high - edge


def _hanging(
    model: mujoco.MjModel, data: mujoco.MjData, arm: list[int], forward: np.ndarray, side: float
) -> dict[int, float]:
    """Angles by joint in which an arm hangs beside the trunk with its elbow a little bent; `data` gets them too."""
    mujoco.mj_kinematics(model, data)
    hand = int(model.jnt_bodyid[arm[-1]])
    shoulder = data.xanchor[arm[min(1, len(arm) - 1)]].copy()
    whole = float(np.linalg.norm(data.xipos[hand] - shoulder))
    beyond = [j for j in arm[2:] if np.linalg.norm(data.xanchor[j] - shoulder) > _UPPER_ARM * whole]
    elbow = beyond[0] if beyond else None
    moved = arm[:_ARM_JOINTS]
    address = model.jnt_qposadr[moved]
    low, high = _bounds(model, moved)
    start = np.clip(data.qpos[address], low + 1e-6, high - 1e-6)
    ahead, out = np.append(forward, 0.0), side * left_of(forward)

    def off(angles: np.ndarray, upper: np.ndarray) -> np.ndarray:
        data.qpos[address] = angles
        mujoco.mj_kinematics(model, data)
        middle = data.xipos[hand] if elbow is None else data.xanchor[elbow]
        parts = [_unit(middle - shoulder) - upper, _EASE * (angles - start)]
        if elbow is not None:
            lower = np.cos(_ELBOW) * upper + np.sin(_ELBOW) * ahead
            parts.append(_unit(data.xipos[hand] - middle) - lower)
        return np.concatenate(parts)

    forearm = set(model.jnt_bodyid[beyond].tolist())
    # An arm that points up or to the side may rest on a saddle, so there are more places to begin at.
    begins = [np.clip(start + turn, low + 1e-6, high - 1e-6) for turn in (0.0, 0.5, -0.5)]
    for spread in _SPREADS:
        upper = np.sin(spread) * out - np.cos(spread) * np.array([0.0, 0.0, 1.0])
        tries = [least_squares(off, begin, bounds=(low, high), args=(upper,)) for begin in begins]
        data.qpos[address] = min(tries, key=lambda found: found.cost).x
        if not _touches(model, data, forearm):
            break
    return dict(zip(moved, data.qpos[address].tolist(), strict=True))


def _touches(model: mujoco.MjModel, data: mujoco.MjData, bodies: set[int]) -> bool:
    """Whether a collision shape of some bodies comes near to one of the others, but for the next ones in the chain."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    free = _FREE * float(data.subtree_com[0, 2] - data.xpos[1:, 2].min())
    shapes = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    own = [geom for geom in shapes if int(model.geom_bodyid[geom]) in bodies]
    near = {int(model.body_parentid[body]) for body in bodies} | bodies
    near |= {int(model.body_parentid[body]) for body in near} | {0}
    others = [geom for geom in shapes if int(model.geom_bodyid[geom]) not in near]
    return any(mujoco.mj_geomDistance(model, data, a, b, free, None) < free for a in own for b in others)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)


class _Leg:
    """The pitch joints of a leg: hip, knee and ankle, with the signs of their axes along the left."""

    def __init__(self, model: mujoco.MjModel, foot: FoundPatch, anatomy: Anatomy) -> None:
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self.left = left_of(anatomy.forward)
        self.ahead = np.append(anatomy.forward, 0.0)
        own = [model.joint(name).id for name in foot.joints if name not in anatomy.shared]
        self.joints = [j for j in own if abs(float(self.left @ data.xaxis[j])) > _PITCH]
        self.signs = [float(np.sign(self.left @ data.xaxis[j])) for j in self.joints]
        self._model, self._body, self._sole = model, model.body(foot.body).id, foot.pose

    def flexion(self, data: mujoco.MjData) -> float:
        """Angle in rad between thigh and shin, positive where the shin goes back."""
        hip, knee, ankle = data.xanchor[self.joints]
        thigh, shin = knee - hip, ankle - knee
        return float(np.arctan2(self.left @ np.cross(thigh, shin), thigh @ shin))

    def turn(self, data: mujoco.MjData, which: int, angle: float) -> None:
        """Turn a joint about the left by an angle in rad, as far as its range goes."""
        joint = self.joints[which]
        low, high = (float(end[0]) for end in _bounds(self._model, [joint]))
        address = self._model.jnt_qposadr[joint]
        data.qpos[address] = np.clip(data.qpos[address] + self.signs[which] * angle, low, high)

    def sole(self, data: mujoco.MjData) -> Pose:
        """The sole in the world."""
        return Pose(data.xmat[self._body].reshape(3, 3), data.xpos[self._body]) @ self._sole


def _bent(model: mujoco.MjModel, data: mujoco.MjData, legs: list[_Leg]) -> dict[int, float]:
    """Angles of hips and knees by joint with bent knees and the CoM over the middle of the level soles."""
    for leg in legs:
        leg.turn(data, 1, _KNEE - leg.flexion(data))
    begin = data.qpos.copy()

    def off(lean: float) -> float:
        data.qpos[:] = begin
        for leg in legs:
            leg.turn(data, 0, -lean)
        mujoco.mj_kinematics(model, data)
        for leg in legs:
            up = leg.sole(data).normal
            leg.turn(data, 2, -float(np.arctan2(leg.ahead @ up, up[2])))
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        middle = np.mean([leg.sole(data).position for leg in legs], axis=0)
        return float(legs[0].ahead @ (data.subtree_com[0] - middle))

    lean = minimize_scalar(lambda value: off(value) ** 2, bounds=(_KNEE / 2 - _LEAN, _KNEE / 2 + _LEAN)).x
    off(float(lean))
    joints = [joint for leg in legs for joint in leg.joints[:2]]
    return {joint: float(data.qpos[model.jnt_qposadr[joint]]) for joint in joints}
