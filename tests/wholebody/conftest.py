"""A statically balanced walk on any terrain, made by hand: the whole-body stage needs no optimiser to be tested."""

import mujoco
import numpy as np
import pytest

from tests.shipped_robots import OWN
from toolkit.centroidal.build import ProblemConfig, initial_com, sequence_problem
from toolkit.centroidal.plan import MotionPlan
from toolkit.centroidal.problem import GRAVITY, CentroidalMotion
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.loader import load_robot
from toolkit.wholebody.limb_paths import free_palm
from toolkit.world.loader import load_world
from toolkit.world.timing import Timing
from toolkit.world.world import World

ROBOTS = OWN
RISE = 0.10  # m, of a stair
TREAD = 0.34  # m, deep enough for the longest sole and a margin on both sides
FIRST = 0.15  # m, where the stairs begin


@pytest.fixture(scope="session", params=ROBOTS)
def robot(request):
    return load_robot(request.param)


def world_of(geoms: str) -> World:
    """A world in memory: a floor, the given geoms, a start and a far goal."""
    return load_world(
        "test.xml",
        mjcf=f"""<mujoco><worldbody><geom name="floor" type="plane" size="5 5 0.1" friction="0.8"/>{geoms}
        <site name="start" pos="0 0 0"/><site name="goal" type="cylinder" pos="2 0 0" size="0.2 0.1"/>
        </worldbody></mujoco>""",
    )


def stairs(count: int) -> str:
    """Boxes of a stair that ascends along x, each under all the later ones."""
    boxes = []
    for index in range(count):
        begin, end = FIRST + index * TREAD, 4.0
        boxes.append(
            f'<geom name="step{index}" type="box" friction="0.8" size="{(end - begin) / 2} 1 {RISE / 2}" '
            f'pos="{(begin + end) / 2} 0 {RISE * (index + 0.5)}"/>'
        )
    return "".join(boxes)


def stair_height(x: float, count: int) -> float:
    return RISE * min(max(int(np.floor((x - FIRST) / TREAD)) + 1, 0), count)


def foot_contact(robot, limb: Limb, x: float, height: float) -> Contact:
    side = robot.legs[limb].hip_in_com[1]
    return Contact(limb, Pose.from_yaw(np.array([x, side, height]), 0.0), 0.8, 0)


def planned_walk(robot, world: World, moves, height=lambda x: 0.0) -> MotionPlan:
    """A balanced walk of (limb, x of a foot, palm contact, or None) moves from a stance at x = 0."""
    start = Stance(tuple(foot_contact(robot, foot, 0.0, height(0.0)) for foot in FEET))
    transitions, timing = [], Timing(0.8, 0.8)
    for limb, target in moves:
        contact = foot_contact(robot, limb, target, height(target)) if limb.is_foot else target
        transitions.append(ContactTransition(limb, contact, timing))
    sequence = ContactSequence(start, tuple(transitions))
    schedule = ContactSchedule.of(sequence, final_rest=0.8)
    return MotionPlan(robot, world, sequence, schedule, balanced(robot, schedule))


def balanced(robot, schedule: ContactSchedule) -> CentroidalMotion:
    """The CoM goes from above one foot to above the other while shifting, and waits there while the other swings."""
    com = initial_com(robot, Stance(schedule.phases[0].contacts)) - np.array([0.0, 0.0, 0.1 * robot.com_height])
    low = com[2]
    problem = sequence_problem(robot, schedule, com, np.zeros(3), config=ProblemConfig(steps=2, max_dt=10.0))
    steps = problem.steps
    assert steps == 2 * len(schedule.phases)
    place, velocity = np.empty((steps + 1, 3)), np.zeros((steps + 1, 3))
    force = np.zeros((steps, 4, 3))
    place[0] = com
    for index, phase in enumerate(schedule.phases):
        feet = {contact.limb: contact.pose.position for contact in phase.contacts if contact.limb.is_foot}
        target = place[2 * index]
        if phase.swing is None:
            swings = schedule.phases[index + 1].swing if index + 1 < len(schedule.phases) else None
            target = np.mean(list(feet.values()), 0)
            target[2] += low
            if swings is not None and swings.is_foot:
                target[:2] = feet[swings.mirrored][:2]
        half = phase.duration / 2
        push = (target - place[2 * index]) / half**2
        for step, acceleration in ((2 * index, push), (2 * index + 1, -push)):
            place[step + 1] = place[step] + half * velocity[step] + half**2 / 2 * acceleration
            velocity[step + 1] = velocity[step] + half * acceleration
            total = robot.mass * (acceleration - GRAVITY)
            middle = 0.5 * (place[step] + place[step + 1])
            for foot, share in _shares(feet, middle).items():
                force[step, foot] = share * total
    return CentroidalMotion(
        problem, True, "by hand", place, robot.mass * velocity, np.zeros_like(place), force, np.zeros((steps, 4, 2)),
        np.zeros((steps, 4)), 0.0, 0.0, 0,
    )  # fmt: skip


def _shares(feet: dict[Limb, np.ndarray], com: np.ndarray) -> dict[Limb, float]:
    if len(feet) == 1:
        return dict.fromkeys(feet, 1.0)
    left, right = feet[Limb.LEFT_FOOT], feet[Limb.RIGHT_FOOT]
    across = (left - right)[:2]
    share = float(np.clip((com - right)[:2] @ across / (across @ across), 0.0, 1.0))
    return {Limb.LEFT_FOOT: share, Limb.RIGHT_FOOT: 1.0 - share}


@pytest.fixture(scope="session")
def flat_walk(robot) -> MotionPlan:
    moves = [(Limb.LEFT_FOOT, 0.2), (Limb.RIGHT_FOOT, 0.35), (Limb.LEFT_FOOT, 0.35)]
    return planned_walk(robot, world_of(""), moves)


@pytest.fixture(scope="session")
def stair_walk(robot) -> MotionPlan:
    first, second = FIRST + TREAD / 2, FIRST + 1.5 * TREAD
    moves = [(Limb(foot), x) for x in (first, second) for foot in FEET]
    return planned_walk(robot, world_of(stairs(2)), moves, lambda x: stair_height(x, 2))


@pytest.fixture(scope="session")
def palm_walk(robot) -> MotionPlan:
    """A palm is put on a side wall, moved along it, and taken back."""
    if Limb.LEFT_PALM not in robot.arms:
        pytest.skip("a robot without palms")
    hang = free_palm(robot, Limb.LEFT_PALM, Pose.identity(), np.array([0.0, 0.0, robot.com_height])).position
    wall = hang + np.array([0.0, 0.25, 0.2]) * robot.com_height
    normal, up = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    rotation = np.stack([up, np.cross(normal, up), normal], 1)

    def touch(x: float) -> Contact:
        return Contact(Limb.LEFT_PALM, Pose(rotation, wall + np.array([x, 0.0, 0.0])), 0.8, 1)

    moves = [
        (Limb.LEFT_PALM, touch(0.0)),
        (Limb.RIGHT_FOOT, 0.1),
        (Limb.LEFT_PALM, touch(0.08)),
        (Limb.LEFT_FOOT, 0.1),
        (Limb.LEFT_PALM, None),
    ]
    geom = f'<geom name="wall" type="box" size="2 0.05 0.9" pos="0 {wall[1] + 0.05} 0.9" friction="0.8"/>'
    return planned_walk(robot, world_of(geom), moves)


@pytest.fixture
def hand(robot):
    if Limb.LEFT_PALM not in robot.limbs:
        pytest.skip("a robot without palms")
    data = mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_forward(robot.mujoco_model, data)
    return data.site(robot.limbs[Limb.LEFT_PALM].site).xpos.copy()
