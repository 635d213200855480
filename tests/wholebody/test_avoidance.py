"""Velocity dampers: their rows are derivatives of distances, and they keep arms and legs clear."""

import mujoco
import numpy as np
import pytest

from tests.wholebody.conftest import planned_walk, world_of
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.near_pairs import near_boxes
from toolkit.wholebody.avoidance import ARM, BODY, Avoidance
from toolkit.wholebody.check import check
from toolkit.wholebody.collision import first_collision
from toolkit.wholebody.ik import WholeBodyIK
from toolkit.wholebody.ik_config import ARM_SWING, GIVING_WAY
from toolkit.wholebody.limb_paths import limb_paths
from toolkit.wholebody.plan import solve_ik
from toolkit.world.scene import compose_scene

TICK = 0.01  # s


def side_wall(y):
    return world_of(f'<geom name="wall" type="box" size="3 0.05 1.5" pos="0 {y + 0.05} 1.5"/>')


def outermost(robot, qpos):
    """Largest y of the left arm's geoms in a posture, by their bounding spheres' centres."""
    model, data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return data.geom_xpos[:, 1].max()


def of_world(avoidance):
    """The same without pairs of the robot's own links."""
    avoidance.at_home[np.isfinite(avoidance.at_home)] = -1.0
    return avoidance


def dampers(avoidance, qpos, reaching=(), standing=Limb.LEFT_FOOT, drift=None):
    drift = np.zeros(len(qpos) - 1) if drift is None else drift
    return avoidance.dampers(qpos, drift, TICK, set(reaching), standing)


def knee_height(robot):
    return robot.legs[Limb.LEFT_FOOT].shin + abs(robot.legs[Limb.LEFT_FOOT].ankle_in_sole[2])


def bar_before_the_shin(robot, gap, qpos=None):
    """A bar from the middle to the left, `gap` m in front of the left shin in a posture, the home one if None."""
    leg = robot.legs[Limb.LEFT_FOOT]
    x, height = 1.0, 0.7 * (leg.shin + abs(leg.ankle_in_sole[2]))
    spec = mujoco.MjSpec.from_string(robot.mjcf, assets=robot.assets)
    spec.worldbody.add_geom(name="bar", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.5, 0.01], pos=[x, 0.5, height])
    scene = spec.compile()
    data, bar = mujoco.MjData(scene), scene.geom("bar").id
    shin = scene.geom_bodyid == scene.jnt_bodyid[robot.joints_to(Limb.LEFT_FOOT)[3] + 1]
    data.qpos[:] = robot.home if qpos is None else qpos
    for _ in range(100):  # it comes nearer by what is left of the gap, which is never more than its own way
        mujoco.mj_kinematics(scene, data)
        geoms = np.flatnonzero(shin & (scene.geom_contype != 0)).tolist()
        left = min(mujoco.mj_geomDistance(scene, data, geom, bar, 2.0, None) for geom in geoms) - gap
        x = scene.geom_pos[bar, 0] = x - left
    assert left == pytest.approx(0.0, abs=1e-3)
    return world_of(f'<geom name="bar" type="box" size="0.1 0.5 0.01" pos="{x} 0.5 {height}"/>')


def moved(robot, direction, foot):
    """The home posture with its joints moved while a foot stays, or the base where there is none."""
    data, qpos = mujoco.MjData(robot.mujoco_model), robot.home.copy()
    poses = []
    for angles in (robot.home[7:], robot.home[7:] + direction):
        qpos[7:] = angles
        data.qpos[:] = qpos
        mujoco.mj_kinematics(robot.mujoco_model, data)
        body = data.body(robot.base if foot is None else robot.limbs[foot].body)
        poses.append(Pose(body.xmat.reshape(3, 3).copy(), body.xpos.copy()))
    base = poses[0] @ poses[1].inverse() @ Pose.from_quaternion(robot.home[:3], robot.home[3:7])
    qpos[:3], qpos[3:7] = base.position, base.quaternion_wxyz
    return qpos


def test_nothing_pushes_in_the_open(robot):
    """At home some links are near others, none so near that its damper asks for a motion."""
    found = dampers(Avoidance(robot, compose_scene(robot, world_of(""))), robot.home)
    assert found.matrix.shape == (len(found.bound), len(robot.joint_names))
    assert (found.bound > 0.0).all()


def test_rows_of_arms_are_derivatives_of_the_distance(robot, hand):
    """Moving the joints changes the least distance as its row says, by finite differences on MuJoCo's distances."""
    avoidance, h = of_world(Avoidance(robot, compose_scene(robot, side_wall(hand[1] + 0.15)))), 1e-5
    found, direction = dampers(avoidance, robot.home), np.random.default_rng(0).normal(size=len(robot.joint_names))
    after = dampers(avoidance, moved(robot, h * direction, None))
    # bound = tick sqrt(2 braking (distance - safe)), and a row is minus the distance's gradient; sorted both times
    nearest = np.flatnonzero(found.weight <= ARM.weight)[0]
    change = (after.bound**2 - found.bound**2)[nearest] / (2.0 * ARM.braking * TICK**2) / h
    np.testing.assert_allclose(change, -found.matrix[nearest] @ direction, rtol=0.05, atol=1e-3)


@pytest.mark.parametrize("standing", FEET)
def test_rows_of_legs_are_derivatives_of_the_distance_as_the_base_moves_over_the_foot(robot, standing):
    """The same for a shin before an edge, with the base where the joints of a leg carry it over its foot."""
    avoidance, h = of_world(Avoidance(robot, compose_scene(robot, bar_before_the_shin(robot, 0.03)))), 1e-5
    direction = np.random.default_rng(1).normal(size=len(robot.joint_names))
    found = dampers(avoidance, robot.home, PALMS, standing)
    after = dampers(avoidance, moved(robot, h * direction, standing), PALMS, standing)
    nearest = np.flatnonzero(found.weight == BODY.weight)[0]
    change = (after.bound - found.bound)[nearest] * BODY.time / TICK / h
    np.testing.assert_allclose(change, -found.matrix[nearest] @ direction, rtol=0.05, atol=1e-3)


def test_weights_of_arms_go_with_the_inverse_square_of_the_distance():
    """Comfort gives way to what is about to touch; what touches already weighs no more than what nearly does."""
    distance = np.array([-1e-3, 0.0, ARM.firm / 6.0, ARM.firm / 3.0, ARM.firm, 0.03, ARM.safe_world])
    shares = ARM.share(distance)
    assert (shares[:4] == shares[0]).all()
    assert (np.diff(shares[3:]) < 0.0).all()
    np.testing.assert_allclose((shares * distance**2)[3:], ARM.firm**2)
    assert (BODY.share(distance) == 1.0).all()


def test_a_root_that_moves_carries_its_links_along(robot):
    """With the whole robot on its way to an edge, what joints may add is less by that way."""
    avoidance = of_world(Avoidance(robot, compose_scene(robot, bar_before_the_shin(robot, 0.03))))
    drift = np.zeros(len(robot.home) - 1)
    drift[0] = 1e-3
    still, moving = (dampers(avoidance, robot.home, PALMS, drift=each).bound for each in (0.0 * drift, drift))
    assert (still - moving).max() == pytest.approx(1e-3, rel=0.2)  # nearly along the normal


def test_a_reaching_hand_may_touch(robot, hand):
    avoidance = Avoidance(robot, compose_scene(robot, side_wall(hand[1] + 0.03)))
    assert len(dampers(avoidance, robot.home, PALMS).bound) < len(dampers(avoidance, robot.home).bound)


def test_feet_are_left_to_their_paths(robot):
    """Soles on the floor make no rows with it."""
    avoidance = Avoidance(robot, compose_scene(robot, world_of("")))
    avoidance._place(robot.home)
    feet = {int(body) for limb, body in avoidance.body.items() if limb.is_foot}
    pairs = avoidance._near(set())
    bodies = avoidance.model.geom_bodyid[pairs.geoms[avoidance._of_world(pairs.geoms)]]
    assert not np.isin(bodies, list(feet)).any()


def test_links_that_are_near_at_home_are_noticed_when_they_come_nearer(robot):
    """Neighbours need not part at home, whatever their distance, and are kept at half of it."""
    avoidance = Avoidance(robot, compose_scene(robot, world_of("")))
    near = (avoidance.at_home > 0.0) & (avoidance.at_home < BODY.safe_self + BODY.room)
    if not near.any():
        pytest.skip("no neighbours near each other")
    assert (dampers(avoidance, robot.home).bound > 0.0).all()
    apart = avoidance.at_home[near]
    avoidance.at_home[near] = 2.0 * apart
    found = dampers(avoidance, robot.home)
    least = (apart - np.minimum(BODY.safe_self, apart)).min()
    assert found.bound.min() * BODY.time / TICK <= least + 1e-9


def test_arms_are_drawn_in_beside_a_wall(robot, flat_walk, hand):
    """A wall that the home posture would touch: with dampers the walk is free, without them it collides."""
    paths = limb_paths(robot, flat_walk.world, flat_walk.schedule, flat_walk.motion)
    times = np.linspace(0.0, flat_walk.schedule.duration, int(50 * flat_walk.schedule.duration) + 1)
    free = solve_ik(robot, paths, flat_walk.motion, times)
    world = side_wall(max(outermost(robot, qpos) for qpos in free) + 0.02)
    scene = compose_scene(robot, world)
    hit = first_collision(robot, scene, times, free)
    assert hit is not None and "world/wall" in hit.reason
    drawn_in = solve_ik(robot, paths, flat_walk.motion, times, scene)
    assert first_collision(robot, scene, times, drawn_in) is None


def test_arms_that_something_pushes_have_a_wider_range(robot, flat_walk):
    """A wall that the left hand touches: that arm may go farther from home than the one that hangs free."""
    scene = compose_scene(robot, side_wall(outermost(robot, robot.home)))
    paths = limb_paths(robot, flat_walk.world, flat_walk.schedule, flat_walk.motion)
    ik, angles, left = WholeBodyIK(robot, TICK, Avoidance(robot, scene)), robot.home[7:], Limb.LEFT_PALM
    ik.drift = np.zeros(len(robot.home) - 1)
    pushed = ik._set_dampers(robot.home, angles, 0.0, paths, Limb.LEFT_FOOT)
    assert pushed == {left}
    elbow = [int(robot.arm_sides[palm][np.argmax(np.minimum(*_room(robot, palm)))]) for palm in PALMS]
    ik._set_ranges(angles, list(PALMS), pushed)
    wide, narrow = (np.diff(ik.wrapper.get_joint_limits(robot.joint_names[joint]))[0] for joint in elbow)
    assert wide == pytest.approx(narrow * GIVING_WAY / ARM_SWING)


def _room(robot, palm):
    """rad from home to both ends of an arm's joints."""
    joints = robot.arm_sides[palm]
    return robot.home[7:][joints] - robot.lower[joints], robot.upper[joints] - robot.home[7:][joints]


def test_motions_begin_with_arms_clear_of_a_wall(robot):
    """A wall in which the arms of the home posture would be."""
    rest, times = planned_walk(robot, world_of(""), []), np.array([0.0, 0.02])
    paths = limb_paths(robot, rest.world, rest.schedule, rest.motion)
    scene = compose_scene(robot, side_wall(outermost(robot, robot.home) - 0.01))
    hit = first_collision(robot, scene, times, np.tile(robot.home, (2, 1)))
    assert hit is not None and "world/wall" in hit.reason
    assert first_collision(robot, scene, times, solve_ik(robot, paths, rest.motion, times, scene)) is None


def test_shins_are_kept_off_an_edge(robot):
    """A bar that the shin touches while the robot rests: the base turns for it, feet and CoM stay as planned."""
    rest = planned_walk(robot, world_of(""), [])
    times = np.linspace(0.0, rest.schedule.duration, int(50 * rest.schedule.duration) + 1)
    paths = limb_paths(robot, rest.world, rest.schedule, rest.motion)
    grazing = solve_ik(robot, paths, rest.motion, times)
    scene = compose_scene(robot, bar_before_the_shin(robot, -0.008, grazing[0]))
    hit = first_collision(robot, scene, times, grazing)
    assert hit is not None and "world/bar" in hit.reason
    clear = solve_ik(robot, paths, rest.motion, times, scene)
    assert first_collision(robot, scene, times[-20:], clear[-20:]) is None
    assert not check(robot, scene, paths, rest.motion, times[-20:], clear[-20:]).findings


def test_boxes_are_seen_edge_to_edge(robot, hand):
    """A box whose edge points at the hand, where MuJoCo's collision of boxes with a margin finds nothing."""
    place = f"{hand[0]} {hand[1] + 0.3} {hand[2]}"
    world = world_of(f'<geom name="post" type="box" size="0.15 0.15 0.02" pos="{place}" euler="30 20 45"/>')
    avoidance = Avoidance(robot, compose_scene(robot, world))
    avoidance._place(robot.home)
    model, data, post = avoidance.model, avoidance.data, avoidance.model.geom("world/post").id
    pairs = near_boxes(model, data, avoidance.box_pairs, avoidance.box_reach, avoidance.box_notice)
    seen = {sum(geoms) - post: row for row, geoms in enumerate(pairs.geoms.tolist()) if post in geoms}
    boxes = [g for g in np.flatnonzero(avoidance.arm) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX]
    if not boxes:
        pytest.skip("arms without boxes")
    for geom in boxes:
        distance = mujoco.mj_geomDistance(model, data, int(geom), post, 1.0, None)
        assert (geom in seen) == (distance < ARM.notice)
        if geom in seen:
            (first, second), apart, normal, _ = (each[seen[geom]] for each in pairs)
            assert apart == pytest.approx(distance, abs=1e-6)
            np.testing.assert_allclose(np.linalg.norm(normal), 1.0, atol=1e-6)
            assert normal @ (data.geom_xpos[second] - data.geom_xpos[first]) > 0.0
    assert seen
