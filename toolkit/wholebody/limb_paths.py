"""Planned place of each limb's patch at any time of a schedule."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.schedule import ContactSchedule, Phase
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.heading import mean_heading, wrapped
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose, mean_pose
from toolkit.physics.leg import leg_posture
from toolkit.robot.model import RobotModel
from toolkit.wholebody.swing import LimbSample, SwingPath, Window
from toolkit.wholebody.swing_planner import Collide, plan_swing
from toolkit.wholebody.swing_task import LIFT, SAMPLES, SPARE, StandingLeg, SwingingLeg, SwingTask, leg_points
from toolkit.world.clearance import BoxCollider
from toolkit.world.world import World

LEADING = 0.4  # authority of a palm's path in its middle
LEFT, COMING = 0.3, 0.5  # parts of a palm's swing: until it has left its contact, and from when on it comes to the next


@dataclass(frozen=True)
class Segment:
    """A limb during one phase.

    Attributes:
        begin, end: s.
        transition: Index of the transition that the phase belongs to.
        pose: world_from_contact of a limb in contact; None otherwise.
        path: Path of a limb that swings; None in contact and for a free palm.
        free_start, free_end: Whether the path comes from, or goes to, the arm's free posture.
    """

    begin: float
    end: float
    transition: int
    pose: Pose | None = None
    path: SwingPath | None = None
    free_start: bool = False
    free_end: bool = False

    def share(self, time: float) -> float:
        """The part of the phase that is over at a time in s."""
        return (time - self.begin) / (self.end - self.begin)


@dataclass(frozen=True)
class LimbPaths:
    """Paths of all limbs over a schedule; before and after it they rest.

    `segments` has one tuple per limb (indexed by `Limb`), in order of time, without gaps.
    """

    segments: tuple[tuple[Segment, ...], ...]

    @cached_property
    def _begins(self) -> tuple[list[float], ...]:
        return tuple([segment.begin for segment in segments] for segments in self.segments)

    def segment(self, limb: Limb, time: float) -> Segment:
        """The limb's segment at a time in s, clamped at the ends."""
        return self.segments[limb][max(bisect_right(self._begins[limb], time) - 1, 0)]

    def sample(self, limb: Limb, time: float) -> LimbSample:
        """The limb's patch at a time in s, clamped at the ends."""
        segment = self.segment(limb, time)
        if segment.path is not None:
            return segment.path.sample(time)
        if segment.pose is not None:
            return LimbSample(segment.pose, np.zeros(6), np.zeros(6), True)
        return LimbSample(None, np.full(6, np.nan), np.full(6, np.nan), False)

    def mean_feet(self, time: float) -> Pose:
        """Upright frame at the mean of the planned feet, in contact or not, at a time in s."""
        left, right = (self.sample(foot, time).pose for foot in FEET)
        assert left is not None and right is not None
        return mean_pose(left, right)

    def authority(self, limb: Limb, time: float) -> float:
        """How binding the limb's pose is, in [0, 1]: a palm blends from and to the arm's free posture."""
        segment = self.segment(limb, time)
        if segment.path is None:
            return 0.0 if segment.pose is None else 1.0
        if limb.is_foot:
            return 1.0
        # In between, a palm's path has little authority, so that it does not drag the trunk along or twist the arm.
        u = segment.share(time)
        if u < COMING:
            left = Window(0.0, LEFT).step(u)[0]
            return LEADING * left if segment.free_start else 1.0 - (1.0 - LEADING) * left
        near = Window(COMING, 0.95).step(u)[0]
        return LEADING * (1.0 - near) if segment.free_end else LEADING + (1.0 - LEADING) * near

    def at_surface(self, palm: Limb, time: float) -> bool:
        """Whether the palm has a contact, leaves one or comes to one."""
        segment = self.segment(palm, time)
        if segment.path is None:
            return segment.pose is not None
        u = segment.share(time)
        return (u < LEFT and not segment.free_start) or (u > COMING and not segment.free_end)

    @property
    def blocked(self) -> tuple[tuple[Limb, int], ...]:
        """Limb and transition of each path for which no clear way was found."""
        return self._swings(lambda path: not path.clear)

    @property
    def folded(self) -> tuple[tuple[Limb, int], ...]:
        """Limb and transition of each path on which the leg would have to fold more than it can."""
        return self._swings(lambda path: not path.fits)

    def _swings(self, wanted: Callable[[SwingPath], bool]) -> tuple[tuple[Limb, int], ...]:
        return tuple(
            (Limb(limb), segment.transition)
            for limb, segments in enumerate(self.segments)
            for segment in segments
            if segment.path is not None and wanted(segment.path)
        )


def limb_paths(
    robot: RobotModel,
    world: World,
    schedule: ContactSchedule,
    motion: CentroidalMotion,
    foot_lift: float = LIFT,
) -> LimbPaths:
    """Paths of the limbs of a schedule, clear of the world's geometry where that is possible.

    Free palms hang relative to the CoM of the planned motion. Feet leave and reach their contacts straight along the
    normal over `foot_lift` m, which is scaled with the body. `LimbPaths.blocked` names the paths that are not clear.
    """
    collide = box_collide(world)
    segments: list[tuple[Segment, ...]] = []
    for limb in Limb:
        row = []
        for index, phase in enumerate(schedule.phases):
            contact = _contact(phase, limb)
            if contact is not None:
                row.append(Segment(phase.start, phase.end, phase.transition, pose=contact.pose))
            elif phase.swing == limb:
                row.append(_swing(robot, schedule, index, limb, motion, collide, foot_lift))
            else:
                row.append(Segment(phase.start, phase.end, phase.transition))
        segments.append(tuple(row))
    return LimbPaths(tuple(segments))


def box_collide(world: World) -> Collide:
    """The collision test of the world's geometry."""
    collider = BoxCollider(world)

    def collide(centers: np.ndarray, rotations: np.ndarray, half_sizes: np.ndarray) -> np.ndarray:
        poses = np.tile(np.eye(4), (len(centers), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = rotations, centers
        return collider.collide(poses, half_sizes)

    return collide


def _contact(phase: Phase, limb: Limb) -> Contact | None:
    return next((contact for contact in phase.contacts if contact.limb == limb), None)


def _swing(
    robot: RobotModel,
    schedule: ContactSchedule,
    index: int,
    limb: Limb,
    motion: CentroidalMotion,
    collide: Collide,
    foot_lift: float,
) -> Segment:
    """The segment of the limb that swings in phase `index`."""
    phases = schedule.phases
    phase = phases[index]
    old = _contact(phases[index - 1], limb) if index > 0 else None
    new = _contact(phases[index + 1], limb) if index + 1 < len(phases) else None
    if limb.is_foot and (old is None or new is None):
        raise ValueError(f"the schedule leaves {limb.label} without a contact before or after {phase.start:.2f} s")
    if new is None and old is None:
        return Segment(phase.start, phase.end, phase.transition)

    def free(neighbour: int, time: float) -> Pose:
        return free_palm(robot, limb, _feet(phases[neighbour]), motion.sample(time)[0])

    start = old.pose if old is not None else free(index - 1 if index > 0 else index, phase.start)
    end = new.pose if new is not None else free(min(index + 1, len(phases) - 1), phase.end)
    other, leg, shin, beside = None, None, np.zeros(3), None
    standing = _contact(phase, limb.mirrored) if limb.is_foot else None
    if standing is not None:
        other = standing.pose, robot.half_sizes[limb.mirrored]
        shin[:2] = robot.legs[limb.mirrored].ankle_in_sole[2] * standing.pose.normal[:2]
        u = np.linspace(0.0, 1.0, SAMPLES)
        com = np.array([motion.sample(phase.start + share * phase.duration)[0] for share in u])
        leg = SwingingLeg(robot.legs[limb], u, com, standing.pose.yaw, robot.scale.length * SPARE)
        beside = _standing_leg(robot, standing, com, start.yaw + u * wrapped(end.yaw - start.yaw))
    free_start, free_end = old is None, new is None
    size, scale = robot.half_sizes[limb], robot.scale
    lift = scale.length * (foot_lift if limb.is_foot else LIFT)
    ends = start, end, size, limb.is_foot, limb.outward, free_start, free_end
    task = SwingTask(phase.start, phase.duration, *ends, other, leg, lift, scale, robot.passing_gap, shin, beside)
    return Segment(phase.start, phase.end, phase.transition, None, plan_swing(task, collide), free_start, free_end)


def _standing_leg(robot: RobotModel, standing: Contact, com: np.ndarray, yaw: np.ndarray) -> StandingLeg:
    """The leg on a contact, for CoMs (k, 3) m and headings (k,) rad of the other foot."""
    count, pose = len(com), standing.pose
    position, rotation = np.tile(pose.position, (count, 1)), np.tile(pose.rotation, (count, 1, 1))
    posture = leg_posture(robot.legs[standing.limb], com, mean_heading(pose.yaw, yaw), position, rotation)
    return StandingLeg(leg_points(posture), robot.leg_radii[::-1])


def _feet(phase: Phase) -> Pose:
    """Upright frame at the mean of the feet of a phase with both feet in contact."""
    return Stance(tuple(contact for contact in phase.contacts if contact.limb.is_foot)).mean_feet


def free_palm(robot: RobotModel, limb: Limb, feet: Pose, com: np.ndarray) -> Pose:
    """Pose of a palm that hangs in the home posture, for a CoM (3,) m and the upright frame of the mean feet."""
    data = mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(robot.mujoco_model, data)
    mujoco.mj_comPos(robot.mujoco_model, data)
    site = data.site(robot.limbs[limb].site)
    home = Pose(site.xmat.reshape(3, 3).copy(), site.xpos.copy())
    placed = feet @ home
    return Pose(placed.rotation, placed.position + com - feet @ data.subtree_com[0])
