"""A walk over flat ground with more steps than it needs, and the screens of a search there."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from tests.search.worlds import FLOOR, make_world
from tests.shipped_robots import OWN
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.pipeline.planner import make_planner
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner_config import PlannerConfig
from toolkit.search.sequence_screen import SequenceScreen
from toolkit.world.world import World

PALM = Limb.LEFT_PALM


class Walk(NamedTuple):
    """A sequence and where it walks."""

    robot: RobotModel
    world: World
    screen: SequenceScreen
    sequence: ContactSequence


def steps(start, count, stride):
    """Feet that go on by turns, the left one first, by `stride` m each and half of it at first and in the end."""
    transitions, x = [], {limb: start[limb].pose.position[0] for limb in FEET}
    timing_of = make_world(FLOOR, timing="0.4 0.6").timing
    for index in range(count):
        limb = Limb(index % 2)
        x[limb] += stride / 2 if index in (0, count - 1) else stride
        old = start[limb]
        place = np.array([x[limb], *old.pose.position[1:]])
        contact = Contact(limb, Pose(old.pose.rotation, place), old.friction, old.surface)
        transitions.append(ContactTransition(limb, contact, timing_of))
    return ContactSequence(start, tuple(transitions))


@pytest.fixture(scope="session")
def walk():
    """Eight small steps over 0.7 m."""
    robot = load_robot(OWN[0])
    world = make_world(FLOOR, goal=(0.7, 0, 0), radius=0.15, timing="0.4 0.6")
    config = PlannerConfig(search=AnaStarConfig(max_expansions=20))
    planner = make_planner(robot, world, "kinematic", config)
    search = planner.search(np.random.default_rng(0), 600.0)
    assert search.screen is not None
    sequence = steps(planner.ground.start_stance(), 8, 0.2)
    assert search.screen.passes(sequence)
    return Walk(robot, world, search.screen, sequence)


@pytest.fixture
def leaning(walk):
    """The walk with two touches of a palm, of which the first moves once."""
    pose = walk.sequence.start[Limb.LEFT_FOOT].pose

    def touch(height):
        place = Pose(pose.rotation, pose.position + [0.0, 0.5, height])
        return ContactTransition(PALM, Contact(PALM, place, 0.7, 0), walk.world.timing)

    release = ContactTransition(PALM, None, walk.world.timing)
    a, b, c, d, *_ = walk.sequence.transitions
    return replace(walk.sequence, transitions=(touch(1.0), a, touch(1.1), b, release, c, touch(1.2), d))
