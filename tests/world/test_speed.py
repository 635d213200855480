"""Extraction takes time in proportion to what a world holds, and tells how far it is."""

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


def rubble(rows):
    """A field of so many rows of tiles."""
    return KINDS["rubble_field"](np.random.default_rng(0), rows=rows)


WORLDS = {  # how a world is made, and a size and one with four times as many parts
    "boxes": (lambda count: boxes(count, 0.21 * np.sqrt(count), 0.05), 1250, 5000),
    "boxes in one heap": (lambda count: boxes(count, 3.0, 0.3), 250, 1000),
    "tiles": (rubble, 40, 160),
    "height field": (height_field, 100, 200),
    "mesh": (lambda side: scan(side, 0.0), 40, 80),
}


@pytest.mark.slow
@pytest.mark.parametrize(("make", "few", "many"), WORLDS.values(), ids=WORLDS)
def test_four_times_as_much_takes_about_four_times_as_long(make, few, many, tmp_path):
    texts = [make(few), make(many)]
    load_world(tmp_path / "world.xml", mjcf=texts[0])  # whatever is loaded or compiled once is there now
    small, large = (loaded(tmp_path, text) for text in texts)
    assert large < 8.0 * small


@pytest.mark.slow
def test_what_is_too_rough_is_told_sooner_than_it_would_be_extracted(tmp_path):
    smooth = loaded(tmp_path, scan(80, 0.0))
    began = time.process_time()
    with pytest.raises(WorldError, match="more than 4000"):
        load_world(tmp_path / "world.xml", mjcf=scan(317, 0.01))  # sixteen times as many triangles
    assert time.process_time() - began < 16.0 * smooth


def loaded(folder, text):
    """The processor time in s that loading a world takes, which tells how far it is."""
    shares, began = [], time.process_time()
    load_world(folder / "world.xml", mjcf=text, progress=shares.append)
    seconds = time.process_time() - began
    assert shares == sorted(shares) and 0.0 <= min(shares) <= max(shares) <= 1.0
    return seconds
