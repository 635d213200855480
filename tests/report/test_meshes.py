"""Meshes drawn for geoms have the geoms' volume and outward normals."""

import mujoco
import numpy as np
import pytest

from toolkit.report.meshes import geom_rgba, mesh_of_geom, shown_geoms

TETRAHEDRON = '<mesh name="tetra" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>'
ROUND = 0.06  # relative volume lost to facets


def volume(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    return float((np.cross(a, b) * c).sum() / 6)


@pytest.mark.parametrize(
    ("geom", "expected", "rtol"),
    [
        ('type="box" size="0.1 0.2 0.3"', 8 * 0.006, 1e-12),
        ('type="sphere" size="0.5"', 4 / 3 * np.pi * 0.125, ROUND),
        ('type="ellipsoid" size="0.1 0.2 0.3"', 4 / 3 * np.pi * 0.006, ROUND),
        ('type="capsule" size="0.1 0.3"', np.pi * 0.01 * 0.6 + 4 / 3 * np.pi * 0.001, ROUND),
        ('type="cylinder" size="0.1 0.3"', np.pi * 0.01 * 0.6, ROUND),
        ('type="mesh" mesh="tetra"', 1 / 6, 1e-6),
    ],
)
def test_a_mesh_has_the_geom_s_volume_and_outward_normals(geom, expected, rtol):
    text = f"<mujoco><asset>{TETRAHEDRON}</asset><worldbody><geom {geom}/></worldbody></mujoco>"
    mesh = mesh_of_geom(mujoco.MjModel.from_xml_string(text), 0)
    assert volume(mesh) == pytest.approx(expected, rel=rtol)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, rtol=1e-9)
    corners = mesh.vertices[mesh.triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.einsum("ij,ikj->ik", face, mesh.normals[mesh.triangles])
    assert (facing > -1e-12).all()


def test_a_fine_mesh_shares_its_vertices(monkeypatch):
    text = f"<mujoco><asset>{TETRAHEDRON}</asset><worldbody><geom type='mesh' mesh='tetra'/></worldbody></mujoco>"
    monkeypatch.setattr("toolkit.report.meshes.FLAT_SHADED", 3)
    mesh = mesh_of_geom(mujoco.MjModel.from_xml_string(text), 0)
    assert len(mesh.vertices) == 4 and volume(mesh) == pytest.approx(1 / 6, rel=1e-6)
    outward = mesh.vertices - mesh.vertices.mean(0)
    assert ((outward * mesh.normals).sum(1) > 0).all()


def test_planes_and_height_fields_face_up():
    text = """<mujoco><asset><hfield name="hills" nrow="3" ncol="4" size="2 1 0.5 0.1"
        elevation="0 0 0 0  0 1 1 0  0 0 0 0"/></asset>
        <worldbody><geom type="plane" size="0 0 1"/><geom type="hfield" hfield="hills"/></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    plane, hills = mesh_of_geom(model, 0, plane_extent=3.0), mesh_of_geom(model, 1)
    assert plane.vertices[:, 0].max() == 3.0 and (plane.normals[:, 2] == 1).all()
    assert (hills.normals[:, 2] > 0).all()
    np.testing.assert_allclose(hills.vertices.max(0), [2, 1, 0.5], rtol=0, atol=1e-6)


def test_collision_only_geoms_are_hidden_unless_there_is_nothing_else():
    text = """<mujoco><worldbody><geom size="1" group="3"/><geom size="1"/><geom size="1" rgba="1 1 1 0"/>
        </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    assert shown_geoms(model, np.arange(3)).tolist() == [1]
    assert shown_geoms(model, np.array([0])).tolist() == [0]


def test_a_textured_material_gives_its_mean_colour():
    text = """<mujoco><asset>
        <texture name="t" type="2d" builtin="flat" rgb1="1 0.5 0" width="8" height="8"/>
        <material name="m" texture="t" rgba="0.5 1 1 0.9"/></asset>
        <worldbody><geom size="1" material="m"/><geom size="1" rgba="0 1 0 1"/></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    np.testing.assert_allclose(geom_rgba(model, 0), [0.5, 0.5, 0, 0.9], rtol=0, atol=0.01)  # 8-bit texture
    np.testing.assert_allclose(geom_rgba(model, 1), [0, 1, 0, 1], rtol=0, atol=1e-6)
