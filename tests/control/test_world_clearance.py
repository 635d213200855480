"""Links that are pushed at a wall come near it and do not touch; palms that reach for it may, and feet."""

import mujoco
import numpy as np
import pytest

from tests.wholebody.conftest import world_of
from toolkit.control.clearance import RATE
from toolkit.control.world_clearance import SAFE_ARM, WorldClearance
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.world_distance import above_ankles
from toolkit.world.scene import compose_scene

STEP = 0.002  # s


def outermost(robot):
    """Largest y of a point of the left arm at home, by its geoms' boxes, in m."""
    model, data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(model, data)
    farthest = -np.inf
    for geom in np.flatnonzero(robot.in_arms(model)[model.geom_bodyid] == Limb.LEFT_PALM).tolist():
        sideways = data.geom_xmat[geom].reshape(3, 3)[1]
        center, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        farthest = max(farthest, data.geom_xpos[geom, 1] + sideways @ center + np.abs(sideways) @ half)
    return farthest


@pytest.fixture
def beside_wall(robot):
    """Scene and clearance with a wall 10 cm left of the left arm."""
    if Limb.LEFT_PALM not in robot.arm_sides:
        pytest.skip("no left arm")
    y = outermost(robot) + 0.1 * robot.scale.length + 0.05
    scene = compose_scene(robot, world_of(f'<geom name="wall" type="box" size="3 0.05 1.5" pos="0 {y} 1.5"/>'))
    return scene, WorldClearance(robot, scene)


def outward(robot):
    """Velocities (6 + n,) that swing the left arm to the side, by the joint of its shoulder that moves it most."""
    model, data, qvel = robot.mujoco_model, mujoco.MjData(robot.mujoco_model), np.zeros(robot.mujoco_model.nv)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    hand = int(np.flatnonzero(robot.in_arms(model) == Limb.LEFT_PALM)[-1])
    jacobian = np.empty((3, model.nv))
    mujoco.mj_jacBody(model, data, jacobian, None, hand)
    shoulder = 6 + robot.arm_sides[Limb.LEFT_PALM][:3]
    joint = shoulder[np.argmax(np.abs(jacobian[1, shoulder]))]
    qvel[joint] = np.sign(jacobian[1, joint])
    return qvel


def nearest(robot, scene, qpos):
    """Least distance in m of the left arm and the wall."""
    data, wall = mujoco.MjData(scene), scene.geom("world/wall").id
    data.qpos[:] = qpos
    mujoco.mj_kinematics(scene, data)
    arm = np.flatnonzero((robot.in_arms(scene)[scene.geom_bodyid] == Limb.LEFT_PALM) & (scene.geom_contype != 0))
    return min(mujoco.mj_geomDistance(scene, data, int(geom), wall, 1.0, None) for geom in arm)


def pushed(robot, scene, clearance, ticks):
    """Distances from the wall of an arm that swings to it, accelerated as far as the clearance allows."""
    along, qpos, speed, found = outward(robot), robot.home.copy(), 0.0, []
    for _ in range(ticks):
        clearance.update(qpos, speed * along, ())
        rates, lower = clearance.rows[: clearance.count] @ along, clearance.lower[: clearance.count]
        towards = rates < -1e-3  # other links of the arm swing away, or hardly move
        speed += STEP * min([5.0, *(lower[towards] / rates[towards])])
        mujoco.mj_integratePos(robot.mujoco_model, qpos, speed * along, STEP)
        found.append(nearest(robot, scene, qpos))
    return found


def test_the_arm_is_free_far_from_the_wall(robot, beside_wall):
    _, clearance = beside_wall
    clearance.update(robot.home, np.zeros(robot.mujoco_model.nv), ())
    assert clearance.count == 0


def test_an_arm_pushed_at_a_wall_comes_near_and_does_not_touch(robot, beside_wall):
    scene, clearance = beside_wall
    found = pushed(robot, scene, clearance, 400)
    assert min(found) > 0.7 * robot.scale.length * SAFE_ARM
    assert min(found) < 1.3 * robot.scale.length * SAFE_ARM
    free = robot.home.copy()
    mujoco.mj_integratePos(robot.mujoco_model, free, outward(robot), 1.0)
    assert nearest(robot, scene, free) < 0.0  # which nothing but the clearance prevents


def test_a_palm_that_reaches_may_touch(robot, beside_wall):
    scene, clearance = beside_wall
    qpos, still = robot.home.copy(), np.zeros(scene.nv)
    while clearance.count == 0:
        mujoco.mj_integratePos(robot.mujoco_model, qpos, outward(robot), 0.02)
        clearance.update(qpos, still, ())
    clearance.update(qpos, still, [Limb.LEFT_PALM])
    assert clearance.count == 0
    clearance.update(qpos, still, [Limb.RIGHT_PALM])
    assert clearance.count > 0


def test_bounds_follow_distance_and_speed(robot, beside_wall):
    scene, clearance = beside_wall
    qpos, still, towards = robot.home.copy(), np.zeros(scene.nv), outward(robot)
    while clearance.count == 0:
        mujoco.mj_integratePos(robot.mujoco_model, qpos, towards, 0.01)
        clearance.update(qpos, still, ())
    rate, row, lower = RATE / robot.scale.time, clearance.rows[0].copy(), clearance.lower[0]
    clearance.update(qpos, towards, ())
    assert clearance.lower[0] - lower == pytest.approx(-2.0 * rate * (row @ towards), rel=1e-6)
    before = nearest(robot, scene, qpos)
    assert lower == pytest.approx(-(rate**2) * (before - robot.scale.length * SAFE_ARM), rel=1e-3)
    mujoco.mj_integratePos(robot.mujoco_model, qpos, towards, 1e-4)
    assert nearest(robot, scene, qpos) - before == pytest.approx(1e-4 * (row @ towards), rel=0.05)


def test_all_links_but_ankles_and_feet_keep_off_the_world(robot):
    model = robot.mujoco_model
    above = above_ankles(robot, model)
    assert above[model.body(robot.base).id] and above[robot.in_arms(model) >= 0].all()
    for foot in FEET:
        bodies = [int(model.jnt_bodyid[model.joint(robot.joint_names[joint]).id]) for joint in robot.joints_to(foot)]
        assert above[bodies[:4]].all() and not above[bodies[4:]].any()
        assert not above[model.body(robot.limbs[foot].body).id]
