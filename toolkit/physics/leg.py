"""A leg of two links in closed form: joint angles, points and torques from the CoM, the base's heading and the sole.

The base stands upright at the heading psi and its CoM c where the home posture has it; the hip is a ball joint of yaw,
roll and pitch in any order, the ankle one of pitch and roll (the usual humanoid leg). With

    h = R_sole^T (c + Rz(psi) hip_in_com - p) - ankle_in_sole        hip seen from the ankle, in the sole frame

all six joint angles follow: the ankle rolls until h lies in the plane of the leg, the cosine rule gives the knee and
the shin, and the thigh's frame seen from the base gives the hip. Where a leg has no ankle roll, that angle is the one
by which its foot rolls on the ground.

The order of a hip's joints (`toolkit.robot.model.HipJoints`) decides what its motors bear: a yaw joint below the others
lies along the thigh, and on a bent leg it carries part of the weight, which one at the top never does.

The laws serve numbers in compiled code, arrays and CasADi's symbols. A vector is anything with components v[0], v[1]
and v[2], and a rotation has components r[i, j]. Each component is a number, an array (n,) or a symbol.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np

from toolkit.compiled import compiled, law
from toolkit.physics.momentum import cross
from toolkit.robot.model import HipJoints, LegGeometry

STRAIGHT = 0.9999  # largest |cosine| or |sine| whose angle is taken, so that derivatives stay finite


@dataclass(frozen=True)
class ReachMargins:
    """How far inside its limits a leg must stay.

    Attributes:
        length: m; taken off both ends of the hip-ankle distance.
        ankle: rad; taken off both ends of ankle pitch and roll.
        hip: rad; taken off both ends of hip yaw, roll and pitch; negative where the base may turn or lean to help.
    """

    length: float = 0.0
    ankle: float = 0.1
    hip: float = 0.0

    def scaled(self, factor: float) -> Self:
        """The same with its lengths multiplied by a factor."""
        return replace(self, length=factor * self.length)


class LegLimit(NamedTuple):
    """A limit of legs.

    Attributes:
        name: Name in reports.
        quantity: The limited field of `LegPosture`, and of `LegGeometry.ranges` where it is an angle.
        margin: The field of `ReachMargins` that is taken off both ends.
        planned: Whether centroidal motions keep it; the base may turn to spare the hip's yaw.
    """

    name: str
    quantity: str
    margin: str
    planned: bool = True

    def range_of(self, leg: LegGeometry) -> tuple[float, float]:
        """Lower and upper end in m or rad."""
        return (leg.min_length, leg.max_length) if self.quantity == "length" else leg.ranges[self.quantity]


LIMITS = (
    LegLimit("leg length", "length", "length"),
    LegLimit("ankle pitch", "ankle_pitch", "ankle"),
    LegLimit("ankle roll", "ankle_roll", "ankle"),
    LegLimit("hip pitch", "hip_pitch", "hip"),
    LegLimit("hip roll", "hip_roll", "hip"),
    LegLimit("hip yaw", "hip_yaw", "hip", planned=False),
)
"""All limits of a leg, for the screens, the optimiser and the checks."""
PLANNED = tuple(limit for limit in LIMITS if limit.planned)
TORQUE_ROLES = ("knee", "hip_roll", "hip_pitch", "hip_yaw", "ankle_pitch", "ankle_roll")


class LegPosture(NamedTuple):
    """Joint angles in rad, signs as in `LegGeometry.ranges`, and points in m in the world, three components each.

    Attributes:
        length: m; hip to ankle. Where the two links are too short, the angles are those of a nearly straight leg.
        ankle_pitch, ankle_roll, hip_pitch, hip_roll, hip_yaw, knee: rad.
        pitch_axis: Unit vector; axis of knee and ankle pitch in the world.
        thigh_axes: Unit vectors; x, y and z axis of the thigh that the last hip joint turns, in the axes of the base.
        heading: Cosine and sine of the base's.
        hips: How the hip's joints follow each other.
        hip_point, knee_point, ankle_point: m.
    """

    length: Any
    ankle_pitch: Any
    ankle_roll: Any
    hip_pitch: Any
    hip_roll: Any
    hip_yaw: Any
    knee: Any
    pitch_axis: tuple
    thigh_axes: tuple
    heading: tuple
    hips: HipJoints
    hip_point: tuple
    knee_point: tuple
    ankle_point: tuple


LIMITED = tuple(LegPosture._fields.index(limit.quantity) for limit in LIMITS)
"""Field of each limit's quantity."""


@law
def quantities(posture):
    """The scalar fields of a `LegPosture`: length and angles, which have limits."""
    return posture[:7]


@law
def turned(rotation, v):
    """A vector (3,) of a frame in the axes of the world; `rotation` is world_from_frame."""
    r = rotation
    return (
        r[0, 0] * v[0] + r[0, 1] * v[1] + r[0, 2] * v[2],
        r[1, 0] * v[0] + r[1, 1] * v[1] + r[1, 2] * v[2],
        r[2, 0] * v[0] + r[2, 1] * v[1] + r[2, 2] * v[2],
    )


@law
def hip_at(com, heading, hip_in_com):
    """Hip in m in the world, of a CoM in m, cosine and sine of the base's heading, and the hip in the base's frame."""
    x, y, z = from_base(hip_in_com, heading)
    return com[0] + x, com[1] + y, com[2] + z


@law
def ankle_at(position, rotation, ankle_in_sole):
    """Ankle in m in the world, of a sole with its centre at `position` m."""
    x, y, z = turned(rotation, ankle_in_sole)
    return position[0] + x, position[1] + y, position[2] + z


@law
def drop_to(hip, ankle, length):
    """By how many m a hip has to be lower to be `length` m from its ankle; to its height where it is farther."""
    x, y, z = between(hip, ankle)
    return -z - np.sqrt(np.fmax(length * length - x * x - y * y, 0.0))


@law
def between(a, b):
    """The way from a to b."""
    return b[0] - a[0], b[1] - a[1], b[2] - a[2]


@law
def dot(a, b):
    """Scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@law
def distance(a, b):
    """Distance between two points."""
    way = between(a, b)
    return np.sqrt(dot(way, way))


@law
def _kept(cosine):
    """A sine or cosine, kept away from where its angle's derivative is infinite."""
    return np.fmin(np.fmax(cosine, -STRAIGHT), STRAIGHT)


@law
def hip_joints(p, at):
    """`HipJoints` of their eight `numbers`, which may be symbols, from an index of p on."""
    order, first = (p[at], p[at + 1], p[at + 2]), (p[at + 3], p[at + 4], p[at + 5])
    return HipJoints(order, first, (p[at + 6], p[at + 7]))


@law
def _sign(order):
    """1 where the axes of a hip's joints are in cyclic order (x, y, z; y, z, x; z, x, y), else -1."""
    step = order[1] - order[0]  # 1 or -2 where they are, -1 or 2 where not
    return step * (3 - step * step) / 2


@law
def picked(number, items):
    """One of three items by its number, which may be a symbol."""
    return (number == 0) * items[0] + (number == 1) * items[1] + (number == 2) * items[2]


@law
def picked_vector(number, vectors):
    """One of three vectors by its number."""
    a, b, c = vectors
    return (
        picked(number, (a[0], b[0], c[0])),
        picked(number, (a[1], b[1], c[1])),
        picked(number, (a[2], b[2], c[2])),
    )


@law
def by_axis(order, items):
    """What belongs to the joints of a hip from the base down, in the order roll, pitch, yaw."""
    a, b, c = order
    return (
        (a == 0) * items[0] + (b == 0) * items[1] + (c == 0) * items[2],
        (a == 1) * items[0] + (b == 1) * items[1] + (c == 1) * items[2],
        (a == 2) * items[0] + (b == 2) * items[1] + (c == 2) * items[2],
    )


@law
def vectors_by_axis(order, vectors):
    """The same of vectors."""
    a, b, c = vectors
    x = by_axis(order, (a[0], b[0], c[0]))
    y = by_axis(order, (a[1], b[1], c[1]))
    z = by_axis(order, (a[2], b[2], c[2]))
    return (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])


@law
def _in_base(v, heading):
    """A vector of the world in the axes of a base with that heading."""
    c, s = heading[0], heading[1]
    return c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]


@law
def from_base(v, heading):
    """A vector in the axes of a base with that heading, in the world."""
    c, s = heading[0], heading[1]
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


@law
def _thigh_axes(across, line, thigh, joints):
    """Axes x, y and z of the frame of the thigh that the last hip joint turns, of its pitch axis and its line in m."""
    x, y, z = cross(across, line)
    k, q = joints.skew[0] / thigh, joints.skew[1] / thigh
    return (
        (k * x - q * line[0], k * y - q * line[1], k * z - q * line[2]),
        across,
        (k * line[0] + q * x, k * line[1] + q * y, k * line[2] + q * z),
    )


@law
def _hip_angles(thigh, joints):
    """Angles of hip roll, pitch and yaw in rad of the thigh's axes x, y and z in the axes of the base.

    A rotation about three axes i, j, k in turn has sin(middle) = s R_ik, tan(first) = -s R_jk / R_kk and
    tan(last) = -s R_ij / R_ii, with s = 1 where i, j, k are cyclic and -1 where they are not.
    """
    i, j, k = joints.order
    last, s = picked_vector(k, thigh), _sign(joints.order)
    by_last, by_middle = picked(i, last), picked(i, picked_vector(j, thigh))
    return by_axis(
        joints.order,
        (
            np.arctan2(-s * picked(j, last), picked(k, last)),
            np.arcsin(_kept(s * by_last)),
            np.arctan2(-s * by_middle, picked(i, picked_vector(i, thigh))),
        ),
    )


@law
def hip_axes(thigh, joints, tiny):
    """Axes of the hip's joints from the base down, of the thigh's axes x, y and z; unit vectors in the base.

    The first joint turns with the base, the last one with the thigh, and the one between is normal to both.
    """
    first, last = joints.first, picked_vector(joints.order[2], thigh)
    x, y, z = cross(last, first)
    scale = _sign(joints.order) / np.sqrt(x * x + y * y + z * z + tiny)
    return first, (scale * x, scale * y, scale * z), last


@law
def posture_between(hip, ankle, rotation, heading, thigh, shin, joints, tiny=0.0):
    """Posture of a leg of two links in m between a hip and an ankle in m in the world.

    The rotation is world_from_sole, the heading the cosine and sine of the base's, the joints the `HipJoints`. `tiny`
    in m^2 is added to squares under roots where derivatives are needed, so that they stay finite.
    """
    r = rotation
    dx, dy, dz = between(ankle, hip)
    x = r[0, 0] * dx + r[1, 0] * dy + r[2, 0] * dz
    y = r[0, 1] * dx + r[1, 1] * dy + r[2, 1] * dz
    z = r[0, 2] * dx + r[1, 2] * dy + r[2, 2] * dz
    square, beside = x * x + y * y + z * z + tiny, np.sqrt(y * y + z * z + tiny)
    length = np.sqrt(square)
    cosine = _kept((square + shin * shin - thigh * thigh) / (2.0 * shin * length))  # of the angle at the ankle
    at_knee = np.arccos(_kept((thigh * thigh + shin * shin - square) / (2.0 * thigh * shin)))
    lean = np.arctan2(x, beside) + np.arccos(cosine)  # of the shin, towards the toes
    across = turned(r, (0.0, z / beside, -y / beside))
    along, out = shin * cosine / length, shin * np.sqrt(1.0 - cosine * cosine) / length
    wx, wy, wz = cross(across, (dx, dy, dz))
    knee = (ankle[0] + along * dx + out * wx, ankle[1] + along * dy + out * wy, ankle[2] + along * dz + out * wz)
    axes = _thigh_axes(
        _in_base(across, heading),
        _in_base(between(knee, hip), heading),
        thigh,
        joints,
    )
    hip_roll, hip_pitch, hip_yaw = _hip_angles(axes, joints)
    return LegPosture(
        length,
        -lean,
        np.arctan2(y, z),
        hip_pitch,
        hip_roll,
        hip_yaw,
        np.pi - at_knee,
        across,
        axes,
        heading,
        joints,
        (hip[0], hip[1], hip[2]),
        knee,
        (ankle[0], ankle[1], ankle[2]),
    )


@law
def joint_lines(posture, rotation, tiny=0.0):
    """Axis and a point on it in m, in the world, of the joints of a leg in the order of `TORQUE_ROLES`."""
    heading, joints = posture.heading, posture.hips
    hips = vectors_by_axis(joints.order, hip_axes(posture.thigh_axes, joints, tiny))
    return (
        (posture.pitch_axis, posture.knee_point),
        (from_base(hips[0], heading), posture.hip_point),
        (from_base(hips[1], heading), posture.hip_point),
        (from_base(hips[2], heading), posture.hip_point),
        (posture.pitch_axis, posture.ankle_point),
        ((rotation[0, 0], rotation[1, 0], rotation[2, 0]), posture.ankle_point),
    )


@law
def torque_about(line, point, force, moment):
    """Torque tau = a . ((p - o) x f + m) about a joint's line: its axis a through o (`joint_lines`)."""
    axis, origin = line
    return dot(axis, moment_about(origin, point, force, moment))


@law
def moment_about(origin, point, force, moment):
    """Moment (p - o) x f + m about a point o of a force at another and of a moment."""
    x, y, z = cross(between(origin, point), force)
    return x + moment[0], y + moment[1], z + moment[2]


@law
def joint_torques(posture, sole, rotation, force, moment, tiny=0.0):
    """Static torques of a stance leg about its joints, its own weight left out, in the order of `TORQUE_ROLES`.

    The sole is the position of its centre in m, and the rotation world_from_sole. The force in N acts on the sole, with
    the moment in N m about its centre; all are in the world. `tiny` is as in `posture_between`.
    """
    a, b, c, d, e, f = joint_lines(posture, rotation, tiny)
    return (
        torque_about(a, sole, force, moment),
        torque_about(b, sole, force, moment),
        torque_about(c, sole, force, moment),
        torque_about(d, sole, force, moment),
        torque_about(e, sole, force, moment),
        torque_about(f, sole, force, moment),
    )


def leg_posture(
    leg: LegGeometry, com: np.ndarray, yaw: np.ndarray, position: np.ndarray, rotation: np.ndarray
) -> LegPosture:
    """Postures of a leg in n configurations; each component is (n,).

    Args:
        leg: Geometry of the leg.
        com: (n, 3) m; CoM in the world.
        yaw: (n,) rad; heading of the base.
        position: (n, 3) m; centre of the sole in the world.
        rotation: (n, 3, 3); world_from_sole.
    """
    heading, r = (np.cos(yaw), np.sin(yaw)), np.moveaxis(rotation, 0, -1)
    hip, ankle = hip_at(com.T, heading, leg.hip_in_com), ankle_at(position.T, r, leg.ankle_in_sole)
    return posture_between(hip, ankle, r, heading, leg.thigh, leg.shin, leg.hips)


def leg_clearances(
    leg: LegGeometry,
    com: np.ndarray,
    yaw: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
    margins: ReachMargins,
) -> dict[str, np.ndarray]:
    """Distance of n postures of a leg to each of its limits less its margin; negative where exceeded.

    The first arguments are those of `leg_posture`.

    Returns:
        Name of the limit -> (n,) m or rad: the smaller distance to the two ends of the range.
    """
    value = _quantities(leg.numbers, com, yaw, position, rotation)[:, LIMITED]
    lower, upper = np.array([limit.range_of(leg) for limit in LIMITS]).T
    taken = [getattr(margins, limit.margin) for limit in LIMITS]
    clearance = np.minimum(value - lower, upper - value) - taken
    return dict(zip((limit.name for limit in LIMITS), clearance.T, strict=True))


def leg_torques(
    leg: LegGeometry,
    com: np.ndarray,
    yaw: np.ndarray,
    sole: np.ndarray,
    rotation: np.ndarray,
    force: np.ndarray,
    moment: np.ndarray,
) -> dict[str, np.ndarray]:
    """Role -> (n,) N m of n stance legs; the last arguments are those of `joint_torques` with a first axis of n."""
    torques = _torques(leg.numbers, com, yaw, sole, rotation, force, moment)
    return dict(zip(TORQUE_ROLES, torques.T, strict=True))


@compiled
def _posture(leg, com, yaw, position, rotation):
    """Posture of a leg with the `numbers` of its geometry."""
    heading = (np.cos(yaw), np.sin(yaw))
    hip, ankle = hip_at(com, heading, leg[:3]), ankle_at(position, rotation, leg[3:6])
    return posture_between(hip, ankle, rotation, heading, leg[6], leg[7], hip_joints(leg, 8))


@compiled(kept=True, allocates=True)
def _quantities(leg, com, yaw, position, rotation):
    """(n, 7) scalar fields of the postures of a leg; arrays as in `leg_posture`."""
    found = np.empty((len(com), 7))
    for row in range(len(com)):
        values = quantities(_posture(leg, com[row], yaw[row], position[row], rotation[row]))
        for k in range(7):
            found[row, k] = values[k]
    return found


@compiled(kept=True, allocates=True)
def _torques(leg, com, yaw, sole, rotation, force, moment):
    """(n, 6) N m in the order of `TORQUE_ROLES`; arrays as in `leg_torques`."""
    found = np.empty((len(com), 6))
    for row in range(len(com)):
        posture = _posture(leg, com[row], yaw[row], sole[row], rotation[row])
        torques = joint_torques(posture, sole[row], rotation[row], force[row], moment[row])
        for k in range(6):
            found[row, k] = torques[k]
    return found
