"""Names and friction stay with their geoms, whatever the names are and whatever the compiler is told."""

import numpy as np
import pytest
import trimesh

from tests.world.conftest import mjcf_of
from tests.world.probe import area_of
from tests.world.test_extraction import l_shape, mesh_asset
from toolkit.errors import WorldError
from toolkit.world.loader import load_world
from toolkit.world.scene import compose_scene

GHOST = '<geom type="sphere" size="0.1" pos="0 0 3" contype="0" conaffinity="0" friction="0.1"/>'
ELL = 'name="ell"'
MESH = '<geom {name} type="mesh" mesh="m" friction="0.5"/>'
BOXES = (
    '<geom name="low" type="box" size="0.3 0.3 0.1" pos="3 0 -0.1" friction="0.6"/>'
    '<geom name="high" type="box" size="0.3 0.3 0.1" pos="4 0 -0.1" friction="0.7"/>'
)
COMPILER = '<compiler discardvisual="{0}" fusestatic="{0}"/>'


def facts(world):
    """(geom, friction, area) of the surfaces for feet."""
    return [(s.geom, s.friction, round(area_of(s), 3)) for s in world.surfaces if s.serves_foot]


@pytest.mark.parametrize("order", [GHOST + "{mesh}" + BOXES, "{mesh}" + GHOST + BOXES, BOXES + GHOST + "{mesh}"])
@pytest.mark.parametrize("visual", ["true", "false"])
def test_compiler_that_drops_or_merges_geoms(make_world, order, visual):
    mesh = f"<body>{MESH.format(name=ELL)}</body>"
    geoms, asset = order.format(mesh=mesh), mesh_asset("m", l_shape())
    world = make_world(geoms, asset, start="-0.5 0 0", more=COMPILER.format(visual))
    assert sorted(facts(world)) == [("ell", 0.5, 3.0), ("high", 0.7, 0.36), ("low", 0.6, 0.36)]


@pytest.mark.parametrize("name", ["mesh#0", "m/part0", "mesh#0/part0", "mesh#0'"])
@pytest.mark.parametrize("named", ["", 'name="m"'])
def test_names_that_the_toolkit_would_give(make_world, stool, name, named):
    box = f'<geom name="{name}" type="box" size="0.3 0.3 0.1" pos="3 0 -0.1" friction="0.6"/>'
    flat = mesh_asset(name, trimesh.creation.box((0.1, 0.1, 0.1)))
    world = make_world(MESH.format(name=named) + box, mesh_asset("m", l_shape()) + flat, start="-0.5 0 0")
    box, ell = sorted(facts(world), key=lambda fact: fact[2])
    assert box == (name, 0.6, 0.36)
    assert ell[0] != name and ell[1:] == (0.5, 3.0)
    scene = compose_scene(stool, world)
    assert len(np.unique([scene.geom(i).name for i in range(scene.ngeom)])) == scene.ngeom


LARGE = {
    "box": ('<geom name="g" type="box" size="1e300 1 1"/>', "w.xml: size of geom 'g' is more than 10000 m"),
    "far": ('<geom name="g" type="box" size="1 1 1" pos="0 0 -1e300"/>', "pos of geom 'g' is more than 10000 m"),
    "body": ('<body name="b" pos="1e5 0 0"><geom size="1"/></body>', "pos of body 'b' is more than 10000 m"),
}


@pytest.mark.parametrize("case", LARGE)
def test_lengths_beyond_reason(tmp_path, case):
    geom, message = LARGE[case]
    with pytest.raises(WorldError, match=message):
        load_world(tmp_path / "w.xml", mjcf=mjcf_of('<geom type="plane" size="0 0 1"/>' + geom))


def test_goal_and_radius_beyond_reason(tmp_path):
    floor = '<geom type="plane" size="0 0 1"/>'
    for goal in ("1e300 0 0", '1 0 0" zaxis="0 0 1'):
        text = mjcf_of(floor, goal=goal)
        text = text if "1e300" in text else text.replace("0.2 0.01", "1e300 0.01")
        with pytest.raises(WorldError, match="of site 'goal' is more than 10000 m"):
            load_world(tmp_path / "w.xml", mjcf=text)


def test_height_field_of_too_many_points(tmp_path, monkeypatch):
    """MuJoCo would take 10 GB for it while it reads the file, so it is not asked."""
    asset = '<hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/>'
    monkeypatch.setattr("toolkit.mjcf._caught", lambda: pytest.fail("MuJoCo reads it"))
    with pytest.raises(WorldError, match="height field 'h' has 100000 x 100000 cells; at most 4000000"):
        load_world(tmp_path / "w.xml", mjcf=mjcf_of('<geom type="hfield" hfield="h"/>', asset))


@pytest.mark.parametrize("name", [b"\xff.xml", b"a" * 300 + b".xml", b"folder\xfe/w.xml"])
def test_paths_that_cannot_be_used(tmp_path, name):
    import os
    from pathlib import Path

    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/" + name))
    if len(name) < 100:
        path.parent.mkdir(exist_ok=True)
        path.write_text(mjcf_of('<geom type="plane" size="0 0 1"/>'))
    with pytest.raises(WorldError, match="is not UTF-8; rename it|File name too long"):
        load_world(path)


def test_no_word_of_mujoco_beside_the_error(tmp_path, monkeypatch, capfd):
    """NaN in an included file, which only MuJoCo sees, and a name that is no number."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "more.xml").write_text('<mujoco><worldbody><geom size="1" pos="nan 0 0"/></worldbody></mujoco>')
    (tmp_path / "w.xml").write_text(mjcf_of('<geom type="plane" size="0 0 1"/>', more='<include file="more.xml"/>'))
    with pytest.raises(WorldError, match="a number is NaN; give plain numbers"):
        load_world("w.xml")
    load_world("v.xml", mjcf=mjcf_of('<geom name="nan" type="plane" size="0 0 1"/>'))
    assert capfd.readouterr() == ("", "")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["more.xml", "w.xml"]
