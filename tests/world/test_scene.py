"""Robot and world in one model."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.robot.samples import TOML, biped_mjcf, write_robot
from tests.world.conftest import mjcf_of
from toolkit.errors import RobotError
from toolkit.robot.loader import load_robot
from toolkit.world.loader import load_world
from toolkit.world.scene import compose_scene, doubts

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
FLOORS = """
<geom name="floor" type="plane" size="0 0 1" friction="0.45" material="checker"/>
<geom name="left_sole" type="box" size="0.2 0.2 0.05" pos="3 0 0.05" friction="0.8" solref="0.1 1" margin="0.01"/>
"""
ASSETS = """
<texture name="sky" type="skybox" builtin="gradient" width="8" height="8"/>
<texture name="checker" type="2d" builtin="checker" width="8" height="8"/><material name="checker" texture="checker"/>
"""
MORE = (
    '<option timestep="0.01" integrator="RK4" cone="pyramidal" iterations="1"><flag warmstart="disable"/></option>'
    '<size memory="1M"/>'
)


@pytest.fixture
def scene(stool, make_world):
    return compose_scene(stool, make_world(FLOORS, assets=ASSETS, more=MORE))


def test_robot_keeps_its_names_and_order(scene, stool):
    assert scene.nq == 9 and scene.nu == 2 and scene.nkey == 0 and scene.neq == 0
    assert [scene.joint(i).name for i in range(scene.njnt)] == ["root_joint", *stool.joint_names]
    for limb in stool.limbs.values():
        assert scene.site(limb.site).name == limb.site
    assert scene.geom("world/floor").id >= 0 and scene.site("world/goal").id >= 0


def test_only_sites_of_the_robot_are_named_after_limbs(stool, make_world):
    wall = '<geom type="box" size="1 0.1 1" pos="0 0.7 1"/><site name="start_left_palm" pos="0 0.6 1"/>'
    scene = compose_scene(stool, make_world(FLOORS + wall, assets=ASSETS))
    limbs = [scene.site(i).name for i in range(scene.nsite) if scene.site(i).name.endswith(("foot", "palm"))]
    assert sorted(limbs) == ["left_foot", "right_foot"]


def test_options_are_those_of_every_run(scene):
    assert scene.opt.timestep == 0.002
    assert scene.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert scene.opt.impratio == 100
    assert scene.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert scene.opt.disableflags == 0
    np.testing.assert_array_equal(scene.opt.gravity, [0, 0, -9.81])


def test_textures_and_lights_are_kept(scene):
    assert scene.ntex == 3 and scene.nmat == 2
    assert mujoco.mjtTexture.mjTEXTURE_SKYBOX in scene.tex_type


@pytest.mark.parametrize(("x", "friction"), [(0.0, 0.45), (3.0, 0.8)])
def test_contact_has_exactly_the_friction_of_the_world(scene, stool, x, friction):
    data = mujoco.MjData(scene)
    data.qpos[:] = stool.home
    data.qpos[0], data.qpos[2] = x, 0.4995 + (0.1 if x else 0.0)
    mujoco.mj_forward(scene, data)
    pairs = [tuple(sorted(scene.geom(int(g)).name for g in contact.geom)) for contact in data.contact]
    assert {"left_sole", "right_sole"} <= {name for pair in pairs for name in pair}
    assert not any("decoration" in name for pair in pairs for name in pair)
    for contact in data.contact:
        assert contact.friction[0] == friction and contact.friction[1] == friction
        assert contact.dim == 3
        np.testing.assert_array_equal(contact.solref, [0.02, 1.0])


def test_robot_does_not_collide_with_itself_differently(scene, stool):
    alone, together = mujoco.MjData(stool.mujoco_model), mujoco.MjData(scene)
    for model, data in ((stool.mujoco_model, alone), (scene, together)):
        data.qpos[:] = stool.home
        data.qpos[2] = 2.0
        data.qpos[7:] = 0.9, -0.9
        mujoco.mj_forward(model, data)
    assert together.ncon == alone.ncon


def test_a_world_is_read_once(stool, tmp_path):
    """What happens to its files after it was loaded does not matter, whatever it is."""
    files = {
        "more.xml": '<mujoco><worldbody><geom name="more" size="0.3" pos="0 3 0"/></worldbody></mujoco>',
        "block.obj": OBJ,
        "heights.bin": np.array([2, 2], np.int32).tobytes() + np.array([0, 1, 1, 0.5], np.float32).tobytes(),
        "world.xml": mjcf_of(
            '<geom type="plane" size="0 0 1"/><body pos="2 0 0"><geom type="mesh" mesh="m" euler="0 0 30"/></body>'
            '<geom type="hfield" hfield="h" pos="0 -3 0"/>',
            '<mesh name="m" file="block.obj"/><hfield name="h" file="heights.bin" size="1 1 0.2 0.1"/>',
            more='<include file="more.xml"/>',
        ),
    }
    for name, text in files.items():
        (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    world = load_world(tmp_path / "world.xml")
    before = compose_scene(stool, world)
    for name in files:
        (tmp_path / name).unlink()
    after = compose_scene(stool, world)
    for name in ("geom_size", "geom_pos", "geom_quat", "body_pos", "body_quat", "mesh_vert", "hfield_data"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_files_of_one_name(stool, tmp_path):
    """A robot's mesh and a world's may have the same file name."""
    own = stool.mjcf.replace("<worldbody>", '<asset><mesh name="shell" file="a.obj"/></asset><worldbody>')
    own = own.replace('type="sphere" size="0.3"', 'type="mesh" mesh="shell"')
    robot = replace(stool, mjcf=own, assets={"a.obj": OBJ.encode()})
    (tmp_path / "a.obj").write_text(OBJ.replace("v 1", "v 2").replace("v 0 1", "v 0 2").replace("v 0 0 1", "v 0 0 2"))
    (tmp_path / "world.xml").write_text(
        mjcf_of(
            '<geom type="plane" size="0 0 1"/><geom name="big" type="mesh" mesh="a" pos="4 0 0"/>',
            '<mesh name="a" file="a.obj"/>',
        )
    )
    scene = compose_scene(robot, load_world(tmp_path / "world.xml"))
    sizes = [np.ptp(scene.mesh_vert[scene.mesh(name).vertadr[0] :][:4], axis=0).max() for name in ("shell", "world/a")]
    assert sizes[1] == pytest.approx(2 * sizes[0], rel=0.1)


def test_robot_that_brings_its_own_floor_is_refused(stool, make_world):
    own = stool.mjcf.replace("<worldbody>", '<worldbody><geom type="plane" size="0 0 1"/>')
    with pytest.raises(RobotError, match="static geoms of the robot"):
        compose_scene(replace(stool, mjcf=own), make_world('<geom type="plane" size="0 0 1"/>'))


def test_robot_with_meshes_in_a_world_without(stool, make_world):
    own = stool.mjcf.replace("<worldbody>", '<asset><mesh file="shell.obj"/></asset><worldbody>')
    robot = replace(stool, mjcf=own, assets={"shell.obj": OBJ.encode()})
    # Warnings are errors here: MuJoCo warns where only one side of an attachment has files.
    assert compose_scene(robot, make_world(FLOORS, assets=ASSETS, more=MORE)).nmesh == 1


def test_a_field_too_fine_for_a_sole_is_doubtful(stool, make_world):
    """A sole on many triangles of a height field makes more contacts with it than MuJoCo keeps."""

    def lines(points: int) -> list[str]:
        heights = " ".join(["0"] * (points * points))
        field = f'<hfield name="rough" nrow="{points}" ncol="{points}" size="1 1 0.1 0.1" elevation="{heights}"/>'
        return doubts(stool, make_world('<geom type="hfield" hfield="rough"/>', assets=field))

    assert lines(21) == []
    (line,) = lines(201)
    assert "'rough'" in line and "MuJoCo keeps 50" in line and "cm apart" in line


@pytest.fixture
def on_cylinders(tmp_path):
    """A robot whose feet are two lying cylinders each, with a pad between them."""
    sole = '<geom type="box" size="0.1 0.05 0.01" pos="0.02 0 -0.07" mass="1"/>'
    lying = "".join(
        f'<geom type="cylinder" size="0.02 0.11" pos="0.02 {y} -0.06" euler="0 1.5707963267948966 0" mass="0.5"/>'
        for y in (-0.02, 0.02)
    )
    toml = TOML.replace("patch = [0.20, 0.10]", "patch = [0.20, 0.10]\npad = 0.01")
    assert sole in biped_mjcf()
    return load_robot(str(write_robot(tmp_path / "cylinders", biped_mjcf().replace(sole, lying), toml)))


@pytest.mark.parametrize("stump", [True, False])
def test_feet_have_no_cylinders_where_the_world_has_some(on_cylinders, make_world, stump):
    stumps = '<geom type="cylinder" size="0.15 0.5" pos="1 0 -0.5"/>'
    scene = compose_scene(on_cylinders, make_world(FLOORS + stumps * stump, assets=ASSETS))
    alone = on_cylinders.mujoco_model
    for limb in on_cylinders.limbs.values():
        kinds, sizes = (
            [getattr(model, name)[model.geom_bodyid == model.body(limb.body).id] for model in (alone, scene)]
            for name in ("geom_type", "geom_size")
        )
        cylinders = kinds[0] == mujoco.mjtGeom.mjGEOM_CYLINDER
        assert cylinders.sum() == 2
        if not stump:
            np.testing.assert_array_equal(kinds[0], kinds[1])
            continue
        assert (kinds[1] == mujoco.mjtGeom.mjGEOM_BOX).all()
        np.testing.assert_allclose(sizes[1][cylinders], [[0.02, 0.02, 0.11]] * 2)
    for name in ("body_mass", "body_inertia", "body_ipos"):
        bodies = [scene.body(alone.body(index).name).id for index in range(1, alone.nbody)]
        np.testing.assert_allclose(getattr(scene, name)[bodies], getattr(alone, name)[1:], atol=1e-9)
