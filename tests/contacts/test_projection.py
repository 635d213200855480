from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import shapely

from toolkit.contacts.projection import ProjectionConfig, Projector, shifts
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose, rotation_on_surface, yaw_of
from toolkit.robot.scale import USUAL
from toolkit.world.surface import Surface

HALF = np.array([[0.11, 0.065], [0.11, 0.065], [0.04, 0.04], [0.04, 0.04]])
ROBOT = SimpleNamespace(half_sizes=HALF, scale=USUAL, foot_room=lambda margin: HALF[0] + margin)
EMPTY = mujoco.MjModel.from_xml_string("<mujoco/>")
SOLE = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * [0.11, 0.065]


def random_surface(rng, index):
    """A tilted region that is not convex, with a hole now and then."""
    points = rng.uniform(-0.6, 0.6, (7, 2))
    region = shapely.concave_hull(shapely.MultiPoint(points), ratio=0.3).buffer(0.1, quad_segs=2)
    if rng.random() < 0.5:
        region = region.difference(shapely.Point(*rng.uniform(-0.2, 0.2, 2)).buffer(0.05, quad_segs=2))
    region = max(shapely.get_parts(region), key=lambda part: part.area)
    region = shapely.geometry.polygon.orient(region)
    rings = [np.asarray(ring.coords)[:-1] for ring in (region.exterior, *region.interiors)]
    tilt = rng.uniform(-0.35, 0.35, 2)
    normal = np.array([tilt[0], tilt[1], 1.0]) / np.linalg.norm([*tilt, 1.0])
    pose = Pose(rotation_on_surface(normal, rng.uniform(-3, 3)), rng.uniform([-1, -1, -0.2], [1, 1, 0.2]))
    return Surface(index, f"s{index}", pose, tuple(rings), (rings[0],), 0.5, True, False), region


def fits(region, surface, position, rotation, half):
    corners = Pose(rotation, position) @ np.column_stack([np.sign(SOLE) * half, np.zeros(4)])
    return region.buffer(1e-9).covers(shapely.Polygon((surface.pose.inverse() @ corners)[:, :2]))


def test_soles_lie_wholly_on_the_highest_surface_that_holds_them():
    rng = np.random.default_rng(0)
    surfaces, regions = zip(*(random_surface(rng, i) for i in range(12)), strict=True)
    projector = Projector(ROBOT, surfaces, EMPTY, ProjectionConfig(margin=0.01))
    half = np.array([0.12, 0.075])
    pose = np.column_stack([rng.uniform(-1.5, 1.5, (400, 2)), rng.uniform(-4, 4, 400)])
    result = projector.project_soles(Limb.LEFT_FOOT, pose, -0.5, 0.4, shift=False)
    assert 30 < result.found.sum() < 370
    for row in range(len(pose)):
        valid = []
        for surface, region in zip(surfaces, regions, strict=True):
            n, o = surface.normal, surface.pose.position
            z = o[2] - n[:2] @ (pose[row, :2] - o[:2]) / n[2]
            position, rotation = np.array([*pose[row, :2], z]), rotation_on_surface(n, pose[row, 2])
            if -0.5 <= z <= 0.4 and fits(region, surface, position, rotation, half):
                valid.append((z, surface.index))
        assert result.found[row] == bool(valid)
        if valid:
            assert result.surface[row] == max(valid)[1]
            surface = surfaces[result.surface[row]]
            np.testing.assert_allclose(result.position[row, 2], max(valid)[0], atol=1e-12)
            np.testing.assert_allclose(
                result.rotation[row], rotation_on_surface(surface.normal, pose[row, 2]), atol=1e-12
            )


def test_shifted_soles_fit_and_move_no_further_than_allowed():
    rng = np.random.default_rng(1)
    surfaces, regions = zip(*(random_surface(rng, i) for i in range(12)), strict=True)
    config = ProjectionConfig(margin=0.01, shift=0.06)
    projector = Projector(ROBOT, surfaces, EMPTY, config)
    pose = np.column_stack([rng.uniform(-1.5, 1.5, (2000, 2)), rng.uniform(-4, 4, 2000)])
    strict = projector.project_soles(Limb.RIGHT_FOOT, pose, -0.5, 0.4, shift=False)
    shifted = projector.project_soles(Limb.RIGHT_FOOT, pose, -0.5, 0.4)
    np.testing.assert_array_equal(shifted.position[strict.found], strict.position[strict.found])
    gained = shifted.found & ~strict.found
    assert gained.sum() > 50
    for row in np.flatnonzero(gained):
        index = shifted.surface[row]
        position, rotation = shifted.position[row], shifted.rotation[row]
        assert fits(regions[index], surfaces[index], position, rotation, np.array([0.12, 0.075]))
        assert np.linalg.norm(position[:2] - pose[row, :2]) <= 0.06 + 1e-9
        assert abs(np.angle(np.exp(1j * (yaw_of(rotation) - pose[row, 2])))) < 1e-9


def test_mirrored_world_gives_mirrored_soles():
    rng = np.random.default_rng(2)
    mirror = np.diag([1.0, -1.0, 1.0])
    surfaces = [random_surface(rng, i)[0] for i in range(12)]
    mirrored = []
    for s in surfaces:
        # Mirror the region in the world; a frame stays right-handed by mirroring its own y axis too.
        pose = Pose(mirror @ s.pose.rotation @ mirror, mirror @ s.pose.position)
        rings = tuple((ring * [1, -1])[::-1] for ring in s.boundary)
        mirrored.append(Surface(s.index, s.geom, pose, rings, rings[:1], 0.5, True, False))
    pose = np.column_stack([rng.uniform(-1.5, 1.5, (2000, 2)), rng.uniform(-4, 4, 2000)])
    one = Projector(ROBOT, surfaces, EMPTY).project_soles(Limb.LEFT_FOOT, pose, -0.5, 0.5, outward=1)
    other = Projector(ROBOT, mirrored, EMPTY).project_soles(Limb.RIGHT_FOOT, pose * [1, -1, -1], -0.5, 0.5, outward=-1)
    np.testing.assert_array_equal(one.surface, other.surface)
    np.testing.assert_allclose(one.position[one.found] * [1, -1, 1], other.position[one.found], atol=1e-12)


def box(index, position, yaw_normal, half=0.3):
    ring = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    x = np.cross([0, 0, 1.0], yaw_normal)
    rotation = np.stack([x, np.cross(yaw_normal, x), yaw_normal], 1)
    return Surface(index, f"wall{index}", Pose(rotation, np.array(position, float)), (ring,), (ring,), 0.5, False, True)


SIDE = np.array([0.0, -1.0, 0.0])


def test_palm_lands_on_the_nearest_surface_with_its_hand_forwards():
    surfaces = [box(0, [0, 0.9, 1.2], SIDE), box(1, [0, 0.7, 1.2], SIDE)]
    projector = Projector(ROBOT, surfaces, EMPTY)
    rays = np.array([[0.0, 1.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    palm = projector.project_palms(Limb.LEFT_PALM, np.array([0, 0.2, 1.2]), rays, 0.0, 1.0)
    # The second ray leaves the nearer panel and has no room on the farther one either.
    assert palm.surface.tolist() == [1, -1, -1, -1]
    np.testing.assert_allclose(palm.position[0], [0, 0.7, 1.2], atol=1e-12)
    np.testing.assert_allclose(palm.rotation[0], np.stack([[1, 0, 0], [0, 0, 1], SIDE], 1), atol=1e-12)


def test_palm_on_a_wall_ahead_points_up():
    ahead = np.array([-1.0, 0.0, 0.0])
    projector = Projector(ROBOT, [box(0, [0.6, 0, 1.2], ahead)], EMPTY)
    palm = projector.project_palms(Limb.LEFT_PALM, np.array([0, 0.2, 1.2]), np.array([[1.0, 0, 0]]), 0.0, 1.0)
    np.testing.assert_allclose(palm.rotation[0], np.stack([[0, 0, 1], [0, 1, 0], ahead], 1), atol=1e-12)


def test_blocked_palm_is_rejected():
    blocked = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom type='sphere' size='0.05' pos='0 0.5 1.2'/></worldbody></mujoco>"
    )
    surfaces, ray, shoulder = [box(0, [0, 0.7, 1.2], SIDE)], np.array([[0.0, 1.0, 0.0]]), np.array([0, 0.2, 1.2])
    assert Projector(ROBOT, surfaces, EMPTY).project_palms(Limb.LEFT_PALM, shoulder, ray, 0.0, 1.0).found.all()
    assert not Projector(ROBOT, surfaces, blocked).project_palms(Limb.LEFT_PALM, shoulder, ray, 0.0, 1.0).found.any()


@pytest.mark.parametrize("edge", [0.25, 0.27])
def test_palm_needs_its_whole_patch_on_the_surface(edge):
    projector = Projector(ROBOT, [box(0, [0, 0.7, 1.2], SIDE)], EMPTY, ProjectionConfig(palm_margin=0.005))
    shoulder = np.array([edge, 0.2, 1.2])
    palm = projector.project_palms(Limb.LEFT_PALM, shoulder, np.array([[0.0, 1.0, 0.0]]), 0.0, 1.0)
    assert palm.found[0] == (edge + 0.045 <= 0.3)


def test_shifts_are_sorted_and_symmetric():
    offsets = shifts(0.06, 0.02)
    lengths = np.linalg.norm(offsets, axis=1)
    assert (offsets[0] == 0).all() and (np.diff(lengths) >= -1e-12).all() and lengths.max() <= 0.06 + 1e-12
    assert {tuple(np.round(row, 3)) for row in offsets} == {tuple(np.round(row * [1, -1], 3) + 0.0) for row in offsets}
    assert len(shifts(0.0, 0.02)) == 1


def test_feet_that_are_wider_than_their_soles_keep_off_edges_where_they_can():
    wide = SimpleNamespace(half_sizes=HALF, scale=USUAL, foot_room=lambda margin: HALF[0] + margin + 0.03)
    for half, spare in ((0.2, 0.05), (0.13, 0.01)):  # room for the whole foot, and for the sole alone
        corners = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        surface = Surface(0, "stone", Pose(np.eye(3), np.zeros(3)), (corners,), (corners,), 0.5, True, False)
        projector = Projector(wide, [surface], EMPTY, ProjectionConfig(margin=0.01, shift=0.06, shift_step=0.005))
        found = projector.project_soles(Limb.LEFT_FOOT, np.array([[spare + 0.03, 0.0, 0.0]]), -1.0, 1.0)
        assert found.position[0, 0] == pytest.approx(spare, abs=0.0051)
