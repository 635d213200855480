"""A flat world, a standing robot, a short walk, planned and executed once for all tests."""

from dataclasses import replace

import numpy as np
import pytest

from tests.shipped_robots import OWN
from toolkit.centroidal.build import initial_com
from toolkit.centroidal.plan import MotionPlan
from toolkit.centroidal.sequence import optimise
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.execution.run import execute
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.pipeline.observer import Observer
from toolkit.pipeline.warmup import warm_up
from toolkit.robot.loader import load_robot
from toolkit.wholebody.limb_paths import limb_paths
from toolkit.wholebody.plan import whole_body
from toolkit.world.loader import load_world
from toolkit.world.scene import compose_scene
from toolkit.world.timing import Timing

FRICTION = 0.7
FLAT = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" friction="{friction}"/>
    <site name="start" pos="0 0 0"/>
    <site name="goal" type="cylinder" pos="{goal} 0 0" size="0.1 0.01"/>
  </worldbody>
</mujoco>
"""


def pytest_sessionstart(session):
    """Where several processes test, compile the kernels of runs before each of them does."""
    if session.config.getoption("numprocesses", None):
        with warm_up(Observer()):
            pass


class Plan:
    """A plan and what it was made of; `pace` is a factor on the times at rest."""

    def __init__(self, robot, world, sequence, pace=1.0):
        self.robot, self.world, self.sequence = robot, world, sequence
        self.schedule = ContactSchedule.of(sequence, initial_rest=pace * 0.1, final_rest=pace * 0.4)
        self.motion = optimise(robot, self.schedule, initial_com(robot, sequence.start), np.zeros(3))
        assert self.motion.feasible, self.motion.outcome
        plan = MotionPlan(robot, world, sequence, self.schedule, self.motion)
        self.whole = whole_body(plan, compose_scene(robot, world))
        self.paths, self.trajectory = self.whole.paths, self.whole.trajectory

    def run(self, **options):
        return execute(self.whole, **options)

    def run_with(self, sequence, **options):
        """Run another sequence of the same timing with the same CoM and joints."""
        schedule = ContactSchedule.of(sequence, initial_rest=0.1, final_rest=0.4)
        paths = limb_paths(self.robot, self.world, schedule, self.motion)
        return execute(replace(self.whole, sequence=sequence, schedule=schedule, paths=paths), **options)


def sole(robot, limb, x=0.0):
    """The contact of a foot on the floor, as far to the side as in the home posture."""
    side = robot.legs[limb].hip_in_com[1]
    return Contact(limb, Pose(np.eye(3), np.array([x, side, 0.0])), FRICTION, 0)


def walk(robot, steps, length):
    """Steps of the feet in turn on flat ground; the last one closes up."""
    start = Stance(tuple(sole(robot, limb) for limb in FEET))
    transitions, x = [], 0.0
    for k in range(steps):
        limb = Limb(k % 2)
        x += length if k < steps - 1 else 0.0
        transitions.append(ContactTransition(limb, sole(robot, limb, x), Timing(0.4, 0.6)))
    return ContactSequence(start, tuple(transitions))


@pytest.fixture(scope="session")
def flat(tmp_path_factory):
    def make(goal):
        path = tmp_path_factory.mktemp("flat") / "flat.xml"
        path.write_text(FLAT.format(friction=FRICTION, goal=goal))
        return load_world(path)

    return make


@pytest.fixture(params=OWN, scope="session")
def robot(request):
    return load_robot(request.param)


@pytest.fixture(scope="session")
def standing(robot, flat):
    return Plan(robot, flat(0.0), walk(robot, 0, 0.0))


@pytest.fixture(scope="session")
def walking(robot, flat):
    length = 0.2 * robot.com_height
    return Plan(robot, flat(length), walk(robot, 2, length))


@pytest.fixture(scope="session")
def walked(walking):
    return walking.run()
