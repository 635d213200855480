"""Extraction is quick enough to be done at the start of every run."""

import time

import numpy as np
import pytest

from tests.world.conftest import mjcf_of
from toolkit.errors import WorldError
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world


def height_field(side=50):
    x = np.linspace(-2.5, 2.5, side)
    height = 0.2 + 0.1 * np.round(np.sin(2 * x)[:, None] * np.cos(1.5 * x) * 2)
    data = " ".join(f"{value:.6f}" for value in np.ravel(height / height.max()))
    asset = f'<hfield name="h" nrow="{side}" ncol="{side}" size="2.5 2.5 {height.max():.6f} 0.1" elevation="{data}"/>'
    return mjcf_of('<geom type="hfield" hfield="h"/>', asset, start="0 0 0.2")


def boxes(count, spread, height):
    """Boxes around the start, each a little tilted."""
    rng = np.random.default_rng(0)
    geoms = ['<geom type="box" size="1 1 0.1" pos="0 0 -0.1"/>']
    while len(geoms) < count:
        x, y, z = rng.uniform(-1, 1, 3) * [spread, spread, height]
        tilt = rng.uniform(-8, 8, 2)
        if max(abs(x), abs(y)) > 1.5:
            geoms.append(f'<geom type="box" size=".3 .2 .05" pos="{x} {y} {z}" euler="{tilt[0]} {tilt[1]} 0"/>')
    return mjcf_of("".join(geoms))


def scan(side, rough):
    """A sheet of triangles, as a scanner leaves it: terraces, with noise."""
    x = np.linspace(-2.5, 2.5, side)
    height = 0.1 * np.round(np.sin(2 * x)[:, None] * np.cos(1.5 * x) * 2)
    height += rough * np.random.default_rng(0).normal(size=height.shape) * (np.hypot(x[:, None], x) > 0.6)
    points = np.column_stack([np.repeat(x, side), np.tile(x, side), height.ravel()])
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    across = corner + side + 1
    faces = np.concatenate(
        [np.column_stack([corner, corner + side, across]), np.column_stack([corner, across, corner + 1])]
    )
    vertex, face = (" ".join(f"{number:.6g}" for number in np.ravel(array)) for array in (points, faces))
    asset = f'<mesh name="scan" inertia="shell" vertex="{vertex}" face="{face}"/>'
    return mjcf_of('<geom type="mesh" mesh="scan"/>', asset, start="0 0 0")


@pytest.mark.slow
def test_large_worlds_take_seconds_and_tell_how_far_they_are(tmp_path):
    """A tenth of what they took before faces met solids through an index, or less (minutes for many boxes)."""
    cases = {
        "20,000 boxes": (boxes(20_000, 30.0, 0.05), 60.0),
        "1,000 boxes in one heap": (boxes(1_000, 3.0, 0.3), 15.0),
        "height field 500 x 500": (height_field(500), 15.0),
        "mesh of 200,000 rough triangles": (scan(317, 0.01), 3.0),
        "mesh of 7,000 triangles": (scan(60, 0.0), 3.0),
    }
    for name, (text, limit) in cases.items():
        shares, began = [], time.process_time()
        try:
            load_world(tmp_path / "world.xml", mjcf=text, progress=shares.append)
        except WorldError as error:
            assert "rough" in name and "more than 4000" in str(error)
        assert time.process_time() - began < limit, name
        assert shares == sorted(shares) and 0.0 <= min(shares) <= max(shares) <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "limit"),
    [
        (KINDS["mesh_patches"](np.random.default_rng(0)), 1.0),
        (KINDS["rubble_field"](np.random.default_rng(0), rows=80), 3.0),
        (height_field(), 2.0),
    ],
    ids=["mesh_of_1000_triangles", "32_m_of_rubble", "height_field_50_x_50"],
)
def test_processor_seconds_to_load(text, limit, tmp_path):
    seconds = []
    for _ in range(3):
        began = time.process_time()
        load_world(tmp_path / "world.xml", mjcf=text)
        seconds.append(time.process_time() - began)
    assert np.median(seconds) < limit
