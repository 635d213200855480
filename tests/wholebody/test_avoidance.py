import mujoco
import numpy as np
import pytest

from tests.wholebody.conftest import world_of
from toolkit.geometry.limb import PALMS, Limb
from toolkit.wholebody.avoidance import NOTICE, TIME, ArmAvoidance
from toolkit.wholebody.collision import first_collision
from toolkit.wholebody.limb_paths import limb_paths
from toolkit.wholebody.plan import solve_ik
from toolkit.world.scene import compose_scene


@pytest.fixture
def hand(robot):
    if Limb.LEFT_PALM not in robot.limbs:
        pytest.skip("a robot without palms")
    data = mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_forward(robot.mujoco_model, data)
    return data.site(robot.limbs[Limb.LEFT_PALM].site).xpos.copy()


def side_wall(y):
    return world_of(f'<geom name="wall" type="box" size="3 0.05 1.5" pos="0 {y + 0.05} 1.5"/>')


def outermost(robot, qpos):
    """Largest y of the left arm's geoms in a posture, by their bounding spheres' centres."""
    model, data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return data.geom_xpos[:, 1].max()


def test_nothing_pushes_in_the_open(robot, hand):
    """At home some links are near others, none so near that its damper asks for a motion."""
    avoidance = ArmAvoidance(robot, compose_scene(robot, world_of("")))
    rows, bound = avoidance.rows(robot.home, np.zeros(6), 0.01, set())
    assert rows.shape == (len(bound), len(robot.joint_names))
    assert (bound > 0.0).all()


def test_rows_are_derivatives_of_the_distance(robot, hand):
    """Moving the joints changes each distance as the row says, by finite differences on MuJoCo's distances."""
    world = side_wall(hand[1] + 0.08)
    avoidance, tick, h = ArmAvoidance(robot, compose_scene(robot, world)), 0.01, 1e-5
    rows, bound = avoidance.rows(robot.home, np.zeros(6), tick, set())
    assert len(rows) > 0
    rng = np.random.default_rng(0)
    direction = rng.normal(size=len(robot.joint_names))
    moved = robot.home.copy()
    moved[7:] += h * direction
    _, bound_after = avoidance.rows(moved, np.zeros(6), tick, set())
    # bound = (distance - safe) tick / time, and a row is minus the distance's gradient; sorted by distance both times
    change = (bound_after - bound) * TIME / tick / h
    nearest = np.argmin(bound)
    np.testing.assert_allclose(change[nearest], -rows[nearest] @ direction, rtol=0.05, atol=1e-3)


def test_a_reaching_hand_may_touch(robot, hand):
    avoidance = ArmAvoidance(robot, compose_scene(robot, side_wall(hand[1] + 0.03)))
    free, _ = avoidance.rows(robot.home, np.zeros(6), 0.01, set())
    reaching, _ = avoidance.rows(robot.home, np.zeros(6), 0.01, set(PALMS))
    assert len(reaching) < len(free)


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


def test_boxes_are_seen_edge_to_edge(robot, hand):
    """A box whose edge points at the hand, where MuJoCo's collision of boxes with a margin finds nothing."""
    place = f"{hand[0]} {hand[1] + 0.3} {hand[2]}"
    world = world_of(f'<geom name="post" type="box" size="0.15 0.15 0.02" pos="{place}" euler="30 20 45"/>')
    avoidance = ArmAvoidance(robot, compose_scene(robot, world))
    avoidance._place(robot.home)
    model, data, post = avoidance.model, avoidance.data, avoidance.model.geom("world/post").id
    pairs = avoidance._box_pairs()
    seen = {first: (distance, normal) for first, second, distance, normal, _ in pairs if second == post}
    boxes = [g for g in np.flatnonzero(avoidance.arm_of >= 0) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX]
    if not boxes:
        pytest.skip("arms without boxes")
    for geom in boxes:
        distance = mujoco.mj_geomDistance(model, data, int(geom), post, 1.0, None)
        assert (geom in seen) == (distance < NOTICE)
        if geom in seen:
            assert seen[geom][0] == pytest.approx(distance, abs=1e-6)
            np.testing.assert_allclose(np.linalg.norm(seen[geom][1]), 1.0, atol=1e-6)
            assert seen[geom][1] @ (data.geom_xpos[post] - data.geom_xpos[geom]) > 0.0
    assert seen
