"""Surfaces of scenes whose answer is known."""

import numpy as np
import pytest
import shapely
import trimesh

from tests.world.probe import area_of, ball_gap, random_points, ray_gap
from toolkit.errors import WorldError
from toolkit.world.extraction import SurfaceConfig

BOX_TOP = '<geom name="slab" type="box" size="1 0.8 0.1" pos="0 0 -0.1"/>'


def tops(world):
    return [surface for surface in world.surfaces if surface.serves_foot]


def total(surfaces):
    return sum(area_of(surface) for surface in surfaces)


def mesh_asset(name, mesh):
    vertices = " ".join(f"{v:.7f}" for v in np.ravel(mesh.vertices))
    faces = " ".join(str(i) for i in np.ravel(mesh.faces))
    return f'<mesh name="{name}" vertex="{vertices}" face="{faces}"/>'


def test_box(make_world):
    world = make_world(BOX_TOP)
    (top,) = tops(world)
    assert top.geom == "slab" and top.friction == 1.0
    assert area_of(top) == pytest.approx(1.6 * 2, rel=1e-9)
    np.testing.assert_allclose(top.normal, [0, 0, 1], atol=1e-12)
    sides = [surface for surface in world.surfaces if surface.serves_palm]
    assert sorted(round(area_of(side), 6) for side in sides) == [0.32, 0.32, 0.4, 0.4]
    assert {tuple(np.round(side.normal, 9) + 0.0) for side in sides} == {(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)}
    assert [surface.index for surface in world.surfaces] == list(range(5))


def test_rotated_box_in_a_moved_body(make_world):
    world = make_world(
        '<body pos="0.1 0 0.2" euler="0 0 40">'
        '<geom type="box" size="0.5 0.4 0.3" pos="0 0 -0.3" euler="15 0 0"/></body>',
        start="0.1 0 0.2",
    )
    (top,) = tops(world)
    assert top.geom == "box#0"
    assert area_of(top) == pytest.approx(0.8, rel=1e-9)
    expected = np.array([np.sin(np.radians(40)), -np.cos(np.radians(40)), 0]) * np.sin(np.radians(15))
    np.testing.assert_allclose(top.normal, expected + [0, 0, np.cos(np.radians(15))], atol=1e-9)


@pytest.mark.parametrize(("size", "area"), [("0 0 1", 7.0 * 6.0), ("1.5 0.5 1", 3.0)])
def test_plane_is_cut_to_a_square_or_to_its_size(make_world, size, area):
    world = make_world(f'<geom type="plane" size="{size}"/>')
    assert total(tops(world)) == pytest.approx(area, rel=1e-9)
    assert world.square == (-3.0, -3.0, 4.0, 3.0)


def test_tilted_and_upright_planes(make_world):
    world = make_world(
        '<geom type="plane" size="0 0 1" euler="0 20 0"/><geom type="plane" size="0 0 1" pos="0 2 0" euler="90 0 0"/>'
    )
    assert {(s.serves_foot, s.serves_palm) for s in world.surfaces} == {(True, False), (False, True)}
    floor, wall = (next(s for s in world.surfaces if getattr(s, f"serves_{n}")) for n in ("foot", "palm"))
    np.testing.assert_allclose(wall.normal, [0, -1, 0], atol=1e-12)
    # The wall's half space covers the floor from y = 2 on; the floor's covers the wall below z = -x tan 20.
    assert area_of(floor) == pytest.approx(7.0 * (3 + 2) / np.cos(np.radians(20)), rel=2e-3)


def test_cylinder_has_caps_only(make_world):
    world = make_world('<geom type="cylinder" size="0.5 0.3" pos="0 0 -0.3"/>')
    (top,) = world.surfaces
    assert area_of(top) == pytest.approx(np.pi * 0.25, rel=2e-3)  # a 64-gon on the circle
    lying = make_world(
        '<geom type="plane" size="0 0 1"/><geom type="cylinder" size="0.3 0.5" pos="0 2 0.3" euler="90 0 0"/>'
    )
    caps = [surface for surface in lying.surfaces if surface.serves_palm]
    assert len(caps) == 2 and all(abs(cap.normal[1]) == pytest.approx(1, abs=1e-9) for cap in caps)


@pytest.mark.parametrize(
    "kind", ['type="sphere" size="0.4"', 'type="capsule" size="0.2 0.5"', 'type="ellipsoid" size=".5 .4 .3"']
)
def test_round_geoms_are_obstacles_only(make_world, kind):
    world = make_world(f'<geom name="floor" type="plane" size="0 0 1"/><geom {kind} pos="2 2 0"/>')
    (floor,) = world.surfaces
    assert floor.geom == "floor" and len(floor.boundary) == 2
    # The hole is the part of the geom's shadow from 1 mm to 15 cm up.
    hole = 42.0 - area_of(floor)
    expected = {"sphere": np.pi * 0.16, "capsule": np.pi * 0.04, "ellipsoid": np.pi * 0.2}[kind.split('"')[1]]
    assert hole == pytest.approx(expected, rel=0.05)


def test_convex_mesh(make_world):
    prism = trimesh.creation.cylinder(radius=0.5, height=0.4, sections=6)
    prism.apply_translation([0, 0, -0.2])
    world = make_world('<geom type="mesh" mesh="m" pos="0.1 0 0"/>', assets=mesh_asset("m", prism))
    assert world.mujoco_model.ngeom == 1
    (top,) = tops(world)
    assert area_of(top) == pytest.approx(3 * np.sqrt(3) / 2 * 0.25, rel=1e-6)
    assert len([s for s in world.surfaces if s.serves_palm]) == 6


def l_shape():
    """A closed mesh of an L seen from above, 0.3 m high, its top at z = 0, and one of its inner corners at (0, 0)."""
    polygon = np.array([[-1, -1], [1, -1], [1, 0], [0, 0], [0, 1], [-1, 1]], float)
    from shapely.geometry import Polygon

    return trimesh.creation.extrude_polygon(Polygon(polygon), 0.3).apply_translation([0, 0, -0.3])


def test_mesh_that_is_not_convex_collides_as_it_looks(make_world):
    world = make_world('<geom name="ell" type="mesh" mesh="m"/>', assets=mesh_asset("m", l_shape()), start="-.5 -.5 0")
    (top,) = tops(world)
    assert top.geom == "ell" and area_of(top) == pytest.approx(3.0, rel=1e-6)
    assert len(top.pieces) == 2 and sorted(len(piece) for piece in top.pieces) == [4, 4]
    assert len([s for s in world.surfaces if s.serves_palm]) == 6
    from toolkit.world.clearance import BoxCollider

    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :3, 3] = [[0.5, 0.5, -0.1], [0.5, -0.5, -0.01]]
    # Inside the mesh's hull, but not inside the mesh; and inside the mesh.
    assert BoxCollider(world).collide(poses, np.full(3, 0.1)).tolist() == [False, True]


def test_open_sheet_upside_down_is_turned(make_world):
    x, y = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), (0.2 * np.maximum(x, 0)).ravel()])
    corner = (np.arange(4)[:, None] * 5 + np.arange(4)).ravel()
    faces = np.concatenate(
        [np.column_stack([corner, corner + 6, corner + 5]), np.column_stack([corner, corner + 1, corner + 6])]
    )
    world = make_world(
        '<geom type="mesh" mesh="m"/>', assets=mesh_asset("m", trimesh.Trimesh(points, faces, process=False))
    )
    assert len(tops(world)) == 2
    assert total(tops(world)) == pytest.approx(2 + 2 * np.hypot(1, 0.2), rel=1e-5)


@pytest.mark.parametrize(("rows", "columns"), [(5, 9), (9, 5)])
def test_height_field(make_world, rows, columns):
    # Level left of the middle column, a 10 degree ramp right of it; the field is turned by 30 degrees.
    rise = np.maximum(np.linspace(-1, 1, columns), 0) * np.tan(np.radians(10))
    data = " ".join(f"{value:.8f}" for value in np.tile(rise / rise.max(), rows))
    asset = f'<hfield name="h" nrow="{rows}" ncol="{columns}" size="1 0.8 {rise.max():.8f} 0.2" elevation="{data}"/>'
    world = make_world('<geom type="hfield" hfield="h" euler="0 0 30"/>', assets=asset)
    surfaces = tops(world)
    assert sorted(round(area_of(s), 4) for s in surfaces) == [1.6, round(1.6 / np.cos(np.radians(10)), 4)]
    ramp = max(surfaces, key=area_of)
    assert np.degrees(np.arccos(ramp.normal[2])) == pytest.approx(10, abs=1e-3)


def test_rough_height_field_is_split_as_mujoco_splits_it(make_world):
    rng = np.random.default_rng(3)
    height = rng.uniform(0, 1, 36)
    asset = (
        '<hfield name="h" nrow="6" ncol="6" size="1.5 1.5 0.4 0.1" elevation="'
        + " ".join(f"{value:.6f}" for value in height)
        + '"/>'
    )
    world = make_world('<geom type="hfield" hfield="h"/>', assets=asset, start="0 0 0.3")
    assert len(tops(world)) > 30
    for surface in tops(world):
        points = random_points(surface, rng, 5, inset=0.01)
        # Triangles of a facet may lie 1.5 mm off its plane; the wrong diagonal would be off by centimetres.
        np.testing.assert_allclose(ray_gap(world.mujoco_model, surface, points), 0, atol=1.6e-3)
        np.testing.assert_allclose(ball_gap(world.mujoco_model, surface, points), 0, atol=1.6e-3)


def test_curved_ground_has_places_everywhere_that_bear_in_part(make_world):
    """A crest with a radius of 8 m, level where |x| > 1 m: facets overlap there, and no sole goes far to find room."""
    x = np.linspace(-2, 2, 81)
    rise = np.where(np.abs(x) < 1, np.sqrt(64 - np.clip(x, -1, 1) ** 2) - np.sqrt(63), 0.0)
    data = " ".join(f"{value:.8f}" for value in np.tile(rise / rise.max(), 21))
    asset = f'<hfield name="h" nrow="21" ncol="81" size="2 0.5 {rise.max():.8f} 0.2" elevation="{data}"/>'
    world = make_world('<geom type="hfield" hfield="h"/>', assets=asset, start="-1.5 0 0")
    level = [s for s in tops(world) if s.normal[2] > 1 - 1e-9 and abs(s.pose.position[0]) > 1]
    curved = [s for s in tops(world) if abs(s.pose.position[0]) < 0.9]
    assert [s.bearing for s in level] == [np.inf, np.inf]
    assert np.median([s.bearing for s in curved]) == pytest.approx(np.sqrt(2 * 4e-4 * 8), rel=0.05)
    sole = shapely.box(-0.12, -0.07, 0.12, 0.07)

    def held(place: float) -> bool:
        middles = [(s.pose.inverse() @ np.array([place, 0.0, s.pose.position[2]]))[:2] for s in curved]
        return any(
            s.region.contains(shapely.transform(sole, lambda points, by=middle: points + by))
            for s, middle in zip(curved, middles, strict=True)
        )

    found = [held(place) for place in np.linspace(-0.7, 0.7, 57)]
    assert all(any(found[begin : begin + 8]) for begin in range(0, 50))  # within 0.2 m of any place


def test_box_on_the_floor_leaves_a_hole(make_world):
    world = make_world(
        '<geom name="floor" type="plane" size="0 0 1"/><geom name="crate" type="box" size="0.3 0.2 0.2" pos="2 1 0.2"/>'
    )
    floor = next(s for s in world.surfaces if s.geom == "floor")
    assert len(floor.boundary) == 2
    assert area_of(floor) == pytest.approx(42 - 0.24, abs=4e-3)  # a hole is a millimetre wider than what makes it
    assert len(floor.pieces) <= 5
    crate = [s for s in world.surfaces if s.geom == "crate"]
    assert len(crate) == 5


@pytest.mark.parametrize(
    ("height", "covered"),
    [(0.14, True), (0.29, True), (0.31, False)],
)
def test_low_ceiling_covers_and_a_high_one_does_not(make_world, height, covered):
    world = make_world(
        '<geom name="floor" type="plane" size="0 0 1"/>'
        f'<geom name="roof" type="box" size="0.5 0.5 0.05" pos="2 1 {height + 0.05}" euler="0 0 20"/>'
    )
    floor = next(s for s in world.surfaces if s.geom == "floor")
    assert area_of(floor) == pytest.approx(41 if covered else 42, abs=5e-3)
    assert not any(s.geom == "roof" and s.normal[2] < 0 for s in world.surfaces)


@pytest.mark.parametrize("posts", [True, False])
def test_no_sole_has_room_below_a_bar_to_step_over(make_world, posts):
    """A foot would pass below it, and its shin would not."""
    stands = "".join(f'<geom type="box" size="0.02 0.02 0.095" pos="1 {y} 0.095"/>' for y in (-0.48, 0.48) if posts)
    world = make_world(
        '<geom name="floor" type="plane" size="0 0 1"/>'
        f'<geom type="box" size="0.02 0.5 0.015" pos="1 0 0.205"/>{stands}'
    )
    floor = next(s for s in world.surfaces if s.geom == "floor")
    assert area_of(floor) == pytest.approx(42 - 0.04, abs=5e-3)
    assert not floor.region.covers(shapely.Point(*(floor.pose.inverse() @ np.array([1.0, 0.0, 0.0]))[:2]))


@pytest.mark.parametrize("angle", [0.0, 25.0])
def test_what_stands_on_the_ground_covers_it_up_to_the_clearance(make_world, angle):
    """A wall beside a slope that falls towards it takes no more of it than what a foot needs."""
    found = []
    for height in (0.1499, 1.0):  # m above the slope, along its normal; walls reach below it
        along = height / np.cos(np.radians(angle))
        world = make_world(
            f'<body euler="0 {angle} 0"><geom name="slope" type="box" size="1 1 0.1" pos="0 0 -0.1"/></body>'
            f'<geom type="box" size="0.1 2 2" pos="0.5 0 {-2.0 - 0.5 * np.tan(np.radians(angle)) + along}"/>'
        )
        found.append(max(area_of(s) for s in world.surfaces if s.geom == "slope" and s.serves_foot))
    assert found[0] == pytest.approx(found[1], abs=0.06 if angle else 1e-6)


def test_clearance_is_measured_along_the_normal(make_world):
    # A roof parallel to a slope of 40 degrees, 0.31 m away along the normal: 0.4 m straight up.
    world = make_world(
        '<body euler="0 40 0"><geom name="slope" type="box" size="1 1 0.1" pos="0 0 -0.1"/>'
        '<geom name="roof" type="box" size="1 1 0.1" pos="0 0 0.41"/></body>'
    )
    slope = next(s for s in world.surfaces if s.geom == "slope" and s.serves_foot)
    assert area_of(slope) == pytest.approx(4.0, rel=1e-6)


def test_buried_faces_are_gone(make_world):
    world = make_world(
        '<geom name="hill" type="box" size="1 1 0.3" pos="0 0 -0.3"/>'
        '<geom name="buried" type="box" size="0.2 0.2 0.1" pos="0.1 0.1 -0.3"/>'
        '<geom name="half" type="box" size="0.2 0.2 0.2" pos="1 0 -0.2"/>'
    )
    names = {s.geom for s in world.surfaces}
    assert "buried" not in names
    half = [s for s in world.surfaces if s.geom.startswith("half") and s.serves_palm]
    assert len(half) == 3  # the side inside the hill is gone
    assert sorted(round(area_of(s), 3) for s in half) == [0.08, 0.08, 0.16]


def test_flush_boxes_of_equal_friction_are_one_surface(make_world):
    world = make_world(
        '<geom name="a" type="box" size="0.5 0.5 0.1" pos="0 0 -0.1"/>'
        '<geom name="b" type="box" size="0.5 0.4 0.1" pos="1.0005 0 -0.1004"/>'
    )
    (top,) = tops(world)
    assert top.geom == "a+b"
    assert area_of(top) == pytest.approx(1.8, rel=2e-3)
    assert len(top.boundary) == 1  # a sole may straddle the seam


@pytest.mark.parametrize(
    "second",
    [
        'size="0.5 0.5 0.1" pos="1 0 -0.1" friction="0.6"',
        'size="0.5 0.5 0.1" pos="1 0 -0.105"',
        'size="0.5 0.5 0.1" pos="1.017 0 -0.1"',
        'size="0.5 0.5 0.1" pos="1 0 -0.1" euler="0 0.6 0"',
    ],
    ids=["friction", "step", "gap", "angle"],
)
def test_boxes_that_are_not_flush_stay_apart(make_world, second):
    world = make_world(
        f'<geom name="a" type="box" size="0.5 0.5 0.1" pos="0 0 -0.1"/><geom name="b" type="box" {second}/>'
    )
    assert len(tops(world)) == 2
    for surface in tops(world):
        assert area_of(surface) == pytest.approx(1.0, abs=6e-3)


@pytest.mark.parametrize("seam", [0.005, 0.012, 0.015])
@pytest.mark.parametrize("board", [0.06, 0.09, 0.2])
def test_boards_with_seams_are_one_surface(make_world, seam, board):
    """Boards and pavers with joints bear soles as an unbroken floor does, however narrow they are."""
    rng = np.random.default_rng(3)
    boards = "".join(
        f'<geom name="b{i}" type="box" size="{board / 2} 0.5 0.05" '
        f'pos="{(board + seam) * i} 0 {-0.05 + rng.uniform(-4e-4, 4e-4):.5f}"/>'
        for i in range(12)
    )
    (top,) = tops(make_world(boards))
    assert area_of(top) == pytest.approx(12 * board + 11 * seam, rel=1e-3)
    assert len(top.boundary) == 1


@pytest.mark.parametrize("seam", [0.0, 0.012])
def test_boards_of_one_mesh_are_one_surface(make_world, seam):
    """A scene that was exported as one mesh bears as its parts do."""
    boards = [trimesh.creation.box((0.09, 1.0, 0.1)) for _ in range(12)]
    for i, board in enumerate(boards):
        board.apply_translation([(0.09 + seam) * i, 0, -0.05])
    assets = mesh_asset("m", trimesh.util.concatenate(boards))
    (top,) = tops(make_world('<geom type="mesh" mesh="m"/>', assets=assets))
    assert area_of(top) == pytest.approx(12 * 0.09 + 11 * seam, rel=1e-3)


def test_bars_wider_apart_than_a_seam_are_not_ground(make_world):
    bars = "".join(f'<geom type="box" size="0.02 0.5 0.05" pos="{0.06 * i} 0 -0.05"/>' for i in range(12))
    with pytest.raises(WorldError, match="surface"):
        make_world(bars)


def test_tiles_that_touch_in_a_blunt_corner_are_one_surface_there(make_world):
    """A polygon touches an edge with one of its corners: the gap on both sides is a seam near by."""
    prism = trimesh.creation.cylinder(radius=0.6, height=0.2, sections=16)
    world = make_world(
        '<geom name="round" type="mesh" mesh="round" pos="0 0 -0.1"/>'
        '<geom name="b" type="box" size="0.5 0.5 0.1" pos="1.1 0 -0.1"/>',
        assets=mesh_asset("round", prism),
    )
    (top,) = tops(world)
    assert top.geom in ("b+round", "round+b")


@pytest.mark.parametrize("seed", range(4))
def test_nothing_of_flush_tiles_that_touch_in_corners_is_lost(make_world, seed):
    """Of a floor of two kinds of tiles as much is ground as there are tiles, however they lie."""
    slippery = np.random.default_rng(seed).random((10, 6)) < 0.4
    tiles = "".join(
        f'<geom name="t{i}{j}" type="box" size="0.2 0.2 0.05" pos="{0.4 * i - 0.4:.1f} {0.4 * j - 1.0:.1f} -0.05" '
        f'friction="{0.2 if slippery[i, j] else 0.8}"/>'
        for i in range(10)
        for j in range(6)
    )
    found = tops(make_world(tiles))
    for friction, count in ((0.2, slippery.sum()), (0.8, (~slippery).sum())):
        same = [surface for surface in found if surface.friction == friction]
        assert sum(area_of(surface) for surface in same) == pytest.approx(0.16 * count, rel=1e-3)
        assert sorted(name for surface in same for name in surface.geom.split("+")) == sorted(
            f"t{i}{j}" for i, j in np.argwhere(slippery == (friction == 0.2)).tolist()
        )


def test_flush_tiles_that_touch_in_a_corner_both_bear(make_world):
    world = make_world(
        '<geom name="a" type="box" size="0.5 0.5 0.1" pos="0 0 -0.1"/>'
        '<geom name="b" type="box" size="0.5 0.5 0.1" pos="1 1 -0.1"/>'
    )
    assert sum(area_of(surface) for surface in tops(world)) == pytest.approx(2.0, rel=1e-5)


def test_a_chain_of_small_steps_is_not_one_surface(make_world):
    boxes = "".join(
        f'<geom type="box" size="0.2 0.5 0.1" pos="{0.4 * i} 0 {-0.1 + 0.0009 * i:.4f}"/>' for i in range(6)
    )
    world = make_world(boxes)
    assert len(tops(world)) >= 2
    rng = np.random.default_rng(0)
    for surface in tops(world):
        gaps = ray_gap(world.mujoco_model, surface, random_points(surface, rng, 50, inset=2e-3))
        assert np.abs(gaps).max() < 1.1e-3


def test_tilted_tiles_side_by_side_give_one_surface_each(make_world):
    rng = np.random.default_rng(5)
    tiles = "".join(
        f'<geom name="t{i}{j}" type="box" size="0.2 0.2 0.02" pos="{0.4 * i} {0.4 * j} {rng.uniform(-0.05, 0.05):.3f}" '
        f'euler="{rng.uniform(-20, 20):.2f} {rng.uniform(-20, 20):.2f} 0"/>'
        for i in range(5)
        for j in range(5)
    )
    world = make_world(tiles)
    assert sorted(s.geom for s in world.surfaces) == sorted(f"t{i}{j}" for i in range(5) for j in range(5))
    assert min(area_of(s) for s in world.surfaces) > 0.11


def test_small_and_narrow_regions_are_dropped(make_world):
    world = make_world(
        BOX_TOP + '<geom name="beam" type="box" size="0.5 0.029 0.5" pos="0 3 0"/>'
        '<geom name="post" type="box" size="0.04 0.04 0.5" pos="2 3 0"/>'
    )
    assert not any(s.serves_foot for s in world.surfaces if s.geom in ("beam", "post"))
    config = SurfaceConfig(foot_width=0.02, foot_area=1e-3)
    assert len(tops(make_world(BOX_TOP + '<geom type="box" size="0.5 0.029 0.5" pos="0 3 0"/>', config=config))) == 2


@pytest.mark.parametrize(
    ("angle", "serves"), [(44, (1, 0)), (46, (0, 0)), (59, (0, 0)), (61, (0, 1)), (119, (0, 1)), (121, (0, 0))]
)
def test_what_a_surface_serves_follows_its_angle(make_world, angle, serves):
    world = make_world(
        '<geom type="plane" size="1 1 1"/>'
        f'<geom name="p" type="box" size="0.5 0.5 0.01" pos="0 0 5" euler="{angle} 0 0"/>'
    )
    found = [s for s in world.surfaces if s.geom == "p" and abs(np.degrees(np.arccos(s.normal[2])) - angle) < 0.1]
    assert [(s.serves_foot, s.serves_palm) for s in found] == ([] if serves == (0, 0) else [serves])


def test_geoms_that_do_not_collide_offer_and_cover_nothing(make_world):
    world = make_world(
        BOX_TOP + '<geom name="ghost" type="box" size="0.3 0.3 0.05" pos="0 0 0.05" contype="0" conaffinity="0"/>'
    )
    assert total(tops(world)) == pytest.approx(3.2) and not any(s.geom == "ghost" for s in world.surfaces)
    # One bit on either side is enough to collide.
    world = make_world(
        BOX_TOP + '<geom name="solid" type="box" size="0.3 0.3 0.05" pos="0 0 0.05" contype="0" conaffinity="2"/>'
    )
    assert total([s for s in tops(world) if s.geom == "slab"]) == pytest.approx(3.2 - 0.36, abs=4e-3)


def test_nothing_to_stand_on(make_world):
    with pytest.raises(WorldError, match="no usable surface for feet"):
        make_world('<geom type="sphere" size="1"/>')


def test_splinters_of_a_curved_field_are_no_trouble(make_world):
    """Triangles of 2 m by 2 cm: no corner and no middle of a side is near the middle of one."""
    heights = " ".join(f"{0.5 + 0.5 * np.sin(k / 3):.4f}" for k in range(100) for _ in range(3))
    asset = f'<hfield name="h" nrow="100" ncol="3" size="2 1 0.02 0.2" elevation="{heights}"/>'
    assert len(make_world('<geom type="hfield" hfield="h"/>', assets=asset, start="0 0 0.02").surfaces) >= 1
