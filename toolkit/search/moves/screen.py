"""Compiled kinematic screens: which candidate contacts a body could serve at all, before anything else is asked.

Each returns a code per candidate: 0 where it passes, else the index of the reason in `REASONS`.
"""

from __future__ import annotations

import numpy as np

from toolkit.compiled import compiled
from toolkit.search.moves.legs import LIMITS, violated
from toolkit.search.moves.occupancy import body_free
from toolkit.search.moves.shanks import leg_free, leg_points, legs_apart

REASONS = (
    "",
    "no surface holds the sole",
    "soles too close",
    "step too high",
    "body hits the world",
    *(f"{limit} out of range" for limit in LIMITS),  # 5 to 10
    "swing foot crosses the stance leg",
    "swing too fast",
    "no movement",
    "no surface holds the palm",
    "palm out of reach",
    "palm on the wrong side of the body",
    "palm faces away",
    "dynamics",
    "cannot lead to a better plan",
    "arm out of reach of its palm",
    "rejected by a later stage",
    "a leg hits the world",
    "legs hit each other",
    "no posture of the arm holds the palm",
)
NO_SURFACE, CLOSE, HIGH, BODY, LEG = 1, 2, 3, 4, 5
PALM_REASONS = (14, 15, 16, 17, 24)  # palms are an option: where they find no wall is no reason why there is no plan
CROSSES, FAST, STILL, NO_WALL, FAR, WRONG_SIDE, FACING, DYNAMICS, COSTLY, ARM, EXCLUDED, SHANK, KNEES = range(11, 24)
POSTURE = 24


@compiled(kept=True)
def rectangles_overlap(ax, ay, ayaw, bx, by, byaw, hx, hy):
    """Whether two rectangles of equal half extents overlap in XY (separating axes)."""
    dx, dy = bx - ax, by - ay
    ca, sa, cb, sb = np.cos(ayaw), np.sin(ayaw), np.cos(byaw), np.sin(byaw)
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    ex, ey = hx + c * hx + s * hy, hy + s * hx + c * hy  # reach of both along the axes of either
    if abs(ca * dx + sa * dy) > ex or abs(-sa * dx + ca * dy) > ey:
        return False
    return abs(cb * dx + sb * dy) <= ex and abs(-sb * dx + cb * dy) <= ey


@compiled(kept=True)
def mean_yaw(a, b):
    """Circular mean of two headings."""
    return np.arctan2(np.sin(a) + np.sin(b), np.cos(a) + np.cos(b))


@compiled(kept=True)
def screen_steps(
    surface, position, rotation, yaw, side, stand, stand_rotation, stand_yaw, half, climb, com_height, drops,
    shifts, legs, shanks, box, body_corner, body_cell, below, codes,
):  # fmt: skip
    """Fill codes of new soles beside a standing one, whatever the CoM may do.

    Args:
        surface: (n,) int; -1 where the projection found none.
        position: (n, 3) m.
        rotation: (n, 3, 3).
        yaw: (n,) rad.
        side: of the new soles: 0 left, 1 right.
        stand: (3,) m; standing sole.
        stand_rotation: (3, 3).
        stand_yaw: rad.
        half: (2,) m; half extents of a sole with half the distance that must stay between two.
        climb: m; largest difference of height.
        com_height: m; of the CoM above the mean of the soles, standing straight.
        drops: (k,) m; how much lower the CoM may be.
        shifts: (m,) parts of the way from one sole to the other, from their middle, where the CoM may be.
        legs: both legs.
        shanks: capsules inside them.
        box: (4,) m; half depth, half width, bottom and top of the body.
        body_corner: of the occupancy grid.
        body_cell: of the occupancy grid.
        below: of the occupancy grid.
        codes: (n,) int; filled.
    """
    new, old = np.empty((3, 3)), np.empty((3, 3))  # hip, knee and ankle
    for row in range(len(surface)):
        codes[row] = 0
        if surface[row] < 0:
            codes[row] = 1
            continue
        p = position[row]
        if rectangles_overlap(p[0], p[1], yaw[row], stand[0], stand[1], stand_yaw, half[0], half[1]):
            codes[row] = 2
            continue
        if abs(p[2] - stand[2]) > climb:
            codes[row] = 3
            continue
        heading = mean_yaw(yaw[row], stand_yaw)
        x, y, z = (p[0] + stand[0]) / 2, (p[1] + stand[1]) / 2, (p[2] + stand[2]) / 2
        code = 0
        for m in range(len(shifts)):
            cx, cy = x + shifts[m] * (p[0] - stand[0]), y + shifts[m] * (p[1] - stand[1])
            for k in range(len(drops)):
                cz = z + com_height - drops[k]
                broken = violated(legs, side, cx, cy, cz, heading, p, rotation[row])
                if broken < 0:
                    broken = violated(legs, 1 - side, cx, cy, cz, heading, stand, stand_rotation)
                if m == 0 and k == 0:
                    code = 5 + broken
                if broken >= 0:
                    continue
                leg_points(legs, side, cx, cy, cz, heading, p, rotation[row], new)
                leg_points(legs, 1 - side, cx, cy, cz, heading, stand, stand_rotation, old)
                if not legs_apart(shanks, new, old):
                    code = 23
                elif not (
                    leg_free(body_corner, body_cell, below, shanks, new)
                    and leg_free(body_corner, body_cell, below, shanks, old)
                ):
                    code = 22
                else:
                    code = 0
                    break
            if code == 0:
                break
        if code > 0:
            codes[row] = code
        elif not body_free(body_corner, body_cell, below, box, x, y, z, heading):
            codes[row] = 4


@compiled(kept=True)
def screen_swings(position, yaw, old, old_yaw, stand, stand_yaw, half, longest, still, still_yaw, codes):
    """Fill codes of swings of a foot from its old place past the standing one.

    Args:
        position: (n, 3) m; new soles.
        yaw: (n,) rad.
        old: (3,) m; the sole before.
        old_yaw: rad.
        stand: (3,) m; standing sole.
        stand_yaw: rad.
        half: (2,) m; as in `screen_steps`.
        longest: m; longest way in XY.
        still: m; a shorter way is no movement, unless it turns by more than `still_yaw`.
        still_yaw: rad.
        codes: (n,) int; filled.
    """
    for row in range(len(yaw)):
        dx, dy, dz = position[row, 0] - old[0], position[row, 1] - old[1], position[row, 2] - old[2]
        turn = np.arctan2(np.sin(yaw[row] - old_yaw), np.cos(yaw[row] - old_yaw))
        way = np.sqrt(dx * dx + dy * dy)
        codes[row] = 0
        if way > longest:
            codes[row] = 12
        elif way + abs(dz) < still and abs(turn) < still_yaw:
            codes[row] = 13
        else:
            for k in range(1, 8):
                t = k / 8.0
                if rectangles_overlap(
                    old[0] + t * dx,
                    old[1] + t * dy,
                    old_yaw + t * turn,
                    stand[0],
                    stand[1],
                    stand_yaw,
                    half[0],
                    half[1],
                ):
                    codes[row] = 11
                    break


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
        position: (n, 3) m.
        normal: (n, 3).
        shoulder: (3,) m.
        centre: (3,) m; mean of the feet.
        yaw: rad; heading of the body.
        sign: +1 for the left palm, -1 for the right one.
        reach: m; least and greatest distance from the shoulder.
        side: m; least distance to the side of the body's middle.
        facing: cosine of the largest angle between the arm and the surface's normal.
    """
    codes = np.zeros(len(surface), np.int64)
    arm = position - shoulder
    distance = np.linalg.norm(arm, axis=1)
    away = position - centre
    lateral = sign * (np.cos(yaw) * away[:, 1] - np.sin(yaw) * away[:, 0])
    cosine = -(arm * normal).sum(1) / np.maximum(distance, 1e-9)
    codes[cosine < facing] = FACING
    codes[lateral < side] = WRONG_SIDE
    codes[(distance < reach[0]) | (distance > reach[1])] = FAR
    codes[surface < 0] = NO_WALL
    return codes
