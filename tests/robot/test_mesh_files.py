"""Mesh files that MuJoCo cannot read."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.robot.samples import URDF_TOML, biped_urdf, write_robot
from toolkit import robots
from toolkit.errors import RobotError
from toolkit.geometry.limb import Limb
from toolkit.robot.loader import load_robot
from toolkit.robot.mesh_files import converted

CORNERS = np.stack(np.meshgrid([-10.0, 10.0], [-5.0, 5.0], [0.0, 2.0]), -1).reshape(-1, 3)  # cm


def collada(points: np.ndarray, up: str = "Z_UP") -> str:
    """A COLLADA file in cm whose triangles span all points; they need not be a closed surface."""
    triangles = [[0, i, i + 1] for i in range(1, len(points) - 1)]
    numbers, corners = (" ".join(str(value) for value in np.ravel(array)) for array in (points, triangles))
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="centimetre" meter="0.01"/><up_axis>{up}</up_axis></asset>
  <library_geometries><geometry id="g" name="g"><mesh>
    <source id="p"><float_array id="a" count="{points.size}">{numbers}</float_array><technique_common>
      <accessor source="#a" count="{len(points)}" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="{len(triangles)}"><input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
  </library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""


@pytest.mark.parametrize("up", ["Z_UP", "Y_UP"])
def test_collada_becomes_the_hull_of_its_points_in_metres(tmp_path: Path, up: str) -> None:
    file = tmp_path / "box.dae"
    file.write_text(collada(CORNERS, up))
    mesh = trimesh.load_mesh(io.BytesIO(converted(file) or b""), file_type="stl")
    np.testing.assert_allclose(mesh.bounds, [[-0.1, -0.05, 0.0], [0.1, 0.05, 0.02]], atol=1e-7)
    assert mesh.volume == pytest.approx(0.2 * 0.1 * 0.02, rel=1e-5)


def test_what_is_flat_or_no_mesh_is_said(tmp_path: Path) -> None:
    file = tmp_path / "flat.dae"
    for text in (collada(CORNERS * [1, 1, 0]), "<COLLADA/>", "nothing"):
        file.write_text(text)
        with pytest.raises(ValueError, match="holds no solid"):
            converted(file)


def test_only_stl_in_plain_text_is_converted(tmp_path: Path) -> None:
    box = trimesh.creation.box((0.2, 0.1, 0.02))
    text, binary = tmp_path / "text.STL", tmp_path / "binary.stl"
    text.write_text(str(box.export(file_type="stl_ascii")))
    content = converted(text)
    assert content is not None
    binary.write_bytes(b"solid" + content[5:])  # many writers of binary files begin them like that
    assert converted(binary) is None
    np.testing.assert_allclose(trimesh.load_mesh(io.BytesIO(content), file_type="stl").extents, box.extents, atol=1e-7)


def with_sole_mesh(urdf: str, name: str) -> str:
    return urdf.replace('<box size="0.2 0.1 0.02"/>', f'<mesh filename="{name}"/>').replace('xyz="0 0 0.01"', "")


def test_a_robot_whose_soles_are_collada_needs_nothing_by_hand(tmp_path: Path) -> None:
    (tmp_path / "sole.dae").write_text(collada(CORNERS))
    (tmp_path / "biped.urdf").write_text(with_sole_mesh(biped_urdf(), "sole.dae"))
    assert robots.main(["--inspect", str(tmp_path / "biped.urdf"), "--out", str(tmp_path / "biped")]) == 0
    robot = load_robot(str(tmp_path / "biped"))
    np.testing.assert_allclose(2 * robot.limbs[Limb.LEFT_FOOT].half_size, [0.2, 0.1])
    np.testing.assert_allclose(robot.legs[Limb.LEFT_FOOT].ankle_in_sole, [-0.02, 0, 0.08], atol=1e-6)
    assert not any("meshes" in warning for warning in robot.warnings)


def test_soles_that_are_only_meshes_are_warned_of(tmp_path: Path) -> None:
    (tmp_path / "sole.dae").write_text(collada(CORNERS))
    (tmp_path / "biped.urdf").write_text(with_sole_mesh(biped_urdf(), "sole.dae"))
    assert robots.main(["--inspect", str(tmp_path / "biped.urdf"), "--out", str(tmp_path / "biped")]) == 0
    toml = tmp_path / "biped" / "robot.toml"
    toml.write_text(toml.read_text().replace("pad = 0.01", ""))
    (warning,) = (item for item in load_robot(str(tmp_path / "biped")).warnings if "meshes" in item)
    assert "left_foot, right_foot" in warning and "`pad`" in warning


@pytest.mark.parametrize("lies", [True, False])
def test_shapes_that_lie_down_are_turned_where_the_masses_say_so(tmp_path: Path, lies: bool) -> None:
    trunk = CORNERS * [1.0, 1.0, 15.0]  # around the pelvis' centre of mass, 0.15 m above its frame
    if lies:
        trunk = trunk[:, [0, 2, 1]] * [1.0, 1.0, -1.0]  # y points up
    (tmp_path / "trunk.dae").write_text(collada(trunk, "Y_UP"))  # which many files say in which z does
    shape = '<collision><geometry><mesh filename="trunk.dae"/></geometry></collision>'
    file = tmp_path / "biped.urdf"
    file.write_text(biped_urdf().replace("<visual>", shape + "<visual>"))
    assert robots.main(["--inspect", str(file), "--out", str(tmp_path / "biped")]) == 0
    assert ("up_axis = true" in (tmp_path / "biped" / "robot.toml").read_text()) == lies
    model = load_robot(str(tmp_path / "biped")).mujoco_model
    mesh = model.geom(int(model.body("pelvis").geomadr[0]))
    np.testing.assert_allclose(mesh.pos, [0.0, 0.0, 0.15], atol=1e-6)


def test_a_mesh_without_a_solid_names_its_link_and_the_remedy(tmp_path: Path) -> None:
    folder = write_robot(tmp_path / "a", with_sole_mesh(biped_urdf(), "sole.dae"), URDF_TOML, "robot.urdf")
    (folder / "sole.dae").write_text(collada(CORNERS * [1, 1, 0]))
    wanted = r"'sole.dae' of link 'left_sole' holds no solid .* or replace the shape in \[mend.collision\]"
    with pytest.raises(RobotError, match=wanted):
        load_robot(str(folder))


def test_all_parts_of_an_obj_count(tmp_path: Path) -> None:
    """MuJoCo takes the faces of one, here a disc, and refuses a shape without a volume."""
    box = trimesh.creation.box((0.2, 0.1, 0.02))
    whole, parts = tmp_path / "whole.obj", tmp_path / "parts.obj"
    lines = str(box.export(file_type="obj", include_normals=False)).splitlines()
    faces = [line for line in lines if line.startswith("f ")]
    corners = [line for line in lines if line.startswith("v ")]
    whole.write_text("\n".join(["o box", *corners, *faces]))
    parts.write_text("\n".join([*corners, "o top", *faces[:2], "o rest", *faces[2:]]))
    assert converted(whole) is None
    mesh = trimesh.load_mesh(io.BytesIO(converted(parts) or b""), file_type="stl")
    assert mesh.volume == pytest.approx(box.volume, rel=1e-6)
