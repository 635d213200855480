"""Boxes against the world, by a second route."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from toolkit.world.clearance import BoxCollider

GEOMS = """
<geom type="plane" size="0 0 1"/>
<geom type="box" size="0.3 0.2 0.1" pos="0.6 0.3 0.1" euler="10 5 30"/>
<geom type="cylinder" size="0.25 0.2" pos="-0.8 0.5 0.1" euler="0 15 0"/>
<geom type="sphere" size="0.3" pos="0 -1 0.1"/>
<geom type="capsule" size="0.1 0.4" pos="1 -1 0.2" euler="80 0 0"/>
<geom type="mesh" mesh="wedge" pos="-1 -1 0"/>
<geom type="hfield" hfield="field" pos="1.5 1.5 0"/>
<geom type="box" size="0.4 0.4 0.02" pos="-1 1.5 2"/>
<geom type="box" size="2 2 0.02" pos="0 0 -0.5" contype="0" conaffinity="0"/>
"""
ASSETS = """
<mesh name="wedge" vertex="-.3 -.3 0  .3 -.3 0  .3 .3 0  -.3 .3 0  -.3 -.3 .3  -.3 .3 .3"/>
<hfield name="field" nrow="5" ncol="6" size="0.5 0.4 0.3 0.1"
  elevation="0 0 0 0 0 0  0 1 .5 .2 .2 0  0 .6 .9 .1 .7 0  0 .3 .3 .8 1 0  0 0 0 0 0 0"/>
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    from tests.world.conftest import mjcf_of
    from toolkit.world.loader import load_world

    return load_world(tmp_path_factory.mktemp("world") / "made.xml", mjcf=mjcf_of(GEOMS, ASSETS))


def test_boxes_agree_with_mujoco_distances(world):
    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (400, 1, 1))
    poses[:, :3, :3] = Rotation.random(400, rng=rng).as_matrix()
    poses[:, :3, 3] = rng.uniform([-2, -2, 0.0], [2, 2, 0.9], (400, 3))
    sizes = rng.uniform(0.02, 0.3, (400, 3))
    hit = BoxCollider(world).collide(poses, sizes)
    assert 50 < hit.sum() < 350
    # The same question put to MuJoCo one box at a time, with the box compiled into the world.
    from tests.world.conftest import mjcf_of

    for pose, size, expected in zip(poses[:120], sizes[:120], hit[:120], strict=True):
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        position, turn, extent = (" ".join(f"{x:.12g}" for x in v) for v in (pose[:3, 3], (w, x, y, z), size))
        box = f'<body pos="{position}" quat="{turn}"><freejoint/><geom type="box" size="{extent}"/></body>'
        model = mujoco.MjModel.from_xml_string(mjcf_of(GEOMS + box, ASSETS))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert bool((data.contact.dist < 0).any()) == expected


def test_boxes_touch_and_miss_a_floor(world):
    collider = BoxCollider(world, batch=4)
    poses = np.tile(np.eye(4), (9, 1, 1))
    poses[:, :3, 3] = np.column_stack([np.full((9, 2), -2.0), np.linspace(0.09, 0.13, 9)])
    expected = poses[:, 2, 3] < 0.1 - 1e-9
    hit = collider.collide(poses, np.full(3, 0.1))
    clear = np.abs(poses[:, 2, 3] - 0.1) > 1e-9
    np.testing.assert_array_equal(hit[clear], expected[clear])
    assert collider.collide(np.zeros((0, 4, 4)), np.ones(3)).shape == (0,)
