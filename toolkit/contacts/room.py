"""Room of a contact: how far the optimiser may displace it on its surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import shapely

from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.contacts.stance import Contact
from toolkit.geometry.pose import Pose
from toolkit.robot.model import RobotModel
from toolkit.world.surface import Surface
from toolkit.world.world import Goal


@dataclass(frozen=True)
class RoomConfig:
    """How far landing points may move, for a body of the usual size (`toolkit.robot.scale`).

    Attributes:
        reach: (2,) Largest displacement along and across the foot, each way, in m.
        margin: Distance of a sole from the edge of its surface, in m; less where the plan keeps less.
        gap: Distance of a sole from the other one, in m; less where the plan keeps less.
        step: The room grows in steps of this length, in m.
        arrival: Distance of the last feet's mean from the edge of the goal, in m; less where the plan keeps less.
    """

    reach: tuple[float, float] = (0.15, 0.04)
    margin: float = 0.01
    gap: float = 0.03
    step: float = 0.01
    arrival: float = 0.02

    def scaled(self, factor: float) -> RoomConfig:
        """The same with all lengths multiplied by a factor."""
        reach = factor * self.reach[0], factor * self.reach[1]
        rest = (factor * each for each in (self.margin, self.gap, self.step, self.arrival))
        return RoomConfig(reach, *rest)


def landing_room(
    robot: RobotModel,
    surfaces: Sequence[Surface],
    sequence: ContactSequence,
    config: RoomConfig = RoomConfig(),
    goal: Goal | None = None,
    hits: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
) -> np.ndarray:
    """Box of displacements along each new contact's own axes that keep a sole on its surface and off the other sole.

    Args:
        robot: The robot, for its size and those of its soles.
        surfaces: Surfaces of the world; contacts without a surface do not move.
        sequence: The planned contacts.
        config: Settings.
        goal: The goal at which the feet must stay in the end; None where they may leave it.
        hits: Whether feet whose soles are at (n, 3) m and (n, 3, 3) touch what stands beside them; None: none do.

    Returns:
        (transitions, 2, 2) m; the lowest and the highest displacement along x and y, zeros for palms.
    """
    config = config.scaled(robot.scale.length)
    room = np.zeros((len(sequence.transitions), 2, 2))
    stances = sequence.stances
    final = {item.limb: index for index, item in enumerate(sequence.transitions)}
    for index, transition in enumerate(sequence.transitions):
        contact = transition.contact
        if contact is None or not contact.limb.is_foot or not 0 <= contact.surface < len(surfaces):
            continue
        other = stances[index][contact.limb.mirrored]
        following = [item.contact for item in sequence.transitions[index + 1 :] if item.limb == other.limb]
        box = np.stack([-np.array(config.reach), np.array(config.reach)])
        for sole in (other, *following[:1]):
            if sole is not None:
                box = _apart(box, contact, sole, robot.half_sizes[contact.limb], config.gap)
        limits: list[Callable[[np.ndarray], bool]] = []
        if goal is not None and final[contact.limb] == index:
            limits.append(partial(_arrived, goal, stances[-1].mean_feet.position, contact, config.arrival))
        if hits is not None:
            limits.append(partial(_free, hits, contact))
        half = robot.half_sizes[contact.limb]
        margins = (robot.foot_room(config.margin) - half, 0.5 * config.margin, 0.0)
        room[index] = _inside(box, contact, surfaces[contact.surface], half, margins, config.step, limits)
    return room


def _apart(box: np.ndarray, contact: Contact, sole: Contact, half_size: np.ndarray, gap: float) -> np.ndarray:
    """The box without displacements towards another sole. Both soles may move, so each gets half of the way."""
    local = contact.pose.inverse() @ sole.pose
    corners = np.array([[a, b, 0.0] for a in (-1, 1) for b in (-1, 1)]) * np.append(half_size, 0.0)
    points = (local @ corners)[:, :2]
    ahead, behind = points.min(0) - half_size, -half_size - points.max(0)  # free way to the sole in + and - directions
    box = box.copy()
    # Soles that are apart across may pass each other; others must stay apart along as well.
    for axis in (1,) if max(ahead[1], behind[1]) > 0.0 else (0, 1):
        if ahead[axis] >= behind[axis]:
            box[1, axis] = min(box[1, axis], max((ahead[axis] - gap) / 2, 0.0))
        else:
            box[0, axis] = max(box[0, axis], -max((behind[axis] - gap) / 2, 0.0))
    return box


def _arrived(goal: Goal, centre: np.ndarray, contact: Contact, margin: float, box: np.ndarray) -> bool:
    """Whether the mean of the feet stays at the goal wherever in the box a foot lands.

    Both feet are displaced alike here. That covers any other displacements of the two, since the goal is convex.
    """
    farthest = goal.distance(centre + _ways(contact, box)).max()
    return bool(farthest <= max(goal.radius - margin, goal.distance(centre) + 1e-9))


def _free(hits: Callable[[np.ndarray, np.ndarray], np.ndarray], contact: Contact, box: np.ndarray) -> bool:
    """Whether a foot touches nothing at the corners of the box."""
    places = contact.pose.position + _ways(contact, box)
    return not hits(places, np.tile(contact.pose.rotation, (len(places), 1, 1))).any()


def _ways(contact: Contact, box: np.ndarray) -> np.ndarray:
    """(4, 3) m; the displacements in the world that the corners of the box stand for."""
    return np.array([[x, y, 0.0] for x in box[:, 0] for y in box[:, 1]]) @ contact.pose.rotation.T


def _inside(
    box: np.ndarray,
    contact: Contact,
    surface: Surface,
    half_size: np.ndarray,
    margins: Sequence[np.ndarray | float],
    step: float,
    limits: Sequence[Callable[[np.ndarray], bool]],
) -> np.ndarray:
    """The part of the box that is within all limits and keeps the sole on the surface.

    It keeps the first margin (m) that the sole has, and grows evenly from zero, in steps of `step` m.
    """
    region = surface.region
    frame = surface.pose.inverse() @ contact.pose
    shapely.prepare(region)

    def holds(found: np.ndarray, margin: np.ndarray | float) -> bool:
        (x0, y0), (x1, y1) = found[0] - half_size - margin, found[1] + half_size + margin
        swept = frame @ np.array([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])
        return bool(region.covers(shapely.Polygon(swept[:, :2])))

    found = np.zeros((2, 2))
    margin = next((margin for margin in margins if holds(found, margin)), None)
    if margin is None:
        return found
    growing = {(end, axis) for end in range(2) for axis in range(2)}
    while growing:
        for end, axis in sorted(growing):
            wider, limit = found.copy(), box[end, axis]
            bound, change = (min, step) if end else (max, -step)
            wider[end, axis] = bound(found[end, axis] + change, limit)
            stuck = wider[end, axis] == found[end, axis] or not all(allows(wider) for allows in limits)
            if stuck or not holds(wider, margin):
                growing.discard((end, axis))
            else:
                found = wider
    return found


def moved_sequence(
    sequence: ContactSequence, schedule: ContactSchedule, times: np.ndarray, position: np.ndarray
) -> ContactSequence:
    """The sequence with its contacts where a motion has them; surfaces, rotations and timings stay as planned.

    Args:
        sequence: The planned contacts.
        schedule: The schedule of the sequence.
        times: (N + 1,) Times of the motion's knots, in s.
        position: (N, len(Limb), 3) Places of the contacts in the motion's steps, in m.
    """
    transitions = []
    for index, transition in enumerate(sequence.transitions):
        contact = transition.contact
        if contact is not None:
            after = next(phase for phase in schedule.phases if phase.transition > index)
            step = int(np.searchsorted(times, (after.start + after.end) / 2, side="right")) - 1
            pose = Pose(contact.pose.rotation, position[step, contact.limb].copy())
            transition = replace(transition, contact=replace(contact, pose=pose))
        transitions.append(transition)
    return ContactSequence(sequence.start, tuple(transitions))
