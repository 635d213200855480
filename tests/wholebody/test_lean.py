"""Leaning ahead: the base turns early and smoothly to where it had to turn in a hurry."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from toolkit.contacts.failure import Failure
from toolkit.geometry.pose import Pose, rotation_exponential
from toolkit.wholebody import plan as wholebody
from toolkit.wholebody.avoidance import BODY, CLOSE
from toolkit.wholebody.check import CheckReport
from toolkit.wholebody.ik import WholeBodyIK, momentum_at
from toolkit.wholebody.lean import AROUND, WORTH, Lean, lean_ahead
from toolkit.wholebody.limb_paths import limb_paths
from toolkit.wholebody.plan import LEVEL, Manner, solve_ik, whole_body
from toolkit.world.scene import compose_scene

USUAL = Manner()


@pytest.fixture
def paths(robot, flat_walk):
    return limb_paths(robot, flat_walk.world, flat_walk.schedule, flat_walk.motion)


def postures(robot, paths, times, turn):
    """The home posture at every time, its base turned by rotation vectors (T, 3) from the heading of the feet."""
    result = np.tile(robot.home, (len(times), 1))
    for row, (time, vector) in enumerate(zip(times, turn, strict=True)):
        rotation = paths.mean_feet(time).rotation @ rotation_exponential(vector)
        result[row, 3:7] = Pose(rotation, np.zeros(3)).quaternion_wxyz
    return result


def test_a_hurried_turn_is_begun_early_and_reached_in_full(robot, paths):
    times = np.linspace(0.0, 2.0, 101)
    turn = np.zeros((101, 3))
    turn[50:53, 1] = 0.3
    lean = lean_ahead(paths, times, postures(robot, paths, times, turn))
    assert lean is not None
    np.testing.assert_allclose(lean.at(1.02), [0.0, 0.3, 0.0], atol=1e-6)
    assert lean.at(1.0 - AROUND)[1] > 0.1 and lean.at(1.0 - 2.1 * AROUND)[1] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(np.diff(lean.turn[:, 1])).max() < 0.3 / 10  # spread over many samples


def test_a_lean_that_was_not_enough_goes_as_far_again(robot, paths):
    """The base had to turn by another 0.1 rad beyond a lean of 0.2 rad."""
    times = np.linspace(0.0, 2.0, 101)
    turn = np.tile([0.0, 0.3, 0.0], (101, 1))
    before = Lean(times, np.tile([0.0, 0.2, 0.0], (101, 1)))
    lean = lean_ahead(paths, times, postures(robot, paths, times, turn), before=before)
    assert lean is not None
    np.testing.assert_allclose(lean.turn, np.tile([0.0, 0.4, 0.0], (101, 1)), atol=1e-9)


def test_a_base_that_hardly_turns_leans_enough(robot, paths):
    times = np.linspace(0.0, 1.0, 51)
    turn = np.zeros((51, 3))
    turn[20:, 2] = 0.9 * WORTH
    assert lean_ahead(paths, times, postures(robot, paths, times, turn)) is None


def test_the_base_follows_the_wanted_lean(robot, flat_walk, paths):
    times = np.linspace(0.0, 1.0, 51)
    turn = np.zeros((51, 3))
    turn[:, 2] = 0.1
    lean = lean_ahead(paths, times, postures(robot, paths, times, turn))
    qpos = solve_ik(robot, paths, flat_walk.motion, times, lean=lean)
    base = Pose.from_quaternion(qpos[-1, :3], qpos[-1, 3:7]).rotation
    expected = paths.mean_feet(1.0).rotation @ rotation_exponential(turn[-1])
    np.testing.assert_allclose(base, expected, atol=0.02)  # a weak task among stronger ones


def test_passes_end_with_the_first_that_holds(robot, flat_walk, monkeypatch):
    """A failing check is answered by passes with a lean, and by one that keeps less distance; a passing one is not."""
    scene, passes = compose_scene(robot, flat_walk.world), []

    def solved(robot, paths, motion, times, scene=None, lean=None, manner=USUAL, ahead=None):
        passes.append((lean is not None, manner.links))
        early.append(ahead is not None)
        return solve_ik(robot, paths, motion, times, scene, lean, manner)

    early = []
    monkeypatch.setattr(wholebody, "solve_ik", solved)
    assert whole_body(flat_walk, scene).trajectory.feasible and passes == [(False, BODY)]
    passes.clear()
    monkeypatch.setattr("toolkit.wholebody.check.COM_ERROR", 0.0)
    monkeypatch.setattr("toolkit.wholebody.lean.WORTH", 0.0)
    assert not whole_body(flat_walk, scene).trajectory.feasible
    assert passes == [(False, BODY), *(wholebody.PASSES - 1) * [(True, BODY)], (False, CLOSE)]
    passes.clear()
    with monkeypatch.context() as patch:
        touch = CheckReport(0.0, 0.0, np.zeros(0), True, (Failure("an arm touches a wall", 0.5, at_any_pace=True),))
        patch.setattr(wholebody, "check", lambda *_: touch)
        whole_body(flat_walk, scene)
        assert passes == [(False, BODY), *(wholebody.PASSES - 2) * [(True, BODY)], (False, CLOSE)]
    passes.clear()
    monkeypatch.setattr("toolkit.wholebody.lean.WORTH", np.inf)  # no lean is worth it
    whole_body(flat_walk, scene)
    assert passes == [(False, BODY), (False, CLOSE)] and not any(early)
    passes.clear()
    early.clear()
    monkeypatch.setattr(wholebody, "ArmsAhead", lambda *_: SimpleNamespace(touch=True))
    whole_body(flat_walk, scene)
    assert passes == [(False, BODY), (False, BODY), (False, CLOSE)] and early == [False, True, True]


def test_trunk_and_arms_turn_against_the_swinging_leg_where_that_is_wanted(robot, flat_walk, paths):
    """The angular momentum about the vertical comes nearer to the plan's with a larger weight."""
    times = np.linspace(0.0, flat_walk.schedule.duration, int(50 * flat_walk.schedule.duration) + 1)
    model, data, errors = robot.mujoco_model, mujoco.MjData(robot.mujoco_model), []
    for manner in (USUAL, LEVEL):
        qpos = solve_ik(robot, paths, flat_walk.motion, times, manner=manner)
        spin = []
        for before, after, time in zip(qpos[:-1], qpos[1:], times[1:], strict=True):
            mujoco.mj_differentiatePos(model, data.qvel, times[1], before, after)
            data.qpos[:] = after
            mujoco.mj_forward(model, data)
            mujoco.mj_subtreeVel(model, data)
            spin.append(data.subtree_angmom[1, 2] - momentum_at(flat_walk.motion, time)[2])
        errors.append(np.linalg.norm(spin))
    assert errors[1] < 0.7 * errors[0]


def test_the_base_turns_to_a_lean_without_rocking(robot, flat_walk, paths):
    tick, wanted = 0.01, 0.1
    ik = WholeBodyIK(robot, tick)
    ik.start(robot.home, paths, flat_walk.motion)
    ik.lean = Lean(np.array([0.0, 1.0]), np.tile([0.0, wanted, 0.0], (2, 1)))
    pitch = []
    for _ in range(200):
        rotation = Pose.from_quaternion(np.zeros(3), ik.advance(0.0, paths, flat_walk.motion)[3:7]).rotation
        pitch.append(np.arcsin(-rotation[2, 0]))
    assert max(pitch) < 1.2 * wanted
    np.testing.assert_allclose(pitch[100:], wanted, atol=0.02 * wanted)
