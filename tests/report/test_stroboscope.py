"""A whole run in one picture shows the robot in several moments, all of them."""

import mujoco
import numpy as np
import pytest

from toolkit.report.stroboscope import SPACING, overview, stroboscope

SCENE = """
<mujoco>
  <visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>
  <worldbody>
    <geom type="plane" size="0 0 1" rgba="0 0 1 1"/>
    <body><freejoint/><geom type="sphere" size="0.15" rgba="1 0 0 1"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def scene():
    return mujoco.MjModel.from_xml_string(SCENE)


def walk(length, heading):
    """Configurations on a straight way with a rest at either end."""
    gone = np.concatenate([np.zeros(50), np.linspace(0.0, length, 300), np.full(50, length)])
    return np.column_stack(
        [gone * np.cos(heading), gone * np.sin(heading), np.full(400, 0.9), np.tile([1.0, 0.0, 0.0, 0.0], (400, 1))]
    )


@pytest.mark.parametrize(("length", "heading", "count"), [(2.1, 0.0, 4), (2.8, 2.0, 5), (0.0, 0.0, 1)])
def test_every_moment_is_in_the_picture(scene, length, heading, count):
    picture = stroboscope(scene, walk(length, heading), size=(400, 300)).astype(int)
    red = (picture[..., 0] > 150) & (picture[..., 2] < 80)
    columns = np.flatnonzero(np.diff(np.concatenate([[False], red.any(axis=0), [False]]).astype(int)) == 1)
    assert len(columns) == count
    border = np.concatenate([red[0], red[-1], red[:, 0], red[:, -1]])
    assert not border.any()


def test_the_camera_sees_a_long_way_from_farther_off(scene):
    near, far = (overview(scene, walk(length, 0.0)[:, :3]).distance for length in (SPACING, 5.0))
    assert far > 5.0 > near
