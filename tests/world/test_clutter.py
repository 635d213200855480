"""Random piles of every kind of geom: whatever is extracted is touched where it says."""

import numpy as np
import pytest
import shapely
import trimesh
from scipy.spatial.transform import Rotation
from shapely.geometry import Polygon

from tests.world.conftest import mjcf_of
from tests.world.probe import ball_gap, random_points, ray_gap
from toolkit.world.loader import load_world


def text(values):
    return " ".join(f"{value:.7g}" for value in np.ravel(values))


def clutter(seed):
    """MJCF of a floor with a random pile on it."""
    rng = np.random.default_rng(seed)
    height = rng.uniform(0, 1, (8, 7)).round()
    star = Polygon(rng.uniform(0.2, 0.6, (9, 1)) * [[np.cos(a), np.sin(a)] for a in np.arange(9) * 2 * np.pi / 9])
    block = trimesh.creation.extrude_polygon(star, 0.3)
    assets = (
        f'<mesh name="star" vertex="{text(block.vertices)}" face="{text(block.faces)}"/>'
        f'<mesh name="rock" vertex="{text(rng.normal(0, 0.3, (12, 3)))}"/>'
        f'<hfield name="field" nrow="8" ncol="7" size="0.9 0.8 0.3 0.1" elevation="{text(height)}"/>'
    )
    kinds = [
        'type="box" size="{:.3f} {:.3f} {:.3f}"',
        'type="cylinder" size="{:.3f} {:.3f}"',
        'type="sphere" size="{:.3f}"',
        'type="capsule" size="{:.3f} {:.3f}"',
        'type="mesh" mesh="star"',
        'type="mesh" mesh="rock"',
        'type="hfield" hfield="field"',
    ]
    geoms = '<geom name="floor" type="plane" size="0 0 1"/>'
    for _ in range(14):
        kind = rng.choice(len(kinds), p=[0.4, 0.12, 0.06, 0.06, 0.12, 0.12, 0.12])
        shape = kinds[kind].format(*rng.uniform(0.1, 0.5, 3))
        x, y, z, w = (
            Rotation.from_euler("z", rng.uniform(0, 7)) * Rotation.from_euler("xy", rng.normal(0, 0.15, 2))
        ).as_quat()
        position = [
            *rng.choice([-1, 1]) * rng.uniform(1.2, 2.5, 1),
            *rng.uniform(-2.5, 2.5, 1),
            *rng.uniform(-0.2, 0.6, 1),
        ]
        geoms += f'<geom {shape} pos="{text(position)}" quat="{text([w, x, y, z])}"/>'
    return mjcf_of(geoms, assets)


@pytest.mark.parametrize("seed", range(6))
def test_clutter(seed, tmp_path):
    world = load_world(tmp_path / "clutter.xml", mjcf=clutter(seed))
    rng = np.random.default_rng(seed)
    assert len(world.surfaces) > 20
    for surface in world.surfaces:
        region = Polygon(surface.boundary[0], surface.boundary[1:])
        assert region.is_valid and region.area >= 3e-3
        assert sum(Polygon(piece).area for piece in surface.pieces) == pytest.approx(region.area, rel=1e-5)
        points = random_points(surface, rng, 12, inset=1e-4)
        np.testing.assert_allclose(ray_gap(world.mujoco_model, surface, points, height=0.149), 0, atol=1.6e-3)
        points = random_points(surface, rng, 3, inset=0.015)
        if len(points):
            np.testing.assert_allclose(ball_gap(world.mujoco_model, surface, points), 0, atol=1.6e-3)
        assert shapely.get_num_coordinates(region) < 2000
