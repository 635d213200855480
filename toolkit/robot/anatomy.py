"""Find legs, soles, arms and palms in the tree of a compiled model that nobody has described yet."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from toolkit.geometry.pose import Pose, rotation_to_z
from toolkit.robot.chain import bodies_above, joints_to
from toolkit.robot.mend import box_corners, geom_points

FLAT = 0.001  # m; points so near to the lowest one belong to the sole
_AROUND = 48  # points around round shapes
_LEAST_PATCH = 0.02  # m; least side of a patch that is proposed
_HAND_DEPTH = 0.01  # m; points so near to the end of a hand belong to its palm
_LEG_JOINTS = 5  # least joints of a leg
_PALM_JOINTS = 4  # least joints of an arm whose palm is proposed
_LEAST_ARM = 3  # least joints of an arm; what has fewer is an eye or an ear
_ARM_JOINTS = 7  # most joints of an arm; what comes after them is a finger
# A toe turns about the left, at less than so much of the height of the joint before it, farther ahead than a share of
# the leg's height, on a foot that reaches down as far but for another share.
_TOE_TURNS, _TOE_HEIGHT, _TOE_AHEAD, _TOE_LOW = 0.7, 0.75, 0.05, 0.03
_STEEPEST = 0.7  # least cosine between the normal of a sole and straight down in the zero posture


@dataclass(frozen=True)
class FoundPatch:
    """A contact patch that a shape suggests.

    Attributes:
        body: Name of the body.
        pose: The contact frame in that body.
        size: Full size (2,) m along x and y.
        pad: Whether the patch needs a box of its own: the shape is round there, or does not collide.
        joints: Joints from the base to the body, in order.
        shaped: Whether there are shapes.
        weighed: Whether a hand has none, and its inertia says where it ends.
    """

    body: str
    pose: Pose
    size: np.ndarray
    pad: bool
    joints: tuple[str, ...]
    shaped: bool
    weighed: bool = False

    @property
    def seen(self) -> bool:
        """Whether there is anything to go by; without, the patch is a small one at the body's frame."""
        return self.shaped or self.weighed


@dataclass(frozen=True)
class Anatomy:
    """What a model's tree and shapes suggest.

    Attributes:
        base: Name of the root body of the robot.
        others: Names of further root bodies.
        up: Direction (3,) that points up in the axes of the base.
        forward: Level direction (2,) of the toes in the world of the zero posture.
        toes: The same in the axes of the base, after they are turned upright.
        feet: Soles, left one first; empty where no two legs were found.
        palms: Palms, left one first; empty where no two arms of four joints or more were found.
        arms: Joints of the arms in order, left arm first; empty where no two arms of three joints or more were found.
        backward: The knee whose range lets it bend the other way than that of the other leg, against the toes, if any.
        shared: Joints that both legs hang on, such as a waist below a floating trunk.
        beyond: Joints beyond hands and feet: fingers and toes.
    """

    base: str
    others: tuple[str, ...]
    up: np.ndarray
    forward: np.ndarray
    toes: np.ndarray
    feet: tuple[FoundPatch, ...]
    palms: tuple[FoundPatch, ...]
    arms: tuple[tuple[str, ...], ...]
    backward: tuple[str, ...]
    shared: tuple[str, ...]
    beyond: tuple[str, ...]


def find_anatomy(model: mujoco.MjModel) -> Anatomy:
    """Legs and arms of a model, whose base is above its feet in the zero posture."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    roots = [b for b in range(1, model.nbody) if model.body_parentid[b] == 0]
    base = max(roots, key=lambda b: float(model.body_subtreemass[b]))
    axes = data.xmat[base].reshape(3, 3)
    tips = _tips(model, base)
    ends = _feet(model, data, tips)
    if len(ends) != 2:
        others = tuple(model.body(b).name for b in roots if b != base)
        ahead = np.array([1.0, 0.0])
        return Anatomy(model.body(base).name, others, axes[2], ahead, ahead, (), (), (), (), (), ())
    first, second = (joints_to(model, end) for end in ends)
    shared = [j for j in first if j in second]
    end_of = {_foot_of(model, data, end, [j for j in joints_to(model, end) if j not in shared]): end for end in ends}
    feet, toes = list(end_of), [end for foot, end in end_of.items() if end != foot]
    tips = [tip for tip in tips if tip not in toes]
    own = [[j for j in joints_to(model, foot) if j not in shared] for foot in feet]
    bends = [_forward(model, data, base, leg) for leg in own]
    ahead = _ahead(model, data, feet)
    agree = bends[0] @ bends[1] > 0.0
    forward = bends[0] if agree or bends[0] @ ahead > 0.0 else bends[1]
    wrong = [] if agree else [leg[3] for leg, bend in zip(own, bends, strict=True) if bend @ forward < 0.0]
    across = left_of(forward)
    feet = sorted(feet, key=lambda b: -float(across @ data.xpos[b]))
    legs = {j for foot in feet for j in joints_to(model, foot)}
    arms = _arms(model, data, tips, legs, across, base)
    hands = [
        int(model.jnt_bodyid[joints[-1]]) for joints, _ in arms if min(len(arm) for arm, _ in arms) >= _PALM_JOINTS
    ]
    fingers = sorted({j for _, beyond in arms for j in beyond})
    return Anatomy(
        base=model.body(base).name,
        others=tuple(model.body(b).name for b in roots if b != base),
        up=axes[2],
        forward=forward,
        toes=(rotation_to_z(axes[2]) @ axes.T @ np.append(forward, 0.0))[:2],
        feet=tuple(_sole(model, data, foot, end_of[foot], forward) for foot in feet),
        palms=tuple(_palm(model, data, hand, legs, forward) for hand in hands),
        arms=tuple(_names(model, joints) for joints, _ in arms),
        backward=_names(model, wrong),
        shared=_names(model, shared),
        beyond=_names(model, [*(joints_to(model, toe)[-1] for toe in toes), *fingers]),
    )


def _names(model: mujoco.MjModel, joints: list[int]) -> tuple[str, ...]:
    return tuple(model.joint(j).name for j in joints)


def _tips(model: mujoco.MjModel, base: int) -> list[int]:
    """Bodies with a joint of their own and none below them, under a base."""
    single = model.jnt_type != mujoco.mjtJoint.mjJNT_FREE
    moved = {int(body) for body in model.jnt_bodyid[single]}
    inner = {above for body in moved for above in list(bodies_above(model, body))[1:]}
    return [b for b in sorted(moved - inner) if base in bodies_above(model, b)]


def _drawn(model: mujoco.MjModel, body: int) -> np.ndarray:
    """All shapes of a body and of what is fixed to it."""
    return np.flatnonzero(model.body_weldid[model.geom_bodyid] == model.body_weldid[body])


def _rigid(model: mujoco.MjModel, body: int) -> tuple[np.ndarray, bool]:
    """The colliding shapes of a body and of what is fixed to it, or all where none does, and whether they collide."""
    shapes = _drawn(model, body)
    colliding = shapes[(model.geom_contype[shapes] | model.geom_conaffinity[shapes]) != 0]
    return (colliding, True) if len(colliding) else (shapes, False)


def _points(model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray) -> np.ndarray:
    """Points (n, 3) m in the world on shapes; round ones as points around them."""
    clouds = [np.empty((0, 3))]
    for geom in geoms.tolist():
        kind, size = model.geom_type[geom], model.geom_size[geom]
        rotation = data.geom_xmat[geom].reshape(3, 3)
        if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            local = size[0] * _sphere(rotation)
        elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            local = np.concatenate([size[0] * _sphere(rotation) + [0, 0, end * size[1]] for end in (-1, 1)])
        elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            ring = size[0] * _ring(rotation)
            local = np.concatenate([ring + [0, 0, end * size[1]] for end in (-1, 1)])
        else:
            pose = Pose.from_quaternion(model.geom_pos[geom], model.geom_quat[geom])
            local = pose.inverse() @ geom_points(model, geom)
        clouds.append(local @ rotation.T + data.geom_xpos[geom])
    return np.concatenate(clouds)


def _sphere(rotation: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 3) all around, in a shape's axes; straight down in the world is exactly one of them."""
    angles = np.linspace(0, np.pi, _AROUND // 2 + 1)
    rings = [np.column_stack([_circle() * np.sin(a), np.full(_AROUND, -np.cos(a))]) for a in angles]
    return np.concatenate(rings) @ rotation


def _ring(rotation: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 3) around a shape's z axis; the lowest in the world is exactly one of them."""
    down = rotation.T @ [0.0, 0.0, -1.0]
    start = np.arctan2(down[1], down[0])
    c, s = np.cos(start), np.sin(start)
    return np.column_stack([_circle() @ np.array([[c, s], [-s, c]]), np.zeros(_AROUND)])


def _circle() -> np.ndarray:
    angles = 2 * np.pi * np.arange(_AROUND) / _AROUND
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _lowest(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> float:
    points = _points(model, data, _rigid(model, body)[0])
    return float(min(points[:, 2].min(initial=np.inf), data.xpos[body, 2]))


def _feet(model: mujoco.MjModel, data: mujoco.MjData, tips: list[int]) -> list[int]:
    """The two lowest ends of chains with at least five joints, if they stand equally high."""
    long = [tip for tip in tips if len(joints_to(model, tip)) >= _LEG_JOINTS]
    lowest = sorted(long, key=lambda tip: _lowest(model, data, tip))[:2]
    height = float(np.ptp(data.xpos[1:, 2])) if model.nbody > 1 else 0.0
    if len(lowest) < 2 or abs(_lowest(model, data, lowest[0]) - _lowest(model, data, lowest[1])) > 0.1 * height:
        return []
    return lowest


def _forward(model: mujoco.MjModel, data: mujoco.MjData, base: int, leg: list[int]) -> np.ndarray:
    """Level direction (2,) of the toes: a knee bends about the axis to the left, and the shin goes back."""
    bend = np.sum(model.jnt_range[leg[3]]) if len(leg) > 3 else 0.0
    left = np.sign(bend) * data.xaxis[leg[3]] if bend else data.xmat[base].reshape(3, 3)[:, 1]
    ahead = np.array([left[1], -left[0]])
    if np.linalg.norm(ahead) < 0.5:
        ahead = data.xmat[base].reshape(3, 3)[:2, 0]
    return ahead / np.linalg.norm(ahead)


def _ahead(model: mujoco.MjModel, data: mujoco.MjData, feet: list[int]) -> np.ndarray:
    """Level direction (2,) from the ankles to the middles of the feet, which reach farther ahead than back."""
    points = [_points(model, data, _rigid(model, foot)[0]) for foot in feet]
    ahead = [(p.min(0) + p.max(0)) / 2 - data.xpos[foot] for p, foot in zip(points, feet, strict=True) if len(p)]
    return np.sum(ahead, axis=0)[:2] if ahead else np.zeros(2)


def _foot_of(model: mujoco.MjModel, data: mujoco.MjData, end: int, leg: list[int]) -> int:
    """The foot of a leg, given its joints: what carries its end where that is a toe, to be held still; else the end."""
    foot = int(model.body_parentid[end])
    if len(leg) <= _LEG_JOINTS or model.body_jntnum[end] != 1 or int(model.jnt_bodyid[leg[-2]]) != foot:
        return end
    lows = [_lowest(model, data, body) for body in (foot, end)]
    ground, (hip, ankle, toe) = min(lows), data.xanchor[[leg[0], *leg[-2:]]]
    tall = float(hip[2]) - ground
    is_toe = (
        abs(float(left_of(_forward(model, data, end, leg)) @ data.xaxis[leg[-1]])) > _TOE_TURNS
        and toe[2] - ground < _TOE_HEIGHT * (ankle[2] - ground)
        and float(np.hypot(*(toe - ankle)[:2])) > _TOE_AHEAD * tall
        and float(np.ptp(lows)) < _TOE_LOW * tall
    )
    return foot if is_toe else end


def left_of(forward: np.ndarray) -> np.ndarray:
    """(3,) the level direction to the left of another (2,)."""
    return np.array([-forward[1], forward[0], 0.0])


def _sole(model: mujoco.MjModel, data: mujoco.MjData, foot: int, tip: int, forward: np.ndarray) -> FoundPatch:
    """The sole of a foot, with the toe at its tip where it has one."""
    parts = [_rigid(model, body) for body in dict.fromkeys((foot, tip))]
    shapes, colliding = np.concatenate([part for part, _ in parts]), all(collides for _, collides in parts)
    points = _points(model, data, shapes)
    if len(points) < 4:
        points = data.xpos[foot] + 0.5 * _LEAST_PATCH * np.array([[x, y, 0.0] for x in (-1, 1) for y in (-1, 1)])
    down = max(_downs(points), key=lambda direction: _area(points, direction, forward))
    sole = points[points @ down > (points @ down).max() - FLAT]
    ahead = np.append(forward, 0.0)
    ahead = ahead - down * (down @ ahead)
    ahead /= np.linalg.norm(ahead)
    axes = np.column_stack([ahead, np.cross(-down, ahead), -down])
    low, high = (sole @ axes).min(0), (sole @ axes).max(0)
    centre = axes @ np.append((low[:2] + high[:2]) / 2, (points @ axes)[:, 2].min())
    end = float((points @ down).max()) - FLAT
    touching = [g for g in shapes if (_points(model, data, shapes[shapes == g]) @ down).max(initial=-np.inf) > end]
    boxes = all(model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX for geom in touching)
    return _patch(model, data, foot, Pose(axes, centre), (high - low)[:2], not (boxes and colliding))


def _downs(points: np.ndarray) -> list[np.ndarray]:
    """Directions that may be those of a sole: straight down, and across the largest facet that faces down."""
    downs = [np.array([0.0, 0.0, -1.0])]
    try:
        hull = ConvexHull(points)
    except QhullError:
        return downs
    normals = hull.equations[:, :3]
    corners = points[hull.simplices]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    facing = normals[:, 2] < -_STEEPEST
    if facing.any():
        same = normals @ normals[facing].T > 0.9998
        downs.append(normals[facing][(areas[:, None] * same).sum(0).argmax()])
    return downs


def _area(points: np.ndarray, down: np.ndarray, forward: np.ndarray) -> float:
    """Area in m^2 of the rectangle around the points that are lowest in a direction."""
    sole = points[points @ down > (points @ down).max() - FLAT]
    along = sole @ np.column_stack([np.append(forward, 0.0), left_of(forward)])
    return float(np.prod(np.ptp(along, axis=0)))


def _arms(
    model: mujoco.MjModel, data: mujoco.MjData, tips: list[int], legs: set[int], across: np.ndarray, base: int
) -> list[tuple[list[int], list[int]]]:
    """The joints of the left and the right arm, each with the joints beyond its hand; none where there are not both."""
    others = [tip for tip in tips if not legs & set(joints_to(model, tip)[-1:])]
    side = {tip: float(across @ (data.xpos[tip] - data.xpos[base])) for tip in others}
    found = []
    for sign in (1.0, -1.0):
        ends = [tip for tip in others if sign * side[tip] > 0.02]
        if not ends:
            return []
        end = max(ends, key=lambda tip: len(joints_to(model, tip)))
        chain = [b for b in bodies_above(model, end) if not _carries(model, b, set(others) - set(ends), legs)]
        arm = [tip for tip in ends if chain and chain[-1] in bodies_above(model, tip)]
        common = set.intersection(*(set(bodies_above(model, tip)) for tip in arm)) if arm else set()
        moved = [b for b in chain if b in common and model.body_jntnum[b]]
        if not moved:
            return []
        joints = [j for j in joints_to(model, max(moved)) if int(model.jnt_bodyid[j]) in chain][:_ARM_JOINTS]
        if len(joints) < _LEAST_ARM:
            return []
        found.append((joints, [j for tip in arm for j in joints_to(model, tip) if j > max(joints)]))
    return found


def _carries(model: mujoco.MjModel, body: int, tips: set[int], legs: set[int]) -> bool:
    """Whether a body is above some of the tips, or above a leg."""
    if any(body in bodies_above(model, tip) for tip in tips):
        return True
    return any(body in bodies_above(model, int(model.jnt_bodyid[j])) for j in legs)


def _palm(model: mujoco.MjModel, data: mujoco.MjData, hand: int, legs: set[int], forward: np.ndarray) -> FoundPatch:
    joints = [j for j in joints_to(model, hand) if j not in legs]
    elbow = data.xanchor[joints[-4] if len(joints) >= 7 else joints[-2]]
    points = _points(model, data, _drawn(model, hand))
    weighed = False
    if not len(points):
        points, box = data.xpos[hand][None], _inertia_box(model, data, hand)
        if weighed := 0.0 < float(np.ptp(box, axis=0).max()) < float(np.linalg.norm(data.xipos[hand] - elbow)):
            points = box  # no hand is larger than its forearm; some files have inertias of anything
    middle = (points.min(0) + points.max(0)) / 2
    out = middle - elbow
    out = out / max(float(np.linalg.norm(out)), 1e-9)
    palm = points[points @ out > (points @ out).max() - _HAND_DEPTH]
    ahead = np.append(forward, 0.0)
    ahead = ahead - out * (out @ ahead)
    if np.linalg.norm(ahead) < 0.3:
        ahead = np.array([0.0, 0.0, 1.0]) - out * out[2]
    ahead /= np.linalg.norm(ahead)
    axes = np.column_stack([ahead, np.cross(-out, ahead), -out])
    low, high = (palm @ axes).min(0), (palm @ axes).max(0)
    centre = middle + out * float((points @ out).max() - middle @ out)
    return _patch(model, data, hand, Pose(axes, centre), (high - low)[:2], True, weighed)


def _inertia_box(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> np.ndarray:
    """Corners (8, 3) m in the world of the box that has a body's mass and inertia."""
    inertia, mass = model.body_inertia[body], max(float(model.body_mass[body]), 1e-9)
    half = np.sqrt(np.maximum(1.5 * (inertia.sum() - 2 * inertia) / mass, 0.0))
    return box_corners(half) @ data.ximat[body].reshape(3, 3).T + data.xipos[body]


def _patch(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    body: int,
    pose: Pose,
    size: np.ndarray,
    pad: bool,
    weighed: bool = False,
) -> FoundPatch:
    world_from_body = Pose(data.xmat[body].reshape(3, 3), data.xpos[body])
    return FoundPatch(
        body=model.body(body).name,
        pose=world_from_body.inverse() @ pose,
        size=np.maximum(size, _LEAST_PATCH),
        pad=pad,
        joints=_names(model, joints_to(model, body)),
        shaped=bool(len(_drawn(model, body))),
        weighed=weighed,
    )
