"""Extraction is quick enough to be done at the start of every run."""

import time

import numpy as np
import pytest

from tests.world.conftest import mjcf_of
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world


def height_field():
    x = np.linspace(-2.5, 2.5, 50)
    height = 0.2 + 0.1 * np.round(np.sin(2 * x)[:, None] * np.cos(1.5 * x) * 2)
    data = " ".join(f"{value:.6f}" for value in np.ravel(height / height.max()))
    asset = f'<hfield name="h" nrow="50" ncol="50" size="2.5 2.5 {height.max():.6f} 0.1" elevation="{data}"/>'
    return mjcf_of('<geom type="hfield" hfield="h"/>', asset, start="0 0 0.2")


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
