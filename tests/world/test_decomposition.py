"""Facets, convex pieces, and meshes as convex solids."""

import numpy as np
import pytest
import shapely
import trimesh
from shapely.geometry import Polygon

from toolkit.world.convex import convex_partition, is_convex, simplified
from toolkit.world.decomposition import decompose_mesh
from toolkit.world.facets import find_facets
from toolkit.world.mesh_patches import closed_block


def random_region(rng):
    """A connected region with corners that turn in, and holes."""
    centres = rng.uniform(-1, 1, (5, 2))
    shape = shapely.union_all(
        [shapely.box(-0.5, -0.5, 0.5, 0.5), *(Polygon(c + rng.normal(0, 0.6, (3, 2))) for c in centres)]
    )
    shape = shape.difference(shapely.box(*rng.uniform(-0.4, 0, 2), *rng.uniform(0.1, 0.3, 2)))
    return max(shapely.get_parts(shape), key=lambda part: part.area)


@pytest.mark.parametrize("seed", range(30))
def test_convex_partition_covers_without_overlap(seed):
    region = random_region(np.random.default_rng(seed))
    pieces = [Polygon(piece) for piece in convex_partition(region)]
    assert all(is_convex(np.asarray(piece.exterior.coords)[:-1], 1e-7) for piece in pieces)
    assert sum(piece.area for piece in pieces) == pytest.approx(region.area, rel=1e-6)
    assert shapely.union_all(pieces).symmetric_difference(region).area < 1e-6


def test_convex_region_is_one_piece():
    (piece,) = convex_partition(shapely.box(0, 0, 2, 1))
    assert len(piece) == 4


def test_a_curved_mesh_does_not_drift_into_one_facet():
    # Strips of 1 degree each, a quarter circle in all.
    angle = np.radians(np.arange(91))
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.concatenate([np.column_stack([ring, np.full(91, z)]) for z in (0.0, 1.0)])
    first = np.arange(90)
    faces = np.concatenate(
        [np.column_stack([first, first + 1, first + 92]), np.column_stack([first, first + 92, first + 91])]
    )
    mesh = trimesh.Trimesh(points, faces, process=False)
    facets = find_facets(mesh, angle=np.radians(3), distance=1.5e-3)
    assert 12 < len(facets) < 45
    assert sorted(np.concatenate([facet.triangles for facet in facets])) == list(range(180))
    for facet in facets:
        local = facet.frame.inverse() @ points[faces[facet.triangles]]
        assert np.abs(local[..., 2]).max() < 3e-3


def test_convex_meshes_are_left_alone():
    for mesh in (
        trimesh.creation.box((1, 2, 3)),
        trimesh.creation.icosphere(subdivisions=2),
        trimesh.creation.cone(1, 1),
    ):
        assert decompose_mesh(mesh.vertices, mesh.faces) is None
    turned_in = trimesh.creation.box((1, 1, 1))
    assert decompose_mesh(turned_in.vertices, turned_in.faces[:, ::-1]) is None


def test_separate_convex_blocks_become_a_solid_each():
    blocks = [trimesh.creation.box((1, 1, 1)).apply_translation([3 * i, 0, 0]) for i in range(3)]
    both = trimesh.util.concatenate(blocks)
    result = decompose_mesh(both.vertices, both.faces)
    assert len(result.parts) == 3 and len(result.facets) == 18


def solid_part(points):
    return trimesh.convex.convex_hull(points)


@pytest.mark.parametrize("thickness", [0.5, 0.03])
def test_parts_have_their_face_on_the_mesh_and_stay_inside(thickness):
    # A floor with a wall on it, in one closed piece.
    profile = Polygon([(-1, -0.3), (1, -0.3), (1, 0), (thickness, 0), (thickness, 1), (0, 1), (0, 0), (-1, 0)])
    mesh = trimesh.creation.extrude_polygon(profile, 1.5)
    result = decompose_mesh(mesh.vertices, mesh.faces)
    assert sum(facet.polygon.area for facet in result.facets) == pytest.approx(mesh.area, rel=1e-6)
    hull = [solid_part(points) for points in result.parts]
    for part in hull:
        flat = part.vertices[:, :2]
        assert shapely.distance(profile, shapely.points(flat)).max() < 1e-6
        assert part.vertices[:, 2].min() > -1e-6 and part.vertices[:, 2].max() < 1.5 + 1e-6
    # Every point of the mesh's surface is on a part.
    points, _ = trimesh.sample.sample_surface(mesh, 300, seed=1)
    nearest = np.full(len(points), np.inf)
    for part in hull:
        normals, origins = part.face_normals, part.triangles[:, 0]
        outside = ((points[:, None] - origins) * normals).sum(-1).max(axis=1)
        nearest = np.minimum(nearest, outside)
    assert nearest.max() < 1e-6 and nearest.min() > -1e-6


def test_mesh_without_area():
    with pytest.raises(ValueError, match="no triangle with an area"):
        decompose_mesh(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]]), np.array([[0, 1, 2]]))


def test_a_spike_of_no_width_is_cut_off():
    spiked = Polygon([(0.1, -0.3), (0.1, 0.3), (-0.3, 0.3), (-0.1, 0.3), (-0.1, -0.3)])
    pieces = convex_partition(spiked)
    assert sum(Polygon(piece).area for piece in pieces) == pytest.approx(0.12, abs=1e-6)


@pytest.mark.parametrize("start", range(7))
def test_corners_that_hardly_turn_are_left_out(start):
    ring = np.array([[0, 0], [0.5, -2e-5], [1, 0], [1, 0.4], [1, 0.8], [0.5, 0.9], [0, 0.8]])
    kept = simplified(np.roll(ring, start, axis=0), 1e-4)
    assert {tuple(corner) for corner in kept} == {tuple(ring[index]) for index in (0, 2, 4, 5, 6)}


def test_slightly_bent_ground_takes_nothing_from_the_flat_patch_beside_it():
    x, y = np.meshgrid(np.arange(12) * 0.1, np.arange(8) * 0.1, indexing="ij")
    heights = np.where(x > 0.65, 0.002 * (x - 0.6) / 0.1, 0.0)  # 1.1 deg; the triangles of both are equally large
    mesh = closed_block(x[:, 0], y[0], heights)
    facets = find_facets(mesh, angle=np.radians(3), distance=1.5e-3)
    flat = next(facet for facet in facets if facet.frame.rotation[2, 2] > 0.9)
    assert shapely.box(-1, -1, 0.6, 1).intersection(
        shapely.transform(flat.polygon, lambda xy: (flat.frame @ np.c_[xy, np.zeros(len(xy))])[:, :2])
    ).area == pytest.approx(0.6 * 0.7, rel=1e-3)
