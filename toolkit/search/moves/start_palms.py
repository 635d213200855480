"""The palms that are in contact when the robot starts."""

from __future__ import annotations

import numpy as np

from toolkit.contacts.projection import shifts
from toolkit.contacts.stance import Contact, Stance
from toolkit.errors import WorldError
from toolkit.geometry.limb import FEET, Limb
from toolkit.search.moves.moves import MoveGenerator
from toolkit.search.moves.reasons import Reason
from toolkit.world.world import PALM_SITE_REACH, PALM_SITES, World

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_SEARCH, _STEP = 0.1, 0.02  # m; farthest from the point nearest to its site that a palm may start, and the grid's step


def with_palms(world: World, feet: Stance, moves: MoveGenerator) -> Stance:
    """The start stance with the palms that the world's sites ask for, each as near to its site as it can be held.

    Raises:
        WorldError: The robot has no such arm, or it cannot hold its palm there.
    """
    robot, (left, right) = moves.robot, (moves.table.add_contact(feet[foot]) for foot in FEET)
    stance = feet
    for limb, site in world.start_palms.items():
        if limb not in robot.arms:
            raise WorldError(
                f"{world.path}: site '{PALM_SITES[limb]}' asks for a palm that robot {robot.name} does not have; "
                "remove the site, or take a robot with such an arm"
            )
        stance = stance.replace(_placed(world, limb, site, moves, left, right))
    return stance


def _placed(world: World, limb: Limb, site: np.ndarray, moves: MoveGenerator, left: int, right: int) -> Contact:
    """The palm's contact nearest to its site (3,) m, with the feet at `left` and `right`."""
    shoulder, reach = moves.shoulder(limb, left, right), moves.robot.arms[limb].max_reach
    scale = moves.robot.scale.length
    rays = _points(world, site, scale) - shoulder
    distance = np.maximum(np.linalg.norm(rays, axis=1), 1e-9)
    palms, codes = moves.aimed(limb, left, right, rays / distance[:, None])
    codes[(codes == Reason.NO_WALL) & (distance > reach)] = Reason.FAR
    far = np.linalg.norm(palms.position - site, axis=1)  # what is hit before the point may be elsewhere
    codes[(codes == 0) & (far > PALM_SITE_REACH + scale * _SEARCH)] = Reason.NO_WALL
    if not (codes == 0).any():
        code = Reason.POSTURE if (codes == Reason.POSTURE).any() else codes[0]  # the last screen, or the nearest point
        at, above = (f"({x:.3g}, {y:.3g}, {z:.3g})" for x, y, z in (site, shoulder))
        raise WorldError(
            f"{world.path}: the {limb.label.replace('_', ' ')} cannot start at site '{PALM_SITES[limb]}' {at}, from "
            f"the shoulder at {above}: {Reason(code).words}; move the site along the wall, move the start nearer to "
            "the wall or away from it, or remove the site"
        )
    row = int(np.argmin(np.where(codes == 0, far, np.inf)))
    return moves.table.contact(int(moves.table.add(limb, palms.select(np.array([row])))[0]))


def _points(world: World, site: np.ndarray, scale: float) -> np.ndarray:
    """(n, 3) m; places for the palm about the point of each palm surface nearest to the site; `scale` is of lengths."""
    spread = shifts(scale * _SEARCH, scale * _STEP)
    points = []
    for surface in world.surfaces:
        if surface.serves_palm:
            middle = surface.nearest_point(site)
            if np.linalg.norm(middle - site) <= PALM_SITE_REACH:
                points.append(middle + spread @ surface.pose.rotation[:, :2].T)
    return np.concatenate(points)
