"""Each check passes on a good walk and fails on a broken input, with a reason that names what is wrong."""

import dataclasses

import mujoco
import numpy as np
import pytest

from tests.wholebody.conftest import world_of
from toolkit.contacts.failure import Failure
from toolkit.geometry.limb import Limb
from toolkit.wholebody.check import check
from toolkit.wholebody.collision import first_collision
from toolkit.wholebody.motion_dynamics import contact_wrenches, inverse_dynamics
from toolkit.wholebody.plan import _joined, whole_body
from toolkit.world.scene import compose_scene


@pytest.fixture(scope="module")
def good(robot, flat_walk):
    plan = whole_body(flat_walk, compose_scene(robot, flat_walk.world))
    return plan.paths, plan.trajectory.times, plan.trajectory.qpos


def reasons(robot, walk, good, *, world=None, qpos=None, paths=None):
    kept, times, states = good
    scene = compose_scene(robot, world or walk.world)
    report = check(robot, scene, paths or kept, walk.motion, times, states if qpos is None else qpos)
    return report, "; ".join(finding.reason for finding in report.findings)


def test_good_walk_passes(robot, flat_walk, good):
    report, text = reasons(robot, flat_walk, good)
    assert text == "" and report.limits_respected


@pytest.mark.parametrize(
    ("field", "factor", "word"), [("torque_limit", 0.02, "N m"), ("velocity_limit", 0.02, "rad/s")]
)
def test_shrunk_limits_fail(robot, flat_walk, good, field, factor, word):
    weak = dataclasses.replace(robot, **{field: factor * getattr(robot, field)})
    report, text = reasons(weak, flat_walk, good)
    assert not report.limits_respected
    assert any(f"joint {name} " in text for name in robot.joint_names) and word in text and "limit" in text
    assert all(finding.too_fast for finding in report.findings)


def test_a_narrow_joint_range_fails(robot, flat_walk, good):
    joint = int(np.argmax(np.ptp(good[2][:, 7:], axis=0)))
    upper = robot.upper.copy()
    upper[joint] = good[2][:, 7 + joint].max() - 0.01
    report, text = reasons(dataclasses.replace(robot, upper=upper), flat_walk, good)
    assert not report.limits_respected and f"joint {robot.joint_names[joint]} is at" in text
    assert not any(finding.too_fast for finding in report.findings)


def test_a_trunk_that_is_thrown_about_fails(robot, flat_walk, good):
    """The trunk keeps to its torque; a free arm may ask for a little more for a moment."""
    trunk, arm = np.flatnonzero(robot.trunk_joints), robot.arm_sides[Limb.LEFT_PALM]
    torque = np.abs(reasons(robot, flat_walk, good)[0].torque).max(0)
    for joints, part, passes in ((trunk, 0.9, False), (arm, 0.6, True), (arm, 0.4, False)):
        limit = robot.torque_limit.copy()
        limit[joints] = part * torque[joints]
        report, text = reasons(dataclasses.replace(robot, torque_limit=limit), flat_walk, good)
        assert report.limits_respected == passes, text


@pytest.mark.parametrize(("shift", "expected"), [((0.03, 0, 0), "the CoM"), ((0, 0, 0.006), "left_foot")])
def test_a_shifted_body_fails(robot, flat_walk, good, shift, expected):
    qpos = good[2].copy()
    qpos[:, :3] += shift
    report, text = reasons(robot, flat_walk, good, qpos=qpos)
    assert f"{expected} is" in text and "off its plan" in text
    assert report.max_position_error == pytest.approx(np.linalg.norm(shift), rel=0.1)


def test_a_tilted_sole_fails(robot, flat_walk, good):
    model = robot.mujoco_model
    last = model.body_jntadr[model.body(robot.limbs[Limb.LEFT_FOOT].body).id]
    qpos = good[2].copy()
    qpos[20, model.jnt_qposadr[last]] += 0.05  # while both feet stand
    report, text = reasons(robot, flat_walk, good, qpos=qpos)
    assert "left_foot is 0.05 rad off its plan" in text
    assert report.max_orientation_error == pytest.approx(0.05, rel=0.05)


def test_a_wall_in_the_way_collides(robot, flat_walk, good):
    world = world_of(f'<geom name="post" type="box" size="0.05 2 2" pos="{0.5 * robot.com_height} 0 2"/>')
    _, text = reasons(robot, flat_walk, good, world=world)
    assert "world/post" in text and "collide at" in text


def test_a_low_ceiling_collides(robot, flat_walk, good):
    model, data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = good[2][0]
    mujoco.mj_forward(model, data)
    top = data.geom_xpos[model.geom_contype != 0, 2].max()
    world = world_of(f'<geom name="ceiling" type="box" size="3 3 0.05" pos="0 0 {top + 0.03}"/>')
    _, text = reasons(robot, flat_walk, good, world=world)
    assert "world/ceiling" in text


def test_soles_may_rest_but_not_sink(robot, flat_walk, good):
    _, times, states = good
    for depth, expected in ((0.003, ""), (0.006, "world/floor")):
        qpos = states.copy()
        qpos[:, 2] -= depth
        hit = first_collision(robot, compose_scene(robot, flat_walk.world), times, qpos)
        assert (hit is None) if expected == "" else (hit is not None and expected in hit.reason and hit.time == 0.0)
        assert hit is None or hit.at_any_pace


def test_folding_the_body_into_itself_collides(robot, flat_walk, good):
    """Some posture with all joints at random collides; none is missed because the robot was at home before."""
    _, times, states = good
    rng, qpos = np.random.default_rng(0), states.copy()
    qpos[:, 2] += 2.0  # off the ground
    qpos[:, 7:] = rng.uniform(robot.lower, robot.upper, size=qpos[:, 7:].shape)
    hit = first_collision(robot, compose_scene(robot, flat_walk.world), times, qpos)
    assert hit is not None and "collide at" in hit.reason and not hit.at_any_pace


def test_not_a_number_fails(robot, flat_walk, good):
    qpos = good[2].copy()
    qpos[20, 9] = np.nan
    report, text = reasons(robot, flat_walk, good, qpos=qpos)
    assert text and not report.limits_respected and report.max_position_error == np.inf


def test_a_link_in_the_world_is_to_blame_rather_than_joints_that_turn_too_hard(flat_walk):
    hard, touch, off = Failure("hard", 2.0, too_fast=True), Failure("in", 1.0, at_any_pace=True), Failure("off", 0.5)

    def joined(*findings, blocked=(), folded=()):
        return _joined(blocked, folded, findings, flat_walk.schedule)

    both = joined(hard, touch)
    assert (both.reason, both.time, both.too_fast, both.at_any_pace) == ("hard; in", 1.0, False, True)
    assert joined(hard).too_fast and not joined(hard).at_any_pace
    assert joined(off, hard, touch).time == 0.5 and not joined(off, hard, touch).at_any_pace
    palm, foot = Failure("palm", 3.0, at_any_pace=True), Failure("foot", 3.0)
    assert joined(off, blocked=[palm]).at_any_pace and joined(touch, blocked=[palm]).time == 3.0
    assert not joined(touch, blocked=[foot]).at_any_pace
    assert joined() is None


def test_a_leg_that_cannot_fold_so_much_is_to_blame_for_what_else_was_found(flat_walk):
    swings = [phase for phase in flat_walk.schedule.phases if phase.swing is not None]
    begin, other = swings[0].start, swings[1].start
    leg, touch, foot = Failure("leg", begin), Failure("in", begin + 0.1, at_any_pace=True), Failure("foot", other)
    found = _joined([], [leg], [touch], flat_walk.schedule)
    assert found is not None and (found.reason, found.time, found.at_any_pace) == ("leg; in", begin, False)
    blocked = _joined([foot], [leg], [touch], flat_walk.schedule)
    assert blocked is not None and blocked.time == other
    elsewhere = _joined([], [dataclasses.replace(leg, time=other)], [touch], flat_walk.schedule)
    assert elsewhere == dataclasses.replace(touch, transition=swings[0].transition)
    assert _joined([], [leg], [], flat_walk.schedule) is None  # the base gave way, and nothing was wrong


def test_a_blocked_swing_is_reported(robot, flat_walk):
    world = world_of('<geom name="slab" type="box" size="0.01 1 1" pos="0.17 0 1"/>')
    trajectory = whole_body(dataclasses.replace(flat_walk, world=world), compose_scene(robot, world)).trajectory
    assert not trajectory.feasible and trajectory.failure is not None
    assert "finds no way clear of the world in transition 0" in trajectory.failure.reason
    assert trajectory.failure.transition == 0 and trajectory.failure.time == flat_walk.schedule.phases[1].start
    assert not trajectory.failure.at_any_pace  # a foot finds other ways at other paces


def test_planned_forces_carry_the_weight(robot, flat_walk, good):
    """No force is left at the base where the posture follows the planned CoM."""
    _, times, states = good
    residual = inverse_dynamics(robot, flat_walk.motion, times, states)
    weight = robot.mass * 9.81
    middle = len(times) - 10  # within the last rest
    np.testing.assert_allclose(residual[middle, :3], 0.0, atol=1e-3 * weight)
    wrench = contact_wrenches(flat_walk.motion, times, times[1])
    np.testing.assert_allclose(wrench[middle, :, 2].sum(), weight, atol=1e-3 * weight)


def test_wrenches_are_averaged_over_a_knot(flat_walk):
    """Exactly at a knot half of both neighbours' wrenches counts."""
    knots = flat_walk.motion.problem.times
    force = contact_wrenches(flat_walk.motion, knots[1:2], 1e-3)[0, :, :3]
    np.testing.assert_allclose(force, 0.5 * (flat_walk.motion.force[0] + flat_walk.motion.force[1]))
