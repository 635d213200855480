import copy
import dataclasses

import mujoco
import numpy as np
import pytest

from tests.search.worlds import FLOOR, box, make_world
from toolkit.contacts.footholds import Footholds
from toolkit.contacts.projection import Projector
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.search.costs.heuristic import EuclideanDistance
from toolkit.search.costs.terrain_distance import TerrainDistance
from toolkit.search.ground import Ground
from toolkit.search.moves.obstacles import world_triangles
from toolkit.search.moves.occupancy import BodyBox, Occupancy, body_free
from toolkit.search.planner_config import PlannerConfig


def terrain(robot, world):
    projector = Projector(robot, world.surfaces, world.mujoco_model)
    footholds = Footholds(world.surfaces, robot.half_sizes[0], projector.config.margin)
    return TerrainDistance(robot, world, projector, footholds)


def at(distance, x, y, z=0.0, yaw=0.0):
    return float(distance(np.array([[x, y, z]]), np.array([yaw]))[0])


def test_body_box_holds_the_body_but_not_the_arms(robot):
    shape = BodyBox.of(robot)
    assert 0.8 * robot.com_height < shape.top < 2.5 * robot.com_height
    assert 0.3 * robot.com_height < shape.bottom < 0.7 * robot.com_height
    assert 0.08 < shape.half_depth < 0.4 and 0.15 < shape.half_width < 0.5


def test_body_box_is_as_wide_as_the_shoulders_but_not_as_the_hands(robot):
    """A shape that the second joint of an arm carries makes the body wider, and one of a wrist does not."""

    def half_width(joint, radius):
        model = copy.copy(robot.mujoco_model)
        body = model.jnt_bodyid[robot.arm_sides[Limb.LEFT_PALM][joint] + 1]
        geom = model.body_geomadr[body]
        model.geom_type[geom], model.geom_size[geom] = mujoco.mjtGeom.mjGEOM_SPHERE, radius
        data = mujoco.MjData(model)
        data.qpos[:] = robot.home
        mujoco.mj_kinematics(model, data)
        return BodyBox.of(dataclasses.replace(robot, mujoco_model=model)).half_width, data.geom_xpos[geom, 1] + radius

    wide, side = half_width(1, 0.2)
    np.testing.assert_allclose(wide, side, atol=1e-9)
    assert wide > BodyBox.of(robot).half_width
    assert half_width(-1, 0.2)[0] == BodyBox.of(robot).half_width


def test_flat_ground_is_the_straight_line(robot):
    world = make_world(FLOOR, goal=(2.0, 0, 0))
    distance = terrain(robot, world).distance(world.start, 0.4)
    straight = EuclideanDistance(world.goal)
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-1, 3, (200, 1)), rng.uniform(-1, 1, (200, 1)), np.zeros((200, 1))])
    yaw = rng.uniform(-3, 3, 200)
    np.testing.assert_allclose(distance(points, yaw), straight(points, yaw), atol=0.06)
    assert (distance(points, yaw) >= straight(points, yaw) - 1e-12).all()
    assert at(distance, 2.1, 0.0) == 0.0


def wall_with_doorway(y, width):
    """Across the whole floor, but for a doorway at y."""
    return [box([1.0, y + side * (width / 2 + 3.0), 1.0], [0.05, 3.0, 1.0]) for side in (-1, 1)]


def test_wall_with_a_doorway_lengthens_the_way(robot):
    room = 2 * BodyBox.of(robot).half_width + 0.3
    world = make_world(FLOOR, *wall_with_doorway(1.2, room), goal=(2.0, 0, 0))
    distance = terrain(robot, world).distance(world.start, 0.4)
    detour = 2 * np.hypot(1.0, 1.2) - world.goal.radius
    assert 0.85 * detour < at(distance, 0, 0) < 1.1 * detour
    ways = distance.ahead(np.array([[0.0, 0, 0], [1.0, 1.2, 0], [1.5, 0.6, 0], [2.0, 0, 0], [1.0, 0, 0]]), np.zeros(5))
    np.testing.assert_allclose(ways, np.radians([50.0, -50.0, -50.0, np.nan, np.nan]), atol=np.radians(20.0))
    # Too narrow even sideways, by more than the cells of the grid.
    narrow = make_world(FLOOR, *wall_with_doorway(0.0, 2 * BodyBox.of(robot).half_depth - 0.15), goal=(2.0, 0, 0))
    assert terrain(robot, narrow).distance(narrow.start, 0.4) is None


@pytest.mark.parametrize(
    ("gap", "stride", "crossed"), [(0.1, 0.4, True), (0.5, 0.75, True), (0.5, 0.4, False), (0.9, 0.75, False)]
)
def test_gaps(robot, gap, stride, crossed):
    world = make_world(
        box([0, 0, -0.05], [0.5, 0.5, 0.05]), box([1.0 + gap, 0, -0.05], [0.5, 0.5, 0.05]), goal=(1.0 + gap, 0, 0)
    )
    assert (terrain(robot, world).distance(world.start, stride) is not None) == crossed


def test_ground_above_ground(robot):
    """Under a roof that can be stood upon: both heights have their own way."""
    roof = box([1.0, 0, 2.2], [0.6, 0.6, 0.05])
    world = make_world(FLOOR, roof, goal=(2.0, 0, 0))
    distance = terrain(robot, world).distance(world.start, 0.4)
    assert at(distance, 1.0, 0.0, 0.0) == pytest.approx(0.8, abs=0.06)
    assert at(distance, 1.0, 0.0, 2.25) == np.inf


def test_u_shaped_wall(robot):
    u = [
        box([1.2, 0, 1.0], [0.05, 0.9, 1.0]),
        box([0.7, 0.9, 1.0], [0.5, 0.05, 1.0]),
        box([0.7, -0.9, 1.0], [0.5, 0.05, 1.0]),
    ]
    world = make_world(FLOOR, *u, goal=(2.2, 0, 0))
    distance = terrain(robot, world).distance(world.start, 0.4)
    straight = EuclideanDistance(world.goal)(np.array([[0.6, 0, 0.0]]), np.zeros(1))[0]
    assert at(distance, 0.6, 0.0) > straight + 1.0


def test_occupancy_agrees_with_collision(robot):
    """The grid errs by no more than its cells: an inflated box that MuJoCo finds free is free, a shrunk one that
    touches is not (only surfaces count, so boxes stay out of the insides of large geoms)."""
    rng = np.random.default_rng(0)
    geoms = []
    for _ in range(25):
        half = rng.uniform(0.03, 0.12, 3)
        geoms.append(box(rng.uniform([-1, -1, 0.8], [1, 1, 1.6]), half, rng.uniform(-180, 180, 3)))
    geoms.append('<geom type="cylinder" size="0.08 0.15" pos="0.3 0.7 1.1" euler="40 10 0"/>')
    geoms.append('<geom type="capsule" size="0.05 0.15" pos="-0.6 0.2 1.2" euler="0 0 0"/>')
    world = make_world(FLOOR, *geoms)
    body = BodyBox(0.15, 0.25, 0.5, 1.5)
    grid = Occupancy.of(world.mujoco_model, np.array([-2, -2, 0.3]), np.array([2, 2, 2.2]), cell=0.04)
    spec = world.scenery.copy()
    sizes = {}
    for name, grow in (("large", 0.09), ("small", -0.06)):
        holder = spec.worldbody.add_body(name=name, mocap=True)
        sizes[name] = holder.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.15 + grow, 0.25 + grow, 0.5 + grow], name=name, contype=0
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    statics = [g for g in range(model.ngeom) if model.geom_bodyid[g] == 0 and model.geom_type[g] != 0]
    agreed = 0
    for _ in range(400):
        position, yaw = np.array([*rng.uniform(-1.2, 1.2, 2), 0.0]), rng.uniform(-3, 3)
        pose = Pose.from_yaw(position + [0, 0, 1.0], yaw)
        data.mocap_pos[:], data.mocap_quat[:] = pose.position, pose.quaternion_wxyz
        mujoco.mj_kinematics(model, data)
        touch = {
            name: any(mujoco.mj_geomDistance(model, data, model.geom(name).id, g, 1.0, None) <= 0 for g in statics)
            for name in sizes
        }
        free = body_free(grid, body, *position, yaw)
        if not touch["large"]:
            assert free
        if touch["small"]:
            assert not free
        agreed += touch["large"] == touch["small"]
    assert 100 < agreed < 400


def test_triangles_lie_on_their_geoms():
    world = make_world(FLOOR, box([0.5, 0.3, 0.4], [0.1, 0.2, 0.3], [10, 20, 30]))
    triangles = world_triangles(world.mujoco_model, np.array([-1, -1, -1]), np.array([1, 1, 1]))
    data = mujoco.MjData(world.mujoco_model)
    mujoco.mj_kinematics(world.mujoco_model, data)
    pose = Pose(data.geom_xmat[1].reshape(3, 3), data.geom_xpos[1])
    local = np.abs(pose.inverse() @ triangles[-12:])
    np.testing.assert_allclose(local, np.broadcast_to([0.1, 0.2, 0.3], local.shape), atol=1e-9)
    edges = np.diff(triangles[-12:], axis=1)
    outward = np.cross(edges[:, 0], edges[:, 1])
    assert np.linalg.norm(outward, axis=1).min() > 0


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        ("sphere", [3.0]),
        ("sphere", [0.1]),
        ("ellipsoid", [0.6, 0.4, 0.1]),
        ("capsule", [0.03, 0.2]),
        ("capsule", [0.5, 0.8]),
    ],
)
def test_polyhedra_hug_round_geoms(kind, size):
    """A ball that lies deep in the ground takes no more of it than it does for MuJoCo."""
    text = f'<geom type="{kind}" size="{" ".join(map(str, size))}" pos="9 0.2 0.3" euler="80 10 20"/>'
    model = make_world(FLOOR, text).mujoco_model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    pose = Pose(data.geom_xmat[1].reshape(3, 3), data.geom_xpos[1])
    corners = pose.inverse() @ world_triangles(model, np.full(3, -20.0), np.full(3, 20.0))[2:]
    parts = np.random.default_rng(0).dirichlet(np.ones(3), (20, len(corners)))
    points = np.einsum("nkc,kcx->nkx", parts, corners).reshape(-1, 3)
    if kind == "capsule":
        points[:, 2] -= np.clip(points[:, 2], -size[1], size[1])
    radii = np.array(size if kind == "ellipsoid" else size[:1] * 3)
    beyond = np.linalg.norm(points / radii, axis=1) - 1.0
    assert beyond.min() > 0.0 and beyond.max() * radii.max() < 0.0105


@pytest.mark.parametrize(("used", "slides"), [(0.93, False), (0.975, True), (1.05, True)])
def test_ground_on_which_plans_have_no_friction_left_slides(robot, used, slides):
    """Feet could rest a little below the friction angle, but a plan that rests there has nothing left to steer with."""
    angle = np.arctan(0.5 * used)
    drop, along = 2.0 * np.sin(angle), 2.0 * np.cos(angle)
    upper = box([-0.5, 0, -0.02], [0.5, 0.6, 0.02], friction=0.5)
    lower = box([along + 0.5, 0, -drop - 0.02], [0.5, 0.6, 0.02], friction=0.5)
    middle = np.array([along / 2, 0, -drop / 2]) - 0.02 * np.array([np.sin(angle), 0, np.cos(angle)])
    slope = box(middle, [1.0, 0.6, 0.02], (0, float(np.degrees(angle)), 0), friction=0.5)
    world = make_world(upper, slope, lower, start=(-0.4, 0, 0), goal=(along + 0.5, 0, -drop))
    ground = Ground(robot, world, PlannerConfig())
    way = ground.way(ground.start_stance())
    assert way.slides == slides
    assert (way.forced > 0.0) or not slides
