"""Which touches of a swing are scuffs, and that a run with a stumble fails."""

import dataclasses

import numpy as np
import pytest

from tests.conftest import FLAT, FRICTION, Plan, walk
from tests.fuzz.verdict_oracle import replayed
from toolkit.execution.check import Result
from toolkit.execution.config import SCUFF_LIMIT
from toolkit.execution.replay import difference, replay_run
from toolkit.execution.run import execute
from toolkit.execution.scuff import scuffs
from toolkit.execution.standard import Move
from toolkit.geometry.limb import Limb
from toolkit.world.loader import load_world
from toolkit.world.scene import compose_scene

STEP = 0.002
MOVE = Move(Limb.LEFT_FOOT, 1.0, 1.6, np.zeros(3))


def found(*touches, move=MOVE):
    """Scuffs of a foot that stands outside its swing, and in it touches with 100 N from a share of it to another."""
    times = STEP * np.arange(1000)
    force = np.zeros((1000, 4))
    force[(times < move.start) | (times >= move.end), move.limb] = 300.0
    for begin, end in touches:
        share = (times - move.start) / (move.end - move.start)
        force[(share >= begin) & (share < end), move.limb] = 100.0
    return scuffs((move,), force, STEP)


@pytest.mark.parametrize("touches", [(), [(0.0, 0.2)], [(0.6, 1.0)], [(0.0, 0.1), (0.13, 0.2), (0.7, 0.97)]])
def test_lift_off_and_touchdown_are_no_scuffs(touches):
    assert found(*touches) == ()


@pytest.mark.parametrize(
    ("touches", "seconds"),
    [
        ([(0.5, 0.51)], 0.006),  # a toe that hits an edge
        ([(0.0, 0.1), (0.2, 0.22)], 0.012),  # soon after lift-off
        ([(0.8, 0.82), (0.9, 1.0)], 0.012),  # shortly before touchdown
        ([(0.0, 0.35)], 0.06),  # dragged along
        ([(0.4, 1.0)], 0.06),  # meets the ground long before it should
        ([(0.0, 1.0)], 0.15),  # never lifted
    ],
)
def test_touches_between_are_measured(touches, seconds):
    (scuff,) = found(*touches)
    assert (scuff.transition, scuff.limb, scuff.peak) == (0, Limb.LEFT_FOOT, 100.0)
    assert scuff.duration == pytest.approx(seconds, abs=1.01 * STEP)
    assert scuff.impulse == pytest.approx(100.0 * scuff.duration)
    assert MOVE.start < scuff.time < MOVE.end


def test_a_palm_that_breaks_its_contact_may_not_touch_at_the_end():
    palm = Move(Limb.LEFT_PALM, 1.0, 1.6, None)
    assert found((0.0, 0.1), move=palm) == ()


@pytest.fixture(scope="module")
def striding(robot, flat):
    """A walk whose steps are longer than the soles."""
    length = 1.6 * 2.0 * robot.half_sizes[Limb.LEFT_FOOT][0]
    return Plan(robot, flat(length), walk(robot, 2, length))


def over_bar(striding, height):
    """The walk carried out where a thin bar of some height in m lies between both places of the first foot."""
    moved = striding.sequence.transitions[0].contact
    start = next(each for each in striding.sequence.start.contacts if each.limb == moved.limb)
    x, y = 0.5 * (start.pose.position + moved.pose.position)[:2]
    bar = f'<geom type="box" pos="{x} {y} {0.5 * height}" size="0.004 0.03 {0.5 * height}"/>'
    text = FLAT.format(friction=FRICTION, goal=moved.pose.position[0]).replace("</worldbody>", f"{bar}</worldbody>")
    world = load_world("bar.xml", mjcf=text)
    return execute(dataclasses.replace(striding.whole, scene=compose_scene(striding.robot, world)))


def test_a_foot_that_clears_the_bar_scuffs_nothing(striding):
    run = over_bar(striding, 0.02)
    assert run.failure is None and run.scuffs == () and run.max_scuff == run.max_scuff_impulse == 0.0


@pytest.mark.parametrize(("height", "passes"), [(0.035, True), (0.04, False)])
def test_a_graze_is_told_and_a_stumble_fails(striding, height, passes):
    """Without the check, the stumble would pass: the robot arrives, and nothing else exceeds its limit."""
    run = over_bar(striding, height)
    (scuff,) = run.scuffs
    assert scuff.limb == striding.sequence.transitions[0].limb and scuff.transition == 0
    assert (run.max_scuff_impulse, run.max_scuff_force) == (scuff.impulse, scuff.peak)
    assert run.max_scuff == pytest.approx(scuff.impulse / striding.robot.mass, rel=1e-6)
    assert (run.max_scuff <= SCUFF_LIMIT) == passes == (run.failure is None)
    failed = {check.name for check in run.checks if check.result is not Result.PASS}
    assert failed == (set() if passes else {"scuff"})
    if run.failure is not None:
        assert run.failure.reason.startswith("scuff is ") and run.failure.time == scuff.time
    again = replay_run(run)
    assert difference(run, again) == "" and again.scuffs == run.scuffs
    seen = replayed(run.scene, striding.robot, run.controls, striding.schedule)
    assert seen.scuff == pytest.approx(run.max_scuff, rel=1e-9)
