from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.world.conftest import mjcf_of
from toolkit.geometry.pose import Pose
from toolkit.world.loader import load_world
from toolkit.world.mesh_patches import closed_block
from toolkit.world.source import RAY_GROUPS, read_source

YAW, PLACE = 0.6, np.array([3.0, -2.0, 0.4])
SIZE = np.array([2.0, 1.5])  # m; half extents


def hill(x, y):
    return 0.08 * np.sin(2 * np.pi * x / 3.0) * np.cos(2 * np.pi * y / 2.5)


def block(spacing, height=hill):
    x, y = (np.linspace(-half, half, round(2 * half / spacing) + 1) for half in SIZE)
    return closed_block(x, y, height(*np.meshgrid(x, y, indexing="ij")))


def text_of(mesh, faces=None):
    """A world with one mesh, turned and moved, as MJCF."""
    vertices, faces = mesh.vertices, mesh.faces if faces is None else faces
    text = f'vertex="{" ".join(map(repr, np.ravel(vertices).tolist()))}" face="{" ".join(map(str, np.ravel(faces)))}"'
    quat, place = (" ".join(map(str, each)) for each in ([np.cos(YAW / 2), 0, 0, np.sin(YAW / 2)], PLACE))
    geom = f'<geom name="terrain" type="mesh" mesh="hills" pos="{place}" quat="{quat}" friction="0.6 0.005 0.0001"/>'
    start = " ".join(map(str, PLACE))
    return mjcf_of(geom, assets=f'<mesh name="hills" {text}/>', start=start, goal=start)


def fields_of(mesh, faces=None):
    """Number of the height fields that replace it."""
    return read_source(Path("made.xml"), text_of(mesh, faces)).model.nhfield


def ray_heights(world, points):
    """(n,) m; heights of what collides under points (n, 2), and the names of the geoms."""
    model, data, geom = world.mujoco_model, mujoco.MjData(world.mujoco_model), np.zeros(1, np.int32)
    mujoco.mj_forward(model, data)
    found, names = [], set()
    for point in points:
        away = mujoco.mj_ray(model, data, np.array([*point, 5.0]), np.array([0, 0, -1.0]), RAY_GROUPS, True, -1, geom)
        found.append(5.0 - away)
        names.add(model.geom(geom[0]).name)
    return np.array(found), names


@pytest.mark.parametrize("spacing", [0.04, 0.1], ids=["fine", "coarse"])
def test_hills_of_a_mesh_collide_as_a_height_field(spacing):
    """The finer one has more flat parts than there may be, the other ones that no sole fits on."""
    world = load_world(Path("made.xml"), mjcf=text_of(block(spacing)))
    local = np.random.default_rng(0).uniform(-SIZE + 0.02, SIZE - 0.02, (300, 2))
    at = Pose.from_yaw(PLACE, YAW)
    points = at @ np.column_stack([local, hill(*local.T)])
    heights, names = ray_heights(world, points[:, :2])
    assert names == {"terrain/field"}
    chord = 0.08 * (2 * np.pi / 2.5) ** 2 * spacing**2 / 4  # by which the mesh is off the waves
    np.testing.assert_allclose(heights, points[:, 2], atol=1.5e-3 + chord)
    assert {surface.geom for surface in world.surfaces} == {"terrain"}
    assert sum(surface.serves_foot for surface in world.surfaces) > 100
    assert (world.mujoco_model.geom("terrain/field").friction == [0.6, 0.005, 0.0001]).all()


def test_what_is_no_field_stays_in_parts():
    """Flat facets, hills that do not fill a rectangle, and hills that one can go under."""
    assert fields_of(block(0.25, lambda x, y: 0.1 * np.floor(x / 0.5))) == 0
    mesh = block(0.1)
    centre = mesh.triangles_center
    corner = (centre[:, 0] > 0.5) & (centre[:, 1] > 0.5) & (mesh.face_normals[:, 2] > 0.1)
    assert fields_of(mesh, mesh.faces[~corner]) == 0
    low = mesh.vertices[:, 2].min()
    arched = mesh.copy()
    under = mesh.vertices[:, 2] < low + 1e-6
    arched.vertices[under, 2] = low + 0.2 * np.cos(mesh.vertices[under, 0])  # its underside is no floor
    assert fields_of(arched) == 0
