"""Random contact transitions of every category, and walks, for tests and benchmarks of the solvers.

Contacts are tilted within 20 degrees, palms rest on walls beside the robot, CoM and velocity vary around plausible
values, widely enough that both labels of feasibility occur. Training data come from the planner instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.category import Category, category_of
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose, rotation_about_z, rotation_on_surface
from toolkit.robot.model import RobotModel
from toolkit.world.timing import Timing


@dataclass(frozen=True)
class SamplingConfig:
    """Ranges of the samples.

    Attributes:
        tilt: rad; largest angle of a surface from horizontal (feet) or from a side wall (palms).
        friction: lower and upper coefficient.
        shift, swing: s; ranges of the timing.
        com_spread: (3,) m; standard deviation of the CoM around home height above the mean feet.
        speed_spread: m/s; standard deviation of each horizontal component (vertical: a third) of the fast half of the
            samples; a tenth of it in the slow half.
        step_spread: factor on the range of a moved foot's place; 1 stays within what legs can usually reach.
    """

    tilt: float = math.radians(20)
    friction: tuple[float, float] = (0.5, 0.5)
    shift: tuple[float, float] = (1.0, 1.0)
    swing: tuple[float, float] = (1.0, 1.0)
    com_spread: tuple[float, float, float] = (0.06, 0.05, 0.03)
    speed_spread: float = 2.0
    step_spread: float = 1.6


@dataclass(frozen=True)
class TransitionSample:
    """A transition from a state.

    Attributes:
        stance: before the transition.
        com: (3,) m.
        com_velocity: (3,) m/s.
        transition: what happens.
    """

    stance: Stance
    com: np.ndarray
    com_velocity: np.ndarray
    transition: ContactTransition


def sample_transition(
    robot: RobotModel, category: Category, rng: np.random.Generator, config: SamplingConfig | None = None
) -> TransitionSample:
    """A random transition of a category, anywhere in the world and with any heading.

    Args:
        robot: its patches, reach and home height set the scale.
        category: the category that the transition has.
        rng: randomness.
        config: ranges.
    """
    config = config or SamplingConfig()
    friction = rng.uniform(*config.friction)
    timing = Timing(rng.uniform(*config.shift), rng.uniform(*config.swing))
    world_from_feet = Pose.from_yaw(rng.uniform([-5, -5, -1], [5, 5, 2]), rng.uniform(-math.pi, math.pi))
    spacing = 2 * abs(robot.legs[Limb.LEFT_FOOT].hip_in_com[1])
    forward = rng.uniform(-0.2, 0.2)
    contacts = []
    for foot in FEET:
        side = 1 if foot.is_left else -1
        place = np.array([side * forward / 2, side * rng.uniform(0.5, 0.9) * spacing, rng.uniform(-0.05, 0.05)])
        contacts.append(_foot(foot, world_from_feet, place, rng.uniform(-0.35, 0.35), friction, rng, config))
    stance = Stance(tuple(contacts))
    palms = [Limb.LEFT_PALM, Limb.RIGHT_PALM] if rng.random() < 0.5 else [Limb.RIGHT_PALM, Limb.LEFT_PALM]
    for palm in palms[: category.palms_before]:
        stance = stance.replace(_palm(robot, palm, stance.mean_feet, friction, rng, config))

    transition = _transition(robot, stance, category, palms, timing, friction, rng, config)
    if category_of(stance, transition) != category:
        raise AssertionError(f"sampled {category_of(stance, transition)!r} instead of {category!r}")
    world_from_mean = stance.mean_feet
    home = np.array([0.0, 0.0, robot.com_height])
    offset = home
    for _ in range(20):  # most states that the limbs cannot reach say nothing about dynamics
        offset = home + rng.normal(size=3) * config.com_spread
        if _within_reach(robot, stance, world_from_mean, offset):
            break
    speed = config.speed_spread * (1.0 if rng.random() < 0.5 else 0.1)
    velocity = world_from_mean.rotation @ (rng.normal(size=3) * np.array([1.0, 1.0, 1 / 3]) * speed)
    return TransitionSample(stance, world_from_mean @ offset, velocity, transition)


def _within_reach(robot, stance, world_from_mean, offset) -> bool:
    """Whether every limb reaches its contact from a CoM given in the frame of the mean feet."""
    for contact in stance.contacts:
        if contact.limb.is_foot:
            leg = robot.legs[contact.limb]
            root, tip, reach = leg.hip_in_com, leg.ankle_in_sole, leg.max_length
        else:
            arm = robot.arms[contact.limb]
            root, tip, reach = arm.shoulder_in_com, np.zeros(3), arm.max_reach
        if np.linalg.norm(world_from_mean @ (offset + root) - contact.pose @ tip) > reach:
            return False
    return True


def _transition(robot, stance, category, palms, timing, friction, rng, config) -> ContactTransition:
    """What moves, by category."""
    if not category.moving.is_foot:
        palm = palms[0 if category.moving in category.before else category.palms_before]
        contact = _palm(robot, palm, stance.mean_feet, friction, rng, config) if category.makes else None
        return ContactTransition(palm, contact, timing)
    foot = FEET[int(rng.integers(len(FEET)))]
    if category.palms_before == 1:
        inner = FEET[0] if palms[0].is_left else FEET[1]
        foot = inner if category.moving.is_left == category.before[-1].is_left else inner.mirrored
    standing = stance[foot.mirrored].pose
    world_from_standing = Pose.from_yaw(standing.position, standing.yaw)
    side = 1 if foot.is_left else -1
    place = np.array([rng.uniform(-0.3, 0.5), side * rng.uniform(0.15, 0.4), rng.uniform(-0.15, 0.15)])
    place *= config.step_spread
    contact = _foot(foot, world_from_standing, place, side * rng.uniform(-0.3, 0.5), friction, rng, config)
    return ContactTransition(foot, contact, timing)


def _foot(limb, world_from_frame, place, yaw, friction, rng, config) -> Contact:
    """A foot at a place and yaw in an upright frame, on a tilted surface."""
    tilt, azimuth = config.tilt * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
    normal = np.array([math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)])
    rotation = rotation_on_surface(normal, world_from_frame.yaw + yaw)
    return Contact(limb, Pose(rotation, world_from_frame @ place), friction)


def _palm(robot, limb, world_from_feet, friction, rng, config) -> Contact:
    """A palm on a wall beside the robot, around the reach of the arm."""
    arm, side = robot.arms[limb], 1 if limb.is_left else -1
    ahead, up = math.radians(rng.uniform(-10, 60)), math.radians(rng.uniform(-20, 20))
    ray = np.array([math.sin(ahead) * math.cos(up), side * math.cos(ahead) * math.cos(up), math.sin(up)])
    shoulder = arm.shoulder_in_com + np.array([0.0, 0.0, robot.com_height])
    place = shoulder + rng.uniform(0.5 * arm.max_reach, 1.05 * arm.max_reach) * ray
    # Normal: towards the robot, turned about the vertical and tilted.
    turn, tilt = rng.uniform(-config.tilt, config.tilt, 2)
    normal = rotation_about_z(turn) @ np.array([0.0, -side * math.cos(tilt), math.sin(tilt)])
    up_in_wall = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    up_in_wall /= np.linalg.norm(up_in_wall)
    rotation = np.column_stack([up_in_wall, np.cross(normal, up_in_wall), normal])
    return Contact(limb, Pose(world_from_feet.rotation @ rotation, world_from_feet @ place), friction)


def sample_walk(
    robot: RobotModel,
    contacts: int,
    rng: np.random.Generator,
    *,
    timing: Timing | None = None,
    tilt: float = math.radians(10),
    friction: float = 0.5,
) -> ContactSequence:
    """A random walk ahead over tilted stones, one foot after the other.

    Args:
        robot: strides are in proportion to its legs.
        contacts: number of transitions.
        rng: randomness.
        timing: of every transition; the default timing where None.
        tilt: rad; largest tilt of a stone.
        friction: of the stones.
    """
    config = SamplingConfig(tilt=tilt)
    length = robot.legs[Limb.LEFT_FOOT].max_length

    def stone(foot: Limb, x: float) -> Contact:
        place = np.array([x, 1.15 * robot.legs[foot].hip_in_com[1] + 0.01 * rng.normal(), rng.uniform(-0.03, 0.03)])
        return _foot(foot, Pose.identity(), place, rng.uniform(-0.15, 0.15), friction, rng, config)

    start = Stance(tuple(stone(foot, 0.0) for foot in FEET))
    transitions, x = [], 0.0
    for index in range(contacts):
        x += rng.uniform(0.15, 0.35) * length * (0.5 if index == 0 else 1.0)
        foot = FEET[index % 2]
        transitions.append(ContactTransition(foot, stone(foot, x), timing or Timing()))
    return ContactSequence(start, tuple(transitions))
