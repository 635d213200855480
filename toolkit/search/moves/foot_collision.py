"""Feet that are wider than their soles, against what stands beside them."""

from __future__ import annotations

import numpy as np

from toolkit.contacts.projection import ProjectionConfig
from toolkit.geometry.limb import FEET
from toolkit.robot.model import RobotModel
from toolkit.world.clearance import BoxCollider
from toolkit.world.world import World

# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_FROM, _TO = 0.008, 0.03  # m above the sole: below it is left to rounded edges, above it to the swing's path
_CLEAR = 0.002  # m; kept free around the foot


class FootCollision:
    """Finds places where a foot touches the world beside its sole.

    A sole may have room where the foot has none: an edge of a tilted tile leans over its neighbour. The foot is a box
    around all its collision shapes, a little above the sole.

    Args:
        robot: The robot.
        world: The world.
    """

    def __init__(self, robot: RobotModel, world: World):
        length, outline = robot.scale.length, robot.foot_outline
        self._collider = BoxCollider(world)
        self._half = np.array([*(outline + length * _CLEAR), 0.5 * length * (_TO - _FROM)])
        self._height = 0.5 * length * (_TO + _FROM)

    @classmethod
    def of(cls, robot: RobotModel, world: World) -> FootCollision | None:
        """The collisions of a robot's feet; None for feet that are no wider than the room of their soles."""
        sole = robot.half_sizes[list(FEET)].max(0) + ProjectionConfig().scaled(robot.scale.length).margin
        return cls(robot, world) if (robot.foot_outline > sole).any() else None

    def hits(self, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """(n,) bool; whether feet whose soles are at (n, 3) m and (n, 3, 3), world_from_contact, touch the world."""
        poses = np.tile(np.eye(4), (len(position), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = rotation, position + self._height * rotation[:, :, 2]
        return self._collider.collide(poses, self._half)
