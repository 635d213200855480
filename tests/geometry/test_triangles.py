"""Triangles of compiled meshes and height fields, against MuJoCo's rays and the model's own sizes."""

import mujoco
import numpy as np
import trimesh

from toolkit.geometry.triangles import field_heights, height_field_triangles, mesh_triangles, mesh_vertices

SCENE = """
<mujoco>
  <asset>
    <mesh name="first" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
    <mesh name="second" vertex="0 0 0  2 0 0  0 2 0  0 0 2  2 2 2"/>
    <hfield name="flat" nrow="2" ncol="2" size="1 1 1 1" elevation="0 0 0 0"/>
    <hfield name="hills" nrow="3" ncol="4" size="1.5 1 0.8 0.1" elevation="0 1 2 3  4 0 5 1  2 6 3 0"/>
  </asset>
  <worldbody>
    <geom type="mesh" mesh="first" pos="9 0 0"/>
    <geom type="mesh" mesh="second" pos="19 0 0"/>
    <geom type="hfield" hfield="flat" pos="29 0 0"/>
    <geom type="hfield" hfield="hills"/>
  </worldbody>
</mujoco>
"""


def test_meshes_are_closed_and_each_has_its_own_vertices():
    model = mujoco.MjModel.from_xml_string(SCENE)
    for mesh, (count, volume) in enumerate(((4, 1 / 6), (5, 4.0))):
        vertices, triangles = mesh_vertices(model, mesh), mesh_triangles(model, mesh)
        assert len(vertices) == count and triangles.min() == 0 and triangles.max() == count - 1
        hull = trimesh.Trimesh(vertices, triangles)
        assert hull.is_watertight
        np.testing.assert_allclose(hull.volume, volume, rtol=1e-6)


def test_height_field_triangles_face_up_and_lie_where_rays_meet_the_field():
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert field_heights(model, 0).shape == (2, 2) and field_heights(model, 1).shape == (3, 4)
    points, triangles = height_field_triangles(model, 1)
    assert len(points) == 12 and len(triangles) == 2 * 2 * 3
    corners = points[triangles]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()
    hit = np.zeros(1, np.int32)
    for middle in corners.mean(axis=1):
        distance = mujoco.mj_ray(model, data, [*middle[:2], 5.0], [0.0, 0.0, -1.0], None, 1, -1, hit)
        np.testing.assert_allclose(5.0 - distance, middle[2], atol=1e-6)
