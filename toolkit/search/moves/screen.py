"""Compiled kinematic screens: the candidate contacts that a body could serve at all. They come before other checks.

Each screen gives a code per candidate, which is a `Reason`: 0 where the candidate passes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.compiled import compiled
from toolkit.geometry.heading import mean_heading, wrapped
from toolkit.search.moves.legs import Legs, least_drop, reach
from toolkit.search.moves.limits import SHIFTS
from toolkit.search.moves.occupancy import BodyBox, Occupancy, body_free, lowest_drop
from toolkit.search.moves.reasons import Reason
from toolkit.search.moves.shanks import Shanks, leg_free, legs_apart


class Soles(NamedTuple):
    """New soles.

    Attributes:
        surface: (n,) int; surface, -1 where the projection found none.
        position: (n, 3) m; centre.
        rotation: (n, 3, 3); world_from_sole.
        yaw: (n,) rad; heading.
    """

    surface: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    yaw: np.ndarray


class Sole(NamedTuple):
    """One sole in contact, with its centre (3,) m, rotation world_from_sole (3, 3) and heading in rad."""

    position: np.ndarray
    rotation: np.ndarray
    yaw: float


class Body(NamedTuple):
    """The robot as the screens see it, and the world that it may hit.

    Attributes:
        legs: Both legs.
        shanks: The capsules inside thighs and shins.
        box: The body from the knees up, standing straight.
        occupancy: Occupied cells of the world.
    """

    legs: Legs
    shanks: Shanks
    box: BodyBox
    occupancy: Occupancy


class StepLimits(NamedTuple):
    """Limits on soles and CoM in a step.

    Attributes:
        half: (2,) m; half extents of the room of a foot, into which no other foot may step.
        climb: Largest difference of height in m.
        com_height: Height in m of the CoM above the mean of the soles, standing straight.
        drops: (k,) m by which the CoM may be lower.
        wall_bottom, wall_top: m above the soles; what is there stops a foot, however high it is lifted.
        lift: m above the straight way at which a foot passes the other one.
    """

    half: np.ndarray
    climb: float
    com_height: float
    drops: np.ndarray
    wall_bottom: float
    wall_top: float
    lift: float


@compiled
def rectangles_overlap(ax, ay, ayaw, bx, by, byaw, hx, hy):
    """Whether two rectangles of equal half extents overlap in XY (separating axes)."""
    dx, dy = bx - ax, by - ay
    ca, sa, cb, sb = np.cos(ayaw), np.sin(ayaw), np.cos(byaw), np.sin(byaw)
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    ex, ey = hx + c * hx + s * hy, hy + s * hx + c * hy  # reach of both along the axes of either
    if abs(ca * dx + sa * dy) > ex or abs(-sa * dx + ca * dy) > ey:
        return False
    return abs(cb * dx + sb * dy) <= ex and abs(-sb * dx + cb * dy) <= ey


@compiled
def _legs_code(body, limits, least, side, position, rotation, stand, heading):
    """Why the legs cannot stand on a new sole and a standing one with any allowed CoM; 0 where they can.

    Of the drops of the CoM only those from number `least` on are allowed, and what the legs need to reach between them.
    """
    p, q = position, stand.position
    x, y, z = (p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2 + limits.com_height
    drops, code = limits.drops, 0
    for m in range(len(SHIFTS)):
        cx, cy = x + SHIFTS[m] * (p[0] - q[0]), y + SHIFTS[m] * (p[1] - q[1])
        if side == 0:
            needed = least_drop(body.legs, (cx, cy, z), heading, p, rotation, q, stand.rotation)
        else:
            needed = least_drop(body.legs, (cx, cy, z), heading, q, stand.rotation, p, rotation)
        first = max(drops[least], needed)
        if first > drops[-1]:
            if m == 0:
                code = Reason.LEG_LENGTH
            continue
        for k in range(least - 1, len(drops)):
            drop = first if k < least else drops[k]
            if k >= least and drop <= first:
                continue
            com = (cx, cy, z - drop)
            broken, new = reach(body.legs, side, com, heading, p, rotation)
            old = new
            if broken == 0:
                broken, old = reach(body.legs, 1 - side, com, heading, q, stand.rotation)
            if broken > 0:
                if m == 0 and k < least:
                    code = broken
            elif not legs_apart(body.shanks, new, old):
                code = Reason.KNEES
            elif leg_free(body.occupancy, body.shanks, new) and leg_free(body.occupancy, body.shanks, old):
                return 0
            else:
                code = Reason.SHANK
    return code


@compiled(kept=True)
def screen_steps(soles, side, stand, limits, body, codes):
    """Fill codes (n,) int of new `Soles` beside a standing `Sole`, for all CoMs within `StepLimits`.

    The side is that of the new soles: 0 left, 1 right.
    """
    half, q = limits.half, stand.position
    for row in range(len(codes)):
        p, yaw = soles.position[row], soles.yaw[row]
        if soles.surface[row] < 0:
            codes[row] = Reason.NO_SURFACE
        elif rectangles_overlap(p[0], p[1], yaw, q[0], q[1], stand.yaw, half[0], half[1]):
            codes[row] = Reason.CLOSE
        elif abs(p[2] - q[2]) > limits.climb:
            codes[row] = Reason.HIGH
        else:
            heading, rotation = mean_heading(yaw, stand.yaw), soles.rotation[row]
            codes[row] = _legs_code(body, limits, 0, side, p, rotation, stand, heading)
            if codes[row] == 0:
                x, y, z = (p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2
                least = lowest_drop(body.occupancy, body.box, limits.drops, x, y, z, heading)
                if least < 0:
                    codes[row] = Reason.BODY
                elif least > 0:
                    codes[row] = _legs_code(body, limits, least, side, p, rotation, stand, heading)


@compiled(kept=True)
def screen_swings(position, yaw, old, stand, half, longest, still, still_yaw, codes):
    """Fill codes (n,) int of swings of a foot from the `Sole` `old` past the standing one `stand`.

    The new soles have centres position (n, 3) m and headings yaw (n,) rad; `half` is that of `StepLimits`. No way in XY
    may be longer than `longest` m. A way shorter than `still` m with a turn below `still_yaw` rad is no movement.
    """
    p, q = old.position, stand.position
    for row in range(len(yaw)):
        dx, dy, dz = position[row, 0] - p[0], position[row, 1] - p[1], position[row, 2] - p[2]
        turn = wrapped(yaw[row] - old.yaw)
        way = np.sqrt(dx * dx + dy * dy)
        codes[row] = 0
        if way > longest:
            codes[row] = Reason.FAST
        elif way + abs(dz) < still and abs(turn) < still_yaw:
            codes[row] = Reason.STILL
        else:
            for k in range(1, 8):
                t = k / 8.0
                x, y, angle = p[0] + t * dx, p[1] + t * dy, old.yaw + t * turn
                if rectangles_overlap(x, y, angle, q[0], q[1], stand.yaw, half[0], half[1]):
                    codes[row] = Reason.CROSSES
                    break


@compiled(kept=True)
def screen_midway(position, yaw, old, stand, limits, body, codes):
    """Fill codes (n,) int of those swings that have passed `screen_swings`: does the body or the foot hit a wall?

    The body is looked at half-way between the stances, and the foot on the straight way, at a height to which it is not
    lifted.
    """
    p, r = old.position, stand.position
    before = mean_heading(old.yaw, stand.yaw)
    foot = BodyBox(limits.half[0], limits.half[1], limits.wall_bottom, limits.wall_top)
    for row in range(len(yaw)):
        if codes[row] == 0:
            q = position[row]
            x, y, z = (p[0] + q[0] + 2 * r[0]) / 4, (p[1] + q[1] + 2 * r[1]) / 4, (p[2] + q[2] + 2 * r[2]) / 4
            heading = before + wrapped(mean_heading(yaw[row], stand.yaw) - before) / 2
            if lowest_drop(body.occupancy, body.box, limits.drops, x, y, z, heading) < 0:
                codes[row] = Reason.BODY
            z, turn = max(p[2], q[2]), wrapped(yaw[row] - old.yaw)
            for k in range(1, 8):
                t = k / 8.0
                x, y = p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])
                if codes[row] == 0 and not body_free(body.occupancy, foot, x, y, z, old.yaw + t * turn):
                    codes[row] = Reason.SHANK


@compiled
def _legs_pass(body, limits, side, position, rotation, stand, heading):
    """Whether the legs keep apart with a foot in the air and the other standing, under any allowed CoM that both reach.

    Also where they reach under none, which is for others to say.
    """
    p, q = position, stand.position
    x, y, z = (p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] - limits.lift + q[2]) / 2 + limits.com_height
    reached = False
    for m in range(len(SHIFTS)):
        cx, cy = x + SHIFTS[m] * (p[0] - q[0]), y + SHIFTS[m] * (p[1] - q[1])
        for k in range(len(limits.drops)):
            com = (cx, cy, z - limits.drops[k])
            broken, swinging = reach(body.legs, side, com, heading, p, rotation)
            if broken == 0:
                broken, standing = reach(body.legs, 1 - side, com, heading, q, stand.rotation)
                if broken == 0:
                    if legs_apart(body.shanks, swinging, standing):
                        return True
                    reached = True
    return not reached


@compiled(kept=True, allocates=True)
def screen_passing(side, position, yaw, old, stand, limits, body, codes):
    """Fill codes (n,) int of those swings that have passed `screen_midway`: do the legs keep apart on the way?

    The foot of a side (0 left, 1 right) is looked at on the straight way, lifted and level.
    """
    p, rotation = old.position, np.zeros((3, 3))
    rotation[2, 2] = 1.0
    for row in range(len(yaw)):
        turn = wrapped(yaw[row] - old.yaw)
        for k in range(1, 4):
            if codes[row] == 0:
                angle = old.yaw + k / 4.0 * turn
                place = p + k / 4.0 * (position[row] - p)
                place[2] += limits.lift * np.sin(np.pi * k / 4.0)
                rotation[0, 0] = rotation[1, 1] = np.cos(angle)
                rotation[1, 0] = np.sin(angle)
                rotation[0, 1] = -rotation[1, 0]
                if not _legs_pass(body, limits, side, place, rotation, stand, mean_heading(angle, stand.yaw)):
                    codes[row] = Reason.KNEES


def screen_palms(
    surface: np.ndarray,
    position: np.ndarray,
    normal: np.ndarray,
    shoulder: np.ndarray,
    centre: np.ndarray,
    yaw: float,
    sign: float,
    reach: tuple[float, float],
    side: float,
    facing: float,
) -> np.ndarray:
    """Codes (n,) of palms.

    Args:
        surface: (n,) int; -1 where the projection found none.
        position: (n, 3) m; centres of the palms.
        normal: (n, 3); normals of the surfaces.
        shoulder: (3,) m; the arm's shoulder.
        centre: (3,) m; mean of the feet.
        yaw: Heading of the body in rad.
        sign: +1 for the left palm, -1 for the right one.
        reach: Least and greatest distance in m from the shoulder.
        side: Least distance in m to the side of the body's middle.
        facing: Cosine of the largest angle between the arm and the surface's normal.
    """
    codes = np.zeros(len(surface), np.int64)
    arm = position - shoulder
    distance = np.linalg.norm(arm, axis=1)
    away = position - centre
    lateral = sign * (np.cos(yaw) * away[:, 1] - np.sin(yaw) * away[:, 0])
    cosine = -(arm * normal).sum(1) / np.maximum(distance, 1e-9)
    codes[cosine < facing] = Reason.FACING
    codes[lateral < side] = Reason.WRONG_SIDE
    codes[(distance < reach[0]) | (distance > reach[1])] = Reason.FAR
    codes[surface < 0] = Reason.NO_WALL
    return codes
