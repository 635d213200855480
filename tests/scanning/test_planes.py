"""Planes found in noise, and what stands for them."""

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

from tests.scanning.conftest import joined, noisy, sheet
from toolkit.geometry.pose import Pose
from toolkit.scanning.outline import outline, tidy
from toolkit.scanning.patches import read_samples
from toolkit.scanning.rough import blobs
from toolkit.scanning.samples import Scan, samples_of


def tilted(roll: float, pitch: float, position) -> Pose:
    return Pose(Rotation.from_euler("xy", [roll, pitch], degrees=True).as_matrix(), np.array(position, float))


TILES = [tilted(0, 0, [0, 0, 0]), tilted(12, -8, [0.5, 0, 0.06]), tilted(-15, 10, [1.0, 0, -0.03])]


@pytest.mark.parametrize("sigma", [0.0, 0.005, 0.02])
def test_tiles_are_found_under_noise(sigma):
    scan = joined(*(noisy(sheet(pose, (0.45, 0.45)), sigma, seed) for seed, pose in enumerate(TILES)))
    reading = read_samples(samples_of(scan, 0.02))
    assert reading.explained > 0.95
    assert sigma / 3 < reading.noise < 1.5 * sigma + 2e-3
    for pose in TILES:
        at = [patch for patch in reading.patches if np.linalg.norm(patch.frame.position - pose.position) < 0.1]
        (patch,) = [patch for patch in at if patch.polygon.area > 0.1]
        angle = np.degrees(np.arccos(np.clip(patch.frame.normal @ pose.normal, -1, 1)))
        assert angle < 0.1 + 100 * sigma
        assert abs((patch.frame.position - pose.position) @ pose.normal) < 1e-3 + 0.15 * sigma
        # The outline keeps a margin of the noise, and rounds the corners a little.
        assert (0.45 - 4 * sigma - 0.05) ** 2 < patch.polygon.area < 0.46**2


def test_the_points_of_a_cloud_do_as_well_and_face_up():
    scan = joined(*(noisy(sheet(pose, (0.45, 0.45)), 0.01, seed) for seed, pose in enumerate(TILES)))
    reading = read_samples(samples_of(Scan(scan.vertices, np.zeros((0, 3), int)), 0.02))
    assert sum(patch.polygon.area > 0.1 for patch in reading.patches) == 3
    assert all(patch.frame.normal[2] > 0 for patch in reading.patches)


def test_a_wall_in_a_cloud_faces_the_ground_beside_it():
    wall = sheet(Pose(Rotation.from_euler("x", 90, degrees=True).as_matrix(), np.array([0, 0.6, 0.5])), (1.0, 1.0))
    cloud = joined(sheet(Pose.from_yaw(np.zeros(3), 0.0), (1.2, 1.2)), wall).vertices
    reading = read_samples(samples_of(Scan(cloud, np.zeros((0, 3), int)), 0.02))
    (found,) = [patch for patch in reading.patches if abs(patch.frame.normal[2]) < 0.1]
    np.testing.assert_allclose(found.frame.normal, [0, -1, 0], atol=1e-3)


def test_a_mesh_wound_the_other_way_is_turned():
    scan = noisy(sheet(TILES[1], (0.5, 0.5)), 0.01)
    reading = read_samples(samples_of(Scan(scan.vertices, scan.triangles[:, ::-1]), 0.02))
    assert reading.patches[0].frame.normal[2] > 0.9


def test_the_outline_of_a_blurred_square_is_the_square():
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.3, 0.3, (6000, 2)) + rng.normal(0, 0.015, (6000, 2))
    (region,) = outline(points, np.ones(6000), 0.03, 0.1)
    assert region.hausdorff_distance(shapely.box(-0.3, -0.3, 0.3, 0.3)) < 0.05  # at the corners
    assert region.area == pytest.approx(0.36, rel=0.02)


def test_small_holes_close_and_large_ones_stay():
    points = np.random.default_rng(0).uniform(-0.6, 0.6, (20000, 2))
    for radius, holes in ((0.07, 0), (0.25, 1)):
        kept = points[np.linalg.norm(points, axis=1) > radius]
        (region,) = outline(kept, np.ones(len(kept)), 0.03, 0.1)
        assert len(region.interiors) == holes


def test_tidy_takes_a_spike_off():
    spiked = shapely.union_all([shapely.box(0, 0, 0.4, 0.4), shapely.box(0.4, 0.2, 0.7, 0.22)])
    (region,) = tidy(spiked, 0.01, 0.06)
    assert region.symmetric_difference(shapely.box(0, 0, 0.4, 0.4)).area < 1e-3


def test_triangles_of_any_size_give_samples_of_the_same_area():
    scan = Scan(
        np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0.01, 0, 1], [0.02, 0, 1], [0.01, 0.01, 1.0]]),
        np.arange(6).reshape(2, 3),
    )
    samples = samples_of(scan, 0.02)
    assert samples.area.sum() == pytest.approx(2.0 + 5e-5)
    np.testing.assert_allclose(samples.turned.sum(axis=0), [0, 0, 2.0 + 5e-5])
    assert samples.weight.sum() == pytest.approx(samples.area.sum())
    low = samples.points[samples.points[:, 2] < 0.5]
    np.testing.assert_allclose(np.average(low, axis=0), [2 / 3, 2 / 3, 0], atol=1e-9)


def test_a_scene_that_is_too_large_is_refused():
    from toolkit.errors import InputError

    points = np.random.default_rng(0).uniform(0, 100, (400_000, 3)) * [1, 1, 0]
    with pytest.raises(InputError, match="too far to find places for feet"):
        samples_of(Scan(points, np.zeros((0, 3), int)), 0.02)


def test_rough_points_lie_in_ellipsoids_and_specks_are_left_out():
    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0, 0], [0.5, 0.5, 0.15], (4000, 3))
    found = blobs(np.concatenate([points, [[3.0, 3.0, 3.0]]]), 0.02, 0.0)
    assert len(found) < 60
    inside = np.zeros(len(points), bool)
    for blob in found:
        inside |= (np.square(blob.rotation.inv().apply(points - blob.centre) / (blob.diameters / 2)).sum(axis=1)) <= 1
        assert np.linalg.norm(blob.centre) < 1.0
    assert inside.mean() > 0.9


def test_the_same_scan_gives_the_same_patches():
    scan = joined(*(noisy(sheet(pose, (0.45, 0.45)), 0.02, seed) for seed, pose in enumerate(TILES)))
    first, second = (read_samples(samples_of(scan, 0.02)) for _ in range(2))
    assert [patch.polygon.wkb for patch in first.patches] == [patch.polygon.wkb for patch in second.patches]
