"""Landings: half planes that bound where the contacts to be made may go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.layout import Landing
from toolkit.contacts.stance import Contact
from toolkit.control.sampled_plan import Swing
from toolkit.geometry.pose import Pose
from toolkit.replanning.situation import Situation
from toolkit.robot.scale import USUAL, Scale
from toolkit.world.surface import Surface

CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
# Lengths, speeds and times are those of a body of the usual size (`toolkit.robot.scale`).
MAX_SHIFT = 0.15  # m; largest shift of a landing point along each axis of its plane
MARGIN = 0.01  # m; distance of the sole from the edge of its surface, for errors of the swing's tracking
GAP = 0.02  # m; between a landing sole and the other one
SETTLING = 0.05  # s; a landing point no longer moves so long before the end of the swing
SLEW = 0.8  # m/s; how far a landing point may still move per second that is left: a foot is not faster sideways


@dataclass(frozen=True)
class FreeLandings:
    """Landing points that a replan may move.

    Attributes:
        events: The swings, the next one first.
        items: Their feet, and the steps in which they are chosen: as the swing begins, or now.
        planes: The axes (3, 2) of each landing point's plane.
        goal: (n, 2) m; the shifts that were decided last, along these axes.
        regions: Rows (k, 2) and bounds (k,) of each shift.
    """

    events: list[int]
    items: list[Landing]
    planes: list[np.ndarray]
    goal: np.ndarray
    regions: list[tuple[np.ndarray, np.ndarray]]


class Landings:
    """The contacts that feet are to make, by their swings, and how far each may be shifted."""

    def __init__(
        self, swings: tuple[Swing, ...], half_sizes: np.ndarray, surfaces: tuple[Surface, ...], scale: Scale = USUAL
    ):
        """Collect the contacts of swings on surfaces; the patches' half sizes are (4, 2) in m."""
        self._swings, self._half_sizes, self._surfaces, self._scale = swings, half_sizes, surfaces, scale
        self.contacts: dict[int, Contact] = {
            event: swing.contact
            for event, swing in enumerate(swings)
            if swing.contact is not None and swing.limb.is_foot and swing.contact.surface >= 0
        }
        self._regions: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def free(self, events: list[int], situation: Situation, times: np.ndarray, early: dict[int, float]) -> FreeLandings:
        """The landing points of swings that may move, at knots (N + 1,) in s; `early` has earlier ends of swings."""
        planes = [self.contacts[event].pose.rotation[:, :2] for event in events]
        goal = [plane.T @ situation.goal.get(event, np.zeros(3)) for event, plane in zip(events, planes, strict=True)]
        items, regions, anywhere = [], [], np.full(2, np.inf)
        for event in events:
            swing = self._swings[event]
            step = max(int(np.searchsorted(times, swing.start + 1e-6, side="right")) - 1, 0)
            items.append(Landing(swing.limb, step, -anywhere, anywhere))
            regions.append(self.region(event, situation, early.get(event, swing.end)))
        return FreeLandings(events, items, planes, np.reshape(goal, (-1, 2)), regions)

    def region(self, event: int, situation: Situation, end: float) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k, 2) and bounds (k,) of at least 0 of a landing point's shift: `rows @ shift <= bounds`.

        The swing `event` makes the contact and ends at `end` in s.
        """
        swing, contact = self._swings[event], self.contacts[event]
        half, scale = self._half_sizes[swing.limb], self._scale
        if event not in self._regions:
            self._regions[event] = landing_rows(contact, half, self._surfaces[contact.surface], scale.length * MARGIN)
        region, room = self._regions[event]
        axes = np.concatenate([np.eye(2), -np.eye(2)])
        reach = np.full(4, scale.length * MAX_SHIFT)
        if event in situation.moving:
            moved = contact.pose.rotation[:, :2].T @ situation.moving[event]
            left = scale.speed * SLEW * max(end - situation.time - scale.time * SETTLING, 0.0)
            reach = np.minimum(reach, np.maximum(axes @ moved + left, 0.0))
        rows, bounds = [region, axes], [room, reach]
        other = situation.standing.get(swing.limb.mirrored)
        if other is not None and swing.start <= situation.time + 1e-9:
            row, room = apart_row(contact.pose, half, Pose(other[2], other[1]), half, scale.length * GAP)
            rows.append(row[None])
            bounds.append(np.array([room]))
        return np.concatenate(rows), np.concatenate(bounds)


def landing_rows(
    contact: Contact, half_size: np.ndarray, surface: Surface, margin: float
) -> tuple[np.ndarray, np.ndarray]:
    """Shifts of a contact that keep its whole patch (half sizes (2,) in m) on one convex piece of its surface.

    The margin is the distance in m to the piece's edges. Where the planned contact is closer, it may not come closer.

    Returns:
        Unit rows (k, 2) and bounds (k,) of at least 0: `rows @ shift <= bounds`, with the shift in m along x and y of
        the contact frame.
    """
    corners = (CORNERS * half_size) @ contact.pose.rotation[:, :2].T + contact.pose.position
    local = ((corners - surface.pose.position) @ surface.pose.rotation)[:, :2]
    plane_from_contact = (surface.pose.rotation.T @ contact.pose.rotation[:, :2])[:2]
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    for piece in surface.pieces:
        edge = np.roll(piece, -1, 0) - piece
        length = np.linalg.norm(edge, axis=1)
        edge, start = edge[length > 1e-9], piece[length > 1e-9]
        outward = np.stack([edge[:, 1], -edge[:, 0]], 1) / length[length > 1e-9, None]
        room = (outward * start).sum(1) - (outward @ local.T).max(1)
        if best is None or room.min() > best[0]:
            best = float(room.min()), outward @ plane_from_contact, room
    if best is None:
        return np.zeros((0, 2)), np.zeros(0)
    return best[1], np.maximum(best[2] - margin, 0.0)


def apart_row(
    pose: Pose, half_size: np.ndarray, other: Pose, other_half: np.ndarray, gap: float
) -> tuple[np.ndarray, float]:
    """The half plane that keeps a patch beside another one that rests, seen along the normal of the first.

    The half sizes are (2,) in m. Where the planned gap is smaller than `gap` in m, it may not shrink.

    Returns:
        Row (2,) and bound of at least 0: `row @ shift <= bound`.
    """
    own = CORNERS * half_size
    corners = (CORNERS * other_half) @ other.rotation[:, :2].T + other.position
    theirs = ((corners - pose.position) @ pose.rotation)[:, :2]
    axes = (pose.rotation.T @ other.rotation)[:2, :2].T
    axes = axes / np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-9)
    axes = np.concatenate([np.eye(2), axes])
    axes = np.concatenate([axes, -axes])
    room = (theirs @ axes.T).min(0) - (own @ axes.T).max(0)  # how far the patch may go along each axis
    best = int(np.argmax(room))
    return axes[best], max(float(room[best]) - gap, 0.0)
