"""Unions and differences keep every part, also where sides coincide but for rounding."""

import numpy as np
import pytest
import shapely

from tests.world.probe import random_points, ray_gap
from toolkit.world.loader import load_world
from toolkit.world.overlay import cut, overlap, united

# Three prisms of a height field seen from below; the plain union of GEOS 3.14 loses the first without an error.
PRISMS = (
    "POLYGON ((-0.7806666666666668 -1.428, -0.1140000000000001 0.5720000000000001, -0.1140000000000001 -1.428, "
    "-0.7806666666666668 -1.428))",
    "POLYGON ((-0.7806666666666668 -1.428, -0.7806666666666668 0.572, -0.1140000000000001 0.5720000000000001, "
    "-0.1140000000000001 0.572, -0.7806666666666668 -1.428))",
    "POLYGON ((-0.7806666666666668 0.572, -0.7806666666666668 0.5720000000000001, -0.1140000000000001 2.572, "
    "-0.1140000000000001 0.572, -0.7806666666666668 0.572))",
)
FIELD = """
<mujoco>
  <asset><hfield name="field" nrow="{rows}" ncol="{columns}" size="{size}" elevation="{heights}"/></asset>
  <worldbody>
    <geom type="box" name="platform" size="{platform} 0.6 0.02" pos="0 0 -0.02"/>
    <geom type="hfield" hfield="field" pos="{place}"/>
    <site name="start" pos="{start}"/>
    <site name="goal" type="cylinder" pos="1 0 0" size="0.2 0.005"/>
  </worldbody>
</mujoco>
"""


def jittered(rng):
    """Triangles of a grid, sheared and turned, whose common corners differ in the last digits, and their whole area."""
    turn = np.linalg.qr(rng.normal(size=(2, 2)))[0] @ [[1, rng.normal()], [0, 1]]
    rows, columns = rng.integers(1, 5, 2)
    triangles = []
    for x, y in np.ndindex(rows, columns):
        a, b, c, d = ([x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1])
        triangles += [[a, b, c], [a, c, d]]
    points = np.array(triangles, float) @ turn.T / 3 + rng.normal(size=2)
    points *= 1 + rng.choice([-2e-16, 0, 2e-16], points.shape)
    return shapely.polygons(points), rows * columns * abs(np.linalg.det(turn)) / 9


def test_union_keeps_every_part():
    shapes = shapely.from_wkt(PRISMS)
    union = united(shapes)
    assert union.area == pytest.approx(sum(shape.area for shape in shapes), abs=1e-6)
    assert all(shapely.dwithin(union, shape.centroid, 1e-9) for shape in shapes)


def test_union_and_cut_of_triangles_that_nearly_touch():
    rng = np.random.default_rng(5)
    for _ in range(150):
        shapes, area = jittered(rng)
        union = united(rng.permutation(shapes))
        assert union.area == pytest.approx(area, abs=1e-7)
        left = np.array([union], object)
        for shape in rng.permutation(shapes):
            before = left[0].area
            assert overlap(left, np.array([shape])).all()
            left = cut(left, np.array([shape]))
            assert left[0].area == pytest.approx(before - shape.area, abs=1e-7)


def test_sides_in_common_are_no_overlap():
    squares = shapely.box([0, 1, 0, 0.99], 0, [1, 2, 1, 2], 1).reshape(2, 2)
    assert overlap(squares[:, 0], squares[:, 1]).tolist() == [False, True]


def world_of(heights, size, place="0 0 0.05", start="0 0 0", platform=0.6):
    rows, columns = heights.shape
    text = " ".join(f"{value:.3f}" for value in heights.ravel())
    field = {"rows": rows, "columns": columns, "heights": text, "size": size}
    return load_world("x.xml", mjcf=FIELD.format(**field, place=place, start=start, platform=platform))


def check_rays(world, rng, count):
    for surface in world.surfaces:
        gaps = ray_gap(world.mujoco_model, surface, random_points(surface, rng, count, inset=1e-3), height=0.149)
        assert (np.abs(gaps) < 1.7e-3).all(), f"surface {surface.index} of {surface.geom}: rays meet it at {gaps}"


def test_a_height_field_covers_the_platform_below_it():
    heights = np.array([[0, 1, 0, 1], [0, 0, 0, 0], [1, 1, 1, 1]])
    world = world_of(heights, "1 2 0.3 0.1", place="-1.114 0.572 0.216", start="0.2 0 0")
    check_rays(world, np.random.default_rng(0), 60)
    platform = next(surface for surface in world.surfaces if surface.geom == "platform")
    assert np.isnan(platform.height(np.array([[-0.172, -0.093], [-0.25, -0.53], [-0.2, 0.3]]))).all()


def test_rough_height_fields_are_covered_by_themselves():
    rng = np.random.default_rng(3)
    for _ in range(6):
        world = world_of(rng.random((24, 24)) ** 2, "0.64 0.64 0.3 0.1", start="0.8 0 0", platform=1)
        check_rays(world, rng, 6)
