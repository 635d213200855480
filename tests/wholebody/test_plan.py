import dataclasses

import mujoco
import numpy as np
import pytest

from toolkit.control.sampled_plan import sample_reference
from toolkit.geometry.limb import FEET, Limb
from toolkit.wholebody.limb_paths import limb_paths
from toolkit.wholebody.plan import whole_body
from toolkit.world.scene import compose_scene


@pytest.fixture(scope="module", params=["flat_walk", "stair_walk", "palm_walk"])
def planned(request, robot):
    walk = request.getfixturevalue(request.param)
    return walk, whole_body(walk, compose_scene(robot, walk.world)).trajectory


@pytest.fixture(scope="module")
def palm_plan(robot, palm_walk):
    return whole_body(palm_walk, compose_scene(robot, palm_walk.world))


def palm_poses(robot, trajectory):
    """(T, 3) and (T, 9) place and rotation of the left palm in the postures of a trajectory."""
    data, site = mujoco.MjData(robot.mujoco_model), robot.limbs[Limb.LEFT_PALM].site
    poses = []
    for qpos in trajectory.qpos:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(robot.mujoco_model, data)
        poses.append((data.site(site).xpos.copy(), data.site(site).xmat.copy()))
    return map(np.array, zip(*poses, strict=True))


def test_walks_are_feasible(planned):
    _, trajectory = planned
    assert trajectory.reason == ""
    assert trajectory.feasible and trajectory.limits_respected
    assert trajectory.max_position_error < 2e-3  # m; far below the thresholds where nothing pulls at the joints' limits
    assert trajectory.max_orientation_error < 2e-3


def test_arrays_fit_and_the_grid_is_uniform(robot, planned):
    walk, trajectory = planned
    count, joints = len(trajectory.times), len(robot.joint_names)
    assert trajectory.qpos.shape == (count, 7 + joints) and trajectory.qvel.shape == (count, 6 + joints)
    assert trajectory.torque.shape == (count, joints)
    assert trajectory.limb_pose.shape == (count, 4, 7) and trajectory.limb_velocity.shape == (count, 4, 6)
    np.testing.assert_allclose(np.diff(trajectory.times), trajectory.times[1], rtol=1e-9)
    assert trajectory.times[-1] == pytest.approx(walk.schedule.duration)
    np.testing.assert_allclose(np.linalg.norm(trajectory.qpos[:, 3:7], axis=1), 1.0, atol=1e-9)


def test_contacts_are_those_of_the_schedule(planned):
    walk, trajectory = planned
    for index in range(0, len(trajectory.times), 7):
        phase = walk.schedule.phase_at(trajectory.times[index])
        held = [contact.limb in {c.limb for c in phase.contacts} for contact in phase.contacts]
        assert all(held)
        assert list(np.flatnonzero(trajectory.in_contact[index])) == [contact.limb for contact in phase.contacts]
        for contact in phase.contacts:
            np.testing.assert_allclose(trajectory.limb_pose[index, contact.limb, :3], contact.pose.position, atol=1e-9)


def test_posture_stays_natural(robot, planned):
    """Base upright and heading forward, arms not flailing, back at home in the end."""
    _, trajectory = planned
    free = [limb for limb in robot.arms if not trajectory.in_contact[:, limb].any()]
    arms = [index for index, name in enumerate(robot.joint_names) if _carries(robot, name, free)]
    data = mujoco.MjData(robot.mujoco_model)
    for qpos in trajectory.qpos[::5]:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(robot.mujoco_model, data)
        up = data.body(robot.base).xmat.reshape(3, 3)[:, 2]
        assert up[2] > np.cos(0.25)
    away = np.abs(trajectory.qpos[:, 7:] - robot.home[7:])[:, arms]
    assert away.max() < 0.61
    assert away[-1].max() < 0.25


def test_arms_reach_no_faster_than_their_paths(robot, palm_plan):
    """Also where a palm's path has little authority yet."""
    trajectory = palm_plan.trajectory
    palm, _ = palm_poses(robot, trajectory)
    speed = np.linalg.norm(np.diff(palm, axis=0), axis=1) / trajectory.times[1]
    path = np.linalg.norm(trajectory.limb_velocity[:, Limb.LEFT_PALM, :3], axis=1)
    assert speed.max() < 1.5 * np.nanmax(path), (speed.max(), np.nanmax(path))


def test_palms_are_tracked_where_the_postures_have_them(robot, palm_plan):
    """Their paths have little authority over the arm, which is not there."""
    palm, times = Limb.LEFT_PALM, palm_plan.trajectory.times[:-1]
    reference, (place, turn) = sample_reference(times, palm_plan), palm_poses(robot, palm_plan.trajectory)
    rows = np.flatnonzero((reference.authority[:, palm] > 0.0) & ~reference.in_contact[:, palm])
    np.testing.assert_allclose(reference.limb_position[rows, palm], place[rows], atol=1e-9)
    np.testing.assert_allclose(reference.limb_rotation[rows, palm].reshape(-1, 9), turn[rows], atol=1e-9)
    steps = np.diff(reference.limb_position[rows, palm], axis=0)
    mean = (reference.limb_velocity[rows[:-1], palm, :3] + reference.limb_velocity[rows[1:], palm, :3]) / 2
    within = np.diff(rows) == 1
    np.testing.assert_allclose(steps[within], times[1] * mean[within], atol=3e-3)


def _carries(robot, name, limbs) -> bool:
    """Whether a joint moves one of the limbs but neither foot nor the other palm."""
    model = robot.mujoco_model

    def chain(limb):
        body, bodies = model.body(robot.limbs[limb].body).id, set()
        while body:
            bodies.add(body)
            body = model.body_parentid[body]
        return bodies

    body = model.joint(name).bodyid[0]
    carried = [limb for limb in robot.limbs if body in chain(limb)]
    return len(carried) == 1 and carried[0] in limbs


def test_velocities_are_mujocos(robot, planned):
    """Integrating qvel over a step leads to the next posture, up to the second order in the step."""
    _, trajectory = planned
    model, step = robot.mujoco_model, trajectory.times[1]
    for index in range(1, len(trajectory.times) - 2, 11):
        qpos = trajectory.qpos[index].copy()
        mujoco.mj_integratePos(model, qpos, 0.5 * (trajectory.qvel[index] + trajectory.qvel[index + 1]), step)
        error = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, error, 1.0, qpos, trajectory.qpos[index + 1])
        assert np.abs(error).max() < 1e-2  # rad or m; a lift-off changes the acceleration by 100 rad/s^2 in 20 ms


def test_an_infeasible_motion_is_refused(robot, flat_walk):
    motion = dataclasses.replace(flat_walk.motion, feasible=False, status="no luck")
    plan = dataclasses.replace(flat_walk, motion=motion)
    trajectory = whole_body(plan, compose_scene(robot, flat_walk.world)).trajectory
    assert not trajectory.feasible
    assert trajectory.reason == "the centroidal motion is not feasible: no luck"


def test_free_palms_have_no_target(robot, palm_walk):
    paths = limb_paths(robot, palm_walk.world, palm_walk.schedule, palm_walk.motion)
    sample = paths.sample(Limb.LEFT_PALM, 0.0)
    assert sample.pose is None and not sample.in_contact and np.isnan(sample.velocity).all()
    assert paths.authority(Limb.LEFT_PALM, 0.0) == 0.0
    assert not paths.blocked and not paths.folded


def test_a_palm_is_at_a_surface_but_for_the_middle_of_its_swings(robot, palm_walk):
    paths, palm = limb_paths(robot, palm_walk.world, palm_walk.schedule, palm_walk.motion), Limb.LEFT_PALM
    assert not paths.at_surface(palm, 0.0)
    swings = [item for item in paths.segments[palm] if item.path is not None]
    assert any(item.free_start for item in swings) and any(item.free_end for item in swings)
    for item in swings:
        begin, middle, end = (paths.at_surface(palm, item.begin + u * (item.end - item.begin)) for u in (0.1, 0.4, 0.9))
        assert (begin, middle, end) == (not item.free_start, False, not item.free_end)
    held = next(item for item in paths.segments[palm] if item.pose is not None)
    assert paths.at_surface(palm, held.begin)


def test_paths_are_continuous_over_the_schedule(robot, planned):
    walk, _ = planned
    paths = limb_paths(robot, walk.world, walk.schedule, walk.motion)
    for limb in FEET:
        for phase in walk.schedule.phases[1:]:
            before, after = paths.sample(limb, phase.start - 1e-7), paths.sample(limb, phase.start + 1e-7)
            np.testing.assert_allclose(before.pose.position, after.pose.position, atol=1e-6)
            np.testing.assert_allclose(before.pose.rotation, after.pose.rotation, atol=1e-6)
            np.testing.assert_allclose(before.velocity, after.velocity, atol=1e-4)
