"""What a world file says, and one clear line for each way in which it can be wrong."""

import os

import mujoco
import numpy as np
import pytest

from tests.world.conftest import mjcf_of
from toolkit.errors import WorldError
from toolkit.geometry.limb import Limb
from toolkit.world.loader import load_world
from toolkit.world.timing import Timing

FLOOR = '<geom name="floor" type="plane" size="0 0 1"/>'
TIMING = '<custom><numeric name="transition_timing" data="{}"/></custom>'


def test_reads_start_goal_and_timing(make_world):
    world = make_world(
        f'{FLOOR}<body pos="0 0 0.1" euler="0 0 90"><site name="inner"/></body>',
        start='0.1 0.2 0.05" euler="0 0 30',
        goal="1.5 -0.5 0",
        more=TIMING.format("0.05 0.35"),
    )
    np.testing.assert_allclose(world.start.position, [0.1, 0.2, 0.05])
    assert world.start.yaw == pytest.approx(np.radians(30))
    np.testing.assert_allclose(world.goal.position, [1.5, -0.5, 0])
    assert world.goal.radius == 0.2
    assert world.timing == Timing(0.05, 0.35)
    assert world.name == "made"


WALL = '<geom name="wall" type="box" size="1 0.1 1" pos="0 0.7 1"/>'
LEFT_PALM = '<site name="start_left_palm" pos="{}"/>'


def test_reads_palms_of_the_start(make_world):
    assert make_world(FLOOR + WALL).start_palms == {}
    both = WALL + WALL.replace("0 0.7", "0 -0.7").replace('"wall"', '"other"')
    body = '<body pos="0 -0.5 1" euler="0 0 90"><site name="start_right_palm" pos="0 0.2 0.1"/></body>'
    world = make_world(FLOOR + both + LEFT_PALM.format("0.1 0.6 1.2") + body)
    assert list(world.start_palms) == [Limb.LEFT_PALM, Limb.RIGHT_PALM]
    np.testing.assert_allclose(world.start_palms[Limb.LEFT_PALM], [0.1, 0.6, 1.2])
    np.testing.assert_allclose(world.start_palms[Limb.RIGHT_PALM], [-0.2, -0.5, 1.1], atol=1e-12)
    make_world(FLOOR + WALL + LEFT_PALM.format("0.1 0.31 1.2"))  # 0.29 m off the wall


def test_no_timing_where_none_is_given(make_world):
    assert make_world(FLOOR).timing is None


def test_file_with_includes_and_meshes_beside_it(tmp_path, monkeypatch):
    import trimesh

    (tmp_path / "meshes").mkdir()
    trimesh.creation.box((2, 2, 0.2)).export(tmp_path / "meshes" / "slab.stl")
    (tmp_path / "sites.xml").write_text(
        '<mujoco><worldbody><site name="start" pos="0 0 0.1"/>'
        '<site name="goal" type="cylinder" pos="0.5 0 0" size="0.2 0.1"/></worldbody></mujoco>'
    )
    path = tmp_path / "world.xml"
    path.write_text(
        '<mujoco><compiler meshdir="meshes"/><include file="sites.xml"/><asset><mesh name="slab" file="slab.stl"/>'
        '</asset><worldbody><geom type="mesh" mesh="slab"/></worldbody></mujoco>'
    )
    monkeypatch.chdir(tmp_path.parent)
    world = load_world(str(path.relative_to(tmp_path.parent)))
    assert sum(surface.serves_foot for surface in world.surfaces) == 1


def test_replicas_in_an_included_file_are_counted(tmp_path):
    """An include inside a replica counts as often as the replica; a few copies are as good as written geoms."""
    path = tmp_path / "world.xml"
    path.write_text(mjcf_of(FLOOR + '<replicate count="30"><include file="part.xml"/></replicate>'))
    for count, fits in ((2, True), (1000, False)):
        text = f'<mujocoinclude><replicate count="{count}"><site/></replicate><!-- <replicate> --></mujocoinclude>'
        (tmp_path / "part.xml").write_text(text)
        if fits:
            assert load_world(path).mujoco_model.nsite == 2 + 30 * count
        else:
            with pytest.raises(WorldError, match=r"world.xml: <replicate> asks for 3\d+ copies or more"):
                load_world(path)


def test_start_between_two_stones_is_on_the_ground(make_world):
    stones = '<geom type="box" size="0.3 0.15 0.1" pos="0 {} -0.1"/>'
    make_world(stones.format(0.17) + stones.format(-0.17))


@pytest.mark.parametrize("height", [0.29, -0.1])
def test_start_a_little_off_the_ground(make_world, height):
    make_world(FLOOR, start=f"0 0 {height}")


CASES = {
    "no_start": (mjcf_of(FLOOR).replace('"start"', '"begin"'), r"no site 'start'; add <site name=\"start\""),
    "no_goal": (
        mjcf_of(FLOOR).replace('"goal"', '"end"'),
        r"no site 'goal'; add <site name=\"goal\" type=\"cylinder\"",
    ),
    "goal_not_a_cylinder": (mjcf_of(FLOOR).replace('"cylinder"', '"sphere"'), "'goal' is not a cylinder; write it as"),
    "start_in_the_air": (
        mjcf_of(FLOOR, start="0 0 0.5"),
        r"'start' at \(0, 0, 0.5\) is in the air: .* z = 0 m; move it",
    ),
    "start_under_the_ground": (mjcf_of(FLOOR, start="0 0 -0.5"), "'start' at .* is under the ground: .* z = 0 m"),
    "start_beside_the_ground": (
        mjcf_of('<geom type="box" size="1 1 1" pos="3 0 -1"/>'),
        "'start' at .* is beside the ground",
    ),
    "start_tilted": (mjcf_of(FLOOR, start='0 0 0" euler="90 0 0'), "'start' is tilted; turn it about z only"),
    "no_geom": (mjcf_of(), "no usable surface for feet; add a static colliding geom"),
    "only_a_wall": (mjcf_of('<geom type="plane" size="0 0 1" euler="90 0 0"/>'), "no usable surface for feet"),
    "does_not_collide": (mjcf_of(FLOOR.replace("/>", ' contype="0" conaffinity="0"/>')), "no usable surface for feet"),
    "palm_without_a_wall": (
        mjcf_of(FLOOR + LEFT_PALM.format("0 0.6 1")),
        "site 'start_left_palm' asks for a palm on a wall, but the world has none: .* 60 to 120 degrees .*; add a wall",
    ),
    "palm_far_from_the_wall": (
        mjcf_of(FLOOR + WALL + LEFT_PALM.format("0 0.2 1")),
        r"site 'start_left_palm' at \(0, 0\.2, 1\) is 0\.40 m from the nearest surface for palms; move it within 0",
    ),
    "palm_above_the_wall": (
        mjcf_of(FLOOR + WALL + LEFT_PALM.format("0 0.6 2.5")),
        r"is 0\.50 m from the nearest surface for palms",
    ),
    "palms_alone": (
        mjcf_of(FLOOR + WALL + LEFT_PALM.format("0 0.6 1"), start="0 0 1"),
        "'start' at .* is .*; a robot that starts with its palms in contact needs ground for both feet too",
    ),
    "palms_and_no_ground": (
        mjcf_of(WALL.replace("1 0.1 1", "1 0.01 1") + LEFT_PALM.format("0 0.6 1")),
        "no usable surface for feet; .*; a robot that starts with its palms in contact needs ground for both feet too",
    ),
    "zero_friction": (mjcf_of(FLOOR.replace("/>", ' friction="0"/>')), "geom 'floor' has friction 0; give"),
    "negative_friction": (mjcf_of(FLOOR.replace("/>", ' friction="-0.5"/>')), "geom 'floor' has friction -0.5; give"),
    "unnamed_frictionless": (
        mjcf_of(FLOOR + '<geom size="1" friction="0" pos="0 0 9"/>'),
        "geom 'sphere#1' has friction 0",
    ),
    "nan_friction": (mjcf_of(FLOOR.replace("/>", ' friction="nan"/>')), r"line \d+ has a NaN: <geom name=\"floor\""),
    "nan_position": (mjcf_of(FLOOR, start="0 NaN 0"), r"line \d+ has a NaN"),
    "infinite_position": (mjcf_of(FLOOR, start="0 inf 0"), "pos of site 'start' is not finite"),
    "infinite_friction": (mjcf_of(FLOOR.replace("/>", ' friction="inf"/>')), "friction of geom 'floor' is not finite"),
    "joint": (
        mjcf_of(FLOOR + '<body name="door"><joint name="hinge"/><geom size="0.1"/></body>'),
        r"body 'door' moves \(joint 'hinge'\); a world is static, remove the joint",
    ),
    "free_joint": (mjcf_of(FLOOR + '<body name="ball"><freejoint/><geom size="0.1"/></body>'), "body 'ball' moves"),
    "mocap": (mjcf_of(FLOOR + '<body name="hand" mocap="true"><geom size="0.1"/></body>'), "'hand' is a mocap body"),
    "mocap_number": (mjcf_of(FLOOR + '<body mocap="true"><geom size="0.1"/></body>'), "'body#1' is a mocap body"),
    "equality": (
        mjcf_of(FLOOR + '<body name="a"/>', more='<equality><weld body1="a"/></equality>'),
        "the world has an equality constraint",
    ),
    "timing_zero": (mjcf_of(FLOOR, more=TIMING.format("0 1")), "numeric 'transition_timing' is '0 1'; give two times"),
    "timing_negative": (mjcf_of(FLOOR, more=TIMING.format("1 -1")), "'transition_timing' is '1 -1'"),
    "timing_one": (mjcf_of(FLOOR, more=TIMING.format("1")), "'transition_timing' is '1'; give two"),
    "timing_three": (mjcf_of(FLOOR, more=TIMING.format("1 1 1")), "'transition_timing' is '1 1 1'; give two"),
    "timing_long": (mjcf_of(FLOOR, more=TIMING.format("1 1e9")), "'1 1e\\+09'; give two times .* at most 10"),
    "timing_infinite": (mjcf_of(FLOOR, more=TIMING.format("1 inf")), "'transition_timing' is '1 inf'; give two"),
    "broken_xml": (mjcf_of(FLOOR).replace("</worldbody>", ""), "MuJoCo cannot read this world: "),
    "not_xml": ("hello", "MuJoCo cannot read this world: "),
    "empty": ("", "MuJoCo cannot read this world: "),
    "unknown_attribute": (
        mjcf_of(FLOOR.replace("size", "sise")),
        "cannot read this world: .*unrecognized attribute: 'sise'",
    ),
    "missing_mesh": (
        mjcf_of(FLOOR + '<geom type="mesh" mesh="m"/>', '<mesh name="m" file="nowhere.stl"/>'),
        "cannot read this world: .*nowhere.stl",
    ),
    "mesh_that_is_a_device": (
        mjcf_of(FLOOR + '<geom type="mesh" mesh="m"/>', '<mesh name="m" file="/dev/zero"/>'),
        "/dev/zero is no plain file; name a plain file",
    ),
    "include_that_is_a_device": (mjcf_of(FLOOR + '<include file="/dev/zero"/>'), "/dev/zero is no plain file"),
    "replicas": (
        mjcf_of(FLOOR + '<replicate count="1000000000"><geom size="1"/></replicate>'),
        "<replicate> asks for 1e\\+09 copies or more; at most 10000 are made",
    ),
    "replicas_of_nothing": (mjcf_of(FLOOR + '<replicate count="99999"></replicate>'), "asks for 99998 copies"),
    "replicas_of_replicas": (
        mjcf_of(FLOOR + 3 * '<replicate count="60">' + '<geom size="1"/>' + 3 * "</replicate>"),
        "<replicate> asks for 219[0-9]+ copies or more",
    ),
    "replicas_of_no_number": (mjcf_of(FLOOR + '<replicate count="nan"><site/></replicate>'), "asks for nan copies"),
    "grid_of_a_flex": (mjcf_of(FLOOR + '<flexcomp name="f" count="2000 2000 2000"/>'), "<flexcomp> asks for 8e\\+09"),
    "fine_mesh": (
        mjcf_of(FLOOR, '<mesh name="m" builtin="plate" params="100000 10"/>'),
        "params of <mesh> has 100000; give numbers of at most 300",
    ),
    "many_user_values": (mjcf_of(FLOOR, more='<size nuser_geom="1000000000"/>'), "nuser_geom of <size> is 1000000000"),
    "many_keys": (mjcf_of(FLOOR, more='<size nkey="1000000000"/>'), "nkey of <size> is 1000000000; at most 1000"),
    "contacts_of_a_sensor": (
        mjcf_of(FLOOR, more='<sensor><contact num="2000000000" site="start"/></sensor>'),
        "<contact> asks for 2e\\+09 copies or more",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_world(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text, message = CASES[case]
    path = tmp_path / "bad.xml"
    path.write_text(text)
    with pytest.raises(WorldError, match=message) as caught:
        load_world(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ") and "\n" not in line
    assert os.listdir(tmp_path) == ["bad.xml"]  # no log of MuJoCo's either


@pytest.mark.parametrize("content", [None, b"\xff\xfe\x00junk"], ids=["missing", "binary"])
def test_not_a_world_file(tmp_path, content):
    path = tmp_path / "other.xml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(WorldError, match="other.xml: (no such world file|cannot be read as text)"):
        load_world(path)
    with pytest.raises(WorldError, match="no such world file"):
        load_world(tmp_path)


def test_mesh_of_too_many_parts(make_world):
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    rough = np.array(ball.vertices) * np.random.default_rng(0).uniform(0.98, 1.02, (len(ball.vertices), 1))
    vertices, faces = (" ".join(map(str, np.ravel(x))) for x in (rough, ball.faces))
    with pytest.raises(
        WorldError, match="mesh geom 'ball': it is not convex and has [0-9]+ flat parts, more than 4000"
    ):
        make_world(
            FLOOR + '<geom name="ball" type="mesh" mesh="m"/>', f'<mesh name="m" vertex="{vertices}" face="{faces}"/>'
        )


def test_world_model_holds_only_static_geoms_with_full_contact_bits(make_world):
    model = make_world(FLOOR + '<geom name="ghost" size="1" contype="0" conaffinity="0"/>').mujoco_model
    assert model.nv == 0
    assert model.geom_contype.tolist() == [0x7FFFFFFF, 0] and model.geom_conaffinity.tolist() == [0x7FFFFFFF, 0]
    # Rays of `RAY_GROUPS` see what collides and nothing else.
    from toolkit.world.source import RAY_GROUPS

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geom = np.zeros(1, np.int32)
    down = np.array([0, 0, -1.0])
    assert mujoco.mj_ray(model, data, np.array([0, 0, 5.0]), down, RAY_GROUPS, True, -1, geom) == pytest.approx(5)


def test_a_device_is_no_world():
    with pytest.raises(WorldError, match="/dev/full: no such world file"):
        load_world("/dev/full")
