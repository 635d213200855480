"""Static balance: whether contacts can bear the robot's weight at rest, and at which CoM.

Each patch pushes at its four corners with forces in 16-gons inscribed in the friction cones. So what is found balanced
is so under the exact cones too, yaw moments included. With corner forces lambda_j d_j at p_j the robot is at rest where

    sum lambda_j d_j + m g = 0,    sum lambda_j p_j x d_j + c x m g = 0,    lambda_j >= s m |g| / n

and the linear program looks for the largest s: 1 if all n forces are equal, 0 at the limit, negative where forces
would have to pull. The CoM is given, or free within the limbs' reach: spheres, to which cutting planes are added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from toolkit.centroidal.build import ProblemConfig
from toolkit.centroidal.problem import GRAVITY, Margins
from toolkit.contacts.stance import Contact
from toolkit.geometry.heading import mean_heading
from toolkit.geometry.pose import rotation_about_z
from toolkit.physics.wrench import corner_rays
from toolkit.robot.model import RobotModel

SIDES = 16
_CUTS = 12  # most rounds of cutting planes; each reduces the distance outside the spheres several times
_TOLERANCE = 1e-7
# Price of a metre between the CoM and the middle of the contacts, in units of the margin, for a body of the usual size
# (`toolkit.robot.scale`).
_TIE = 1e-3


@dataclass(frozen=True)
class BalanceResult:
    """Verdict on static balance.

    Attributes:
        balanced: Whether the contacts can hold the robot at rest.
        com: (3,) m; the given CoM, or the best one within reach. Its height only matters for the reach.
        margin: The s above; negative where not balanced, -inf where no CoM is within reach.
    """

    balanced: bool
    com: np.ndarray
    margin: float


def statically_balanced(
    robot: RobotModel,
    contacts: Sequence[Contact],
    com: np.ndarray | None = None,
    *,
    margins: Margins | None = None,
) -> BalanceResult:
    """Static balance of a robot on contacts.

    Args:
        robot: The robot, with its mass, patches, legs and arms.
        contacts: At least one contact. The base has the mean heading of the feet.
        com: (3,) m; None to look for the best one within reach.
        margins: Margins of friction and patches; none by default. The yaw factor is not used: yaw moments follow from
            the corner forces.

    Raises:
        ValueError: There is no contact.
    """
    if not contacts:
        raise ValueError("static balance needs at least one contact")
    margins, weight = margins or Margins(), robot.mass * -GRAVITY[2]
    patches = [_generators(robot, contact, margins) for contact in contacts]
    origin = np.mean([contact.pose.position for contact in contacts], 0)
    count = sum(len(force) for force, _ in patches)
    force = np.concatenate([force for force, _ in patches])
    arm = np.concatenate([point for _, point in patches]) - origin
    wrench = np.concatenate([force, np.cross(arm, force)], 1).T
    # Columns: corner forces (in weights) above the common share, the share s; for a free CoM how far it is from the
    # middle of the contacts at home height along each axis (m), and the CoM relative to the middle of the contacts.
    columns = count + 1 + (6 if com is None else 0)
    equality = np.zeros((6, columns))
    equality[:, :count] = wrench
    equality[:, count] = wrench.sum(1) / count
    right = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # c x (0, 0, -1)
    if com is None:
        equality[3:, -3:] = turn
    else:
        right[3:] = -turn @ (np.asarray(com, float) - origin)
    upper, bound = _normal_bounds(robot, contacts, patches, columns, weight)
    cost = np.zeros(columns)
    cost[count] = -1.0
    limits = [(0.0, None)] * count + [(None, 1.0)]
    if com is not None:
        return _solved(cost, upper, bound, equality, right, limits, np.asarray(com, float), None)
    centers, radii, floor = _reach(robot, contacts)
    # Of equal margins, the CoM nearest to the middle at home height wins: a metre costs a thousandth of the margin.
    cost[count + 1 : count + 4] = _TIE / robot.scale.length
    deviation = np.zeros((6, columns))
    deviation[:, count + 1 : count + 4] = -np.concatenate([np.eye(3), np.eye(3)])
    deviation[:, -3:] = np.concatenate([np.eye(3), -np.eye(3)])
    middle = np.array([0.0, 0.0, robot.com_height])
    upper = np.concatenate([upper, deviation])
    bound = np.concatenate([bound, middle, -middle])
    limits += [(0.0, None)] * 3
    return _searched(cost, upper, bound, equality, right, limits, origin, centers, radii, floor)


def _generators(robot: RobotModel, contact: Contact, margins: Margins) -> tuple[np.ndarray, np.ndarray]:
    """Unit-normal corner forces along the edges of the friction polygon, and where they act, in the world."""
    half_size = margins.within(robot.limbs[contact.limb].borne(contact.bearing))
    force, point = corner_rays(contact.friction * margins.friction, half_size, SIDES)
    return force @ contact.pose.rotation.T, contact.pose @ point


def _normal_bounds(robot: RobotModel, contacts: Sequence[Contact], patches: list, columns: int, weight: float):
    """Rows that keep each limb's normal force below its bound."""
    count = sum(len(force) for force, _ in patches)
    rows, bounds, first = [], [], 0
    for contact, (force, _) in zip(contacts, patches, strict=True):
        most = robot.limbs[contact.limb].max_normal_force / weight
        if most < 1e3:
            row = np.zeros(columns)
            row[first : first + len(force)] = 1.0  # every generator has a unit normal force
            row[count] = len(force) / count
            rows.append(row)
            bounds.append(most)
        first += len(force)
    return np.array(rows).reshape(-1, columns), np.array(bounds)


def _reach(robot: RobotModel, contacts: Sequence[Contact]) -> tuple[np.ndarray, np.ndarray, float]:
    """(n, 3) centres and (n,) radii of spheres that hold the CoM, and its least height."""
    feet = [contact for contact in contacts if contact.limb.is_foot]
    headings = [contact.pose.yaw for contact in feet or contacts]
    base = rotation_about_z(float(mean_heading(headings[0], headings[-1])))
    centers, radii = [], []
    for contact in contacts:
        if contact.limb.is_foot:
            leg = robot.legs[contact.limb]
            root, tip, radius = leg.hip_in_com, contact.pose @ leg.ankle_in_sole, leg.max_length
        else:
            arm = robot.arms[contact.limb]
            root, tip, radius = arm.shoulder_in_com, contact.pose.position, arm.max_reach
        centers.append(tip - base @ root)
        radii.append(radius)
    floor = min((contact.pose.position[2] for contact in feet), default=-np.inf)
    return np.array(centers), np.array(radii), floor + ProblemConfig.min_height * robot.com_height


def _searched(cost, upper, bound, equality, right, limits, origin, centers, radii, floor) -> BalanceResult:
    """The best CoM within the spheres: cuts are added where a sphere is left, until none is."""
    columns = len(cost)
    height = None if np.isinf(floor) else floor - origin[2]
    reach = np.max(radii)
    span = [(center.min() - reach, center.max() + reach) for center in (centers - origin).T]
    span[2] = (span[2][0] if height is None else height, span[2][1])
    if span[2][0] > span[2][1]:
        return BalanceResult(False, origin, -np.inf)
    limits = [*limits, *span]
    best = BalanceResult(False, origin, -np.inf)
    for _ in range(_CUTS):
        best = _solved(cost, upper, bound, equality, right, limits, None, origin)
        if not best.balanced:
            return best
        offset = best.com - centers
        distance = np.linalg.norm(offset, axis=1)
        outside = distance > radii + 1e-6
        if not outside.any():
            return best
        cuts = np.zeros((int(outside.sum()), columns))
        direction = offset[outside] / distance[outside, None]
        cuts[:, -3:] = direction
        upper = np.concatenate([upper, cuts])
        bound = np.concatenate([bound, (direction * (centers[outside] - origin)).sum(1) + radii[outside]])
    return BalanceResult(False, best.com, best.margin)


def _solved(cost, upper, bound, equality, right, limits, com, origin) -> BalanceResult:
    """Solve the program; the CoM is the given one or the last three columns relative to the origin."""
    rows = {"A_ub": upper, "b_ub": bound} if len(bound) else {}
    solution = linprog(cost, A_eq=equality, b_eq=right, bounds=limits, method="highs", **rows)
    if solution.status != 0:  # infeasible: the reach holds no CoM, or a bound on a normal force too little
        return BalanceResult(False, com if com is not None else origin, -np.inf)
    margin = float(solution.x[np.argmin(cost)])
    return BalanceResult(margin >= -_TOLERANCE, com if com is not None else solution.x[-3:] + origin, margin)
