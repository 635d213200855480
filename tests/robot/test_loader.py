"""Finding and loading robots: what works, and the one clear line for what does not."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.robot.samples import LEG, TOML, URDF_TOML, biped_mjcf, biped_urdf, write_robot
from toolkit.errors import RobotError
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.description import read_description
from toolkit.robot.loader import default_robot, find_robots, load_robot, robots_folder
from toolkit.search.moves.occupancy import BodyBox

KNEE = '<joint name="left_knee" axis="0 1 0" range="0.0 2.4" actuatorfrcrange="-250 250" armature="0.01"/>'


def test_robots_are_found_because_they_are_there(tmp_path: Path) -> None:
    assert find_robots(tmp_path) == ()
    write_robot(tmp_path / "zebra")
    write_robot(tmp_path / "ape")
    (tmp_path / "no_robot").mkdir()
    assert find_robots(tmp_path) == ("ape", "zebra")
    assert load_robot("ape", tmp_path).name == "ape"
    assert load_robot(str(tmp_path / "zebra")).folder == (tmp_path / "zebra").resolve()


def test_robots_in_the_current_directory_come_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert robots_folder() == Path(__file__).resolve().parents[2] / "robots"
    shipped = find_robots()
    write_robot(tmp_path / "robots" / "ape")
    assert robots_folder() == tmp_path / "robots" and find_robots() == tuple(sorted(("ape", *shipped)))
    assert default_robot() == "ape" and load_robot(None).folder == (tmp_path / "robots" / "ape").resolve()


def test_shipped_robots_have_their_names_beside_a_folder_of_ones_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    name, mine = default_robot(), tmp_path / "robots"
    own = Path(__file__).resolve().parents[2] / "robots" / name
    mine.mkdir()
    assert default_robot() == name  # an empty folder says nothing
    write_robot(mine / "ape")
    write_robot(mine / "bear")
    assert load_robot(name).folder == own
    with pytest.raises(RobotError, match="which robot is meant. Found ape, bear;"):
        default_robot()
    with pytest.raises(RobotError, match=f"robot '{name}' is not in .*robots; "):
        load_robot(name, mine)  # a folder that is named is the only one
    write_robot(mine / name)
    assert load_robot(name).folder == (mine / name).resolve()


def test_robot_meant_where_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="which robot is meant"):
        default_robot(tmp_path)
    write_robot(tmp_path / "ape")
    assert default_robot(tmp_path) == "ape" and load_robot(None, tmp_path).name == "ape"
    write_robot(tmp_path / "bear")
    with pytest.raises(RobotError, match="Found ape, bear; name one with --robot"):
        load_robot(None, tmp_path)
    (tmp_path / "default").write_text("bear\n")
    assert load_robot(None, tmp_path).name == "bear"


def test_biped(tmp_path: Path) -> None:
    """A robot without arms, with other orders of hip and ankle joints, and sites given by pose."""
    robot = load_robot(str(write_robot(tmp_path / "biped")))
    assert tuple(robot.limbs) == FEET and not robot.arms
    assert len(robot.joint_names) == 12 and robot.mujoco_model.nu == 12
    assert robot.mujoco_model.ngeom == mujoco.MjModel.from_xml_string(biped_mjcf()).ngeom - 1, "the floor is left out"
    np.testing.assert_array_equal(robot.velocity_limit, 10.0)
    np.testing.assert_array_equal(robot.torque_limit[:6], [torque for *_, torque, _ in LEG])
    for foot in FEET:
        leg = robot.legs[foot]
        assert (leg.thigh, leg.shin) == (pytest.approx(0.35), pytest.approx(0.30))
        np.testing.assert_allclose(leg.ankle_in_sole, [-0.02, 0, 0.08], atol=1e-12)
        assert leg.max_length == pytest.approx(0.985 * 0.65)
        assert leg.ranges["knee"] == pytest.approx((0.0, 2.4))
        assert leg.ranges["ankle_pitch"] == pytest.approx((-1.0, 0.8))
        assert leg.torques == pytest.approx(
            {"hip_yaw": 100, "hip_roll": 150, "hip_pitch": 200, "knee": 250, "ankle_pitch": 120, "ankle_roll": 80}
        )


def test_urdf(tmp_path: Path) -> None:
    """A URDF keeps fixed links and inertia, gets a free base and motors, and its speed limits come through."""
    robot = load_robot(str(write_robot(tmp_path / "biped", biped_urdf(), URDF_TOML, "biped.urdf")))
    assert robot.mass == pytest.approx(28 + 12 * 1.5)
    assert len(robot.joint_names) == 12
    np.testing.assert_array_equal(robot.velocity_limit, 7.5)
    np.testing.assert_array_equal(robot.torque_limit[:6], [torque for *_, torque, _ in LEG])
    assert {robot.limbs[foot].body for foot in FEET} == {"left_sole", "right_sole"}
    np.testing.assert_allclose(robot.legs[Limb.LEFT_FOOT].ankle_in_sole, [-0.02, 0, 0.08], atol=1e-12)
    assert robot.armature[robot.joint_names.index("left_knee")] == 0.05


def test_urdf_meshes_are_found_above_the_file(tmp_path: Path) -> None:
    """`package://` is a folder above the URDF; the mesh travels with the robot."""
    faces = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
    vertices = ["v 0 0 0", "v 0.1 0 0", "v 0 0.1 0", "v 0 0 0.1"]
    obj = "\n".join(vertices + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces])
    (tmp_path / "biped" / "meshes").mkdir(parents=True)
    (tmp_path / "biped" / "meshes" / "trunk.obj").write_text(obj)
    text = biped_urdf().replace("trunk.dae", "trunk.obj")
    folder = write_robot(tmp_path / "biped" / "urdf", text, URDF_TOML, "biped.urdf")
    robot = load_robot(str(folder))
    assert list(robot.assets) == ["trunk.obj"] and robot.mujoco_model.nmesh == 1
    assert str(tmp_path) not in robot.mjcf
    assert robot.mass == pytest.approx(28 + 12 * 1.5), "inertia comes from the URDF, not from meshes"

    missing = text.replace("visual>", "collision>").replace("trunk.obj", "lost.stl")
    write_robot(folder, missing, URDF_TOML, "biped.urdf")
    with pytest.raises(RobotError, match=r"collision mesh 'package://biped/meshes/lost.stl' of link 'pelvis' is miss"):
        load_robot(str(folder))


def test_sites_and_pads(tmp_path: Path) -> None:
    """A site of the model file may carry the limb, moved by a pose; a pad gives it a shape to stand on."""
    model = biped_mjcf().replace(
        '<geom type="box" size="0.1 0.05 0.01" pos="0.02 0 -0.07" mass="1"/>',
        '<geom size="0.03" mass="1"/><site name="left_foot" pos="0.01 0 -0.05"/>',
        1,
    )
    toml = TOML.replace(
        'body = "left_foot_link"\nposition = [0.02, 0.0, -0.08]',
        'site = "left_foot"\nposition = [0.01, 0.0, -0.03]\npad = 0.02\nmax_force = 500.0',
    )
    robot = load_robot(str(write_robot(tmp_path / "biped", model, toml)))
    site = robot.mujoco_model.site("left_foot")
    np.testing.assert_allclose(site.pos, [0.02, 0, -0.08], atol=1e-12)
    pad = robot.mujoco_model.geom("left_foot_pad")
    np.testing.assert_allclose(pad.size, [0.1, 0.05, 0.01])
    np.testing.assert_allclose(pad.pos, [0.02, 0, -0.07], atol=1e-12)
    assert robot.limbs[Limb.LEFT_FOOT].max_normal_force == 500.0
    assert robot.mass == pytest.approx(mujoco.MjModel.from_xml_string(model).body_subtreemass[1])


def test_nothing_of_the_file_acts_on_the_robot(tmp_path: Path) -> None:
    """Gravity compensation, servos, priorities, options and keyframes of a file stay behind."""
    model = biped_mjcf().replace(
        "<worldbody>", '<option gravity="0 0 -1"><flag gravity="disable"/></option><worldbody>'
    )
    model = model.replace('<body name="left_knee_link"', '<body name="left_knee_link" gravcomp="1"')
    model = model.replace('type="capsule"', 'type="capsule" priority="2"')
    servo = '<position name="servo" joint="left_knee" kp="500" ctrlrange="0 1" forcerange="-200 180"/>'
    model = model.replace("</mujoco>", f'<actuator>{servo}</actuator><keyframe><key name="k"/></keyframe></mujoco>')
    robot = load_robot(str(write_robot(tmp_path / "biped", model)))
    compiled = robot.mujoco_model
    assert compiled.opt.gravity[2] == -9.81 and compiled.opt.disableflags == 0
    assert not compiled.body_gravcomp.any() and not compiled.geom_priority.any() and compiled.nkey == 0
    assert compiled.nu == 12 and not compiled.actuator_biastype.any()
    # The tighter of joint and servo, the same both ways
    assert robot.torque_limit[robot.joint_names.index("left_knee")] == 180.0
    assert robot.torque_limit[robot.joint_names.index("right_knee")] == 250.0


def test_body_named_like_its_limb(tmp_path: Path) -> None:
    """Sites own the limbs' names; a body of that name gives way."""
    folder = write_robot(
        tmp_path / "b", biped_mjcf().replace("_foot_link", "_foot"), TOML.replace("_foot_link", "_foot")
    )
    assert load_robot(str(folder)).limbs[Limb.LEFT_FOOT].body == "left_foot_link"
    taken = biped_mjcf().replace("left_foot_link", "left_foot").replace("left_knee_link", "left_foot_link")
    folder = write_robot(tmp_path / "c", taken, TOML.replace("left_foot_link", "left_foot"))
    with pytest.raises(RobotError, match="has bodies 'left_foot' and 'left_foot_link'; rename one"):
        load_robot(str(folder))


def test_overlapping_neighbours_are_excluded(tmp_path: Path) -> None:
    """Shapes around one joint overlap by construction; a wrong posture is told apart from that."""
    shank = 'fromto="0 0 -0.08 0 0 -0.24" mass="2"/>'
    model = biped_mjcf().replace(shank, 'fromto="0 0 -0.08 0 0 -0.33" mass="2"/>')
    robot = load_robot(str(write_robot(tmp_path / "biped", model)))
    assert robot.mujoco_model.nexclude == 2
    wide = biped_mjcf().replace('type="capsule" size="0.04"', 'type="capsule" size="0.12"')
    with pytest.raises(RobotError, match="in the home posture 'left_knee_link' touches 'right_knee_link'"):
        load_robot(str(write_robot(tmp_path / "biped", wide)))


def test_fingerprint_follows_the_dynamics(tmp_path: Path) -> None:
    def fingerprint(model: str = biped_mjcf(), toml: str = TOML) -> str:
        return load_robot(str(write_robot(tmp_path / "biped", model, toml))).fingerprint

    reference = fingerprint()
    assert fingerprint(biped_mjcf().replace("<worldbody>", "<!-- a comment --><worldbody>")) == reference
    assert fingerprint(biped_mjcf().replace('mass="8"', 'mass="8" rgba="1 0 0 1"')) == reference
    assert fingerprint(toml=TOML + '[gains]\n"*" = [100.0, 1.0]\n') == reference
    different = {
        fingerprint(biped_mjcf().replace('mass="8"', 'mass="8.1"')),
        fingerprint(biped_mjcf().replace("-250 250", "-240 240", 1)),
        fingerprint(toml=TOML.replace("[0.20, 0.10]", "[0.20, 0.11]", 1)),
        fingerprint(toml=TOML.replace('"*" = 10.0', '"*" = 11.0')),
        fingerprint(toml=TOML.replace('"*_knee" = 0.7', '"*_knee" = 0.72').replace("-0.35", "-0.36")),
    }
    assert len(different) == 5 and reference not in different


BAD_TOML = {
    "no TOML": ("[model", "", "not valid TOML"),
    "unknown key": ("[model]", "colour = 3\n[model]", "unknown key 'colour'; allowed: armature"),
    "misspelt key": ("base =", "bsae =", "unknown key 'model.bsae'; did you mean 'base'?"),
    "misspelt limb": (
        "[limbs.right_foot]", "[limbs.rigth_foot]", "unknown key 'limbs.rigth_foot'; did you mean 'right_foot'?"
    ),
    "missing foot": (
        TOML[TOML.index("[limbs.right") : TOML.index("[home]")], "",
        "[limbs.right_foot] is missing; both feet are needed",
    ),
    "unknown body": (
        'body = "left_foot_link"', 'body = "left_fot_link"',
        "[limbs.left_foot] body 'left_fot_link' does not exist; did you mean 'left_foot_link'?",
    ),
    "unknown site": (
        'body = "left_foot_link"', 'site = "sole"', "[limbs.left_foot] site 'sole' does not exist; allowed: none"
    ),
    "body and site": (
        'body = "left_foot_link"', 'body = "left_foot_link"\nsite = "a"',
        "[limbs.left_foot] needs either 'body' or 'site'",
    ),
    "no patch": ("patch = [0.20, 0.10]", "", "'limbs.left_foot.patch' is missing; it is 2 numbers"),
    "flat patch": (
        "patch = [0.20, 0.10]", "patch = [0.20, 0.0]",
        "'limbs.left_foot.patch' = [0.2, 0.0] must be 2 numbers of at least 0.001",
    ),
    "patch of text": (
        "patch = [0.20, 0.10]", 'patch = "big"', "'limbs.left_foot.patch' = 'big' must be 2 numbers of at least 0.001"
    ),
    "bad quaternion": (
        "patch = [0.20, 0.10]", "patch = [0.20, 0.10]\nquaternion_wxyz = [1.0, 1.0, 0.0, 0.0]",
        "limbs.left_foot.quaternion_wxyz = [1.0, 1.0, 0.0, 0.0] is not of unit length",
    ),
    "unknown base": (
        'base = "pelvis"', 'base = "pelvi"', "model.base 'pelvi' is no body of robot.xml; did you mean 'pelvis'?"
    ),
    "base is no root": (
        'base = "pelvis"', 'base = "left_knee_link"',
        "model.base 'left_knee_link' must be the only body at the root of robot.xml; found pelvis",
    ),
    "missing file": ('file = "{file}"', 'file = "model.xml"', "model.file 'model.xml' does not exist in"),
    "missing package": (
        'file = "{file}"', 'file = "a.urdf"\npackage = "no-such-robots"',
        "package 'no-such-robots' is not installed; `pip install no-such-robots`",
    ),
    "no such file in package": (
        'file = "{file}"', 'file = "a.urdf"\npackage = "mujoco"', "package 'mujoco' has no file 'a.urdf'"
    ),
    "no licence": ('licence = "CC0-1.0"', "", "'licence' is missing"),
    "home pattern": (
        '"*_knee" = 0.7', '"left_nee" = 0.7', "[home] 'left_nee' matches no joint; did you mean 'left_knee'?"
    ),
    "home out of range": (
        '"*_knee" = 0.7', '"*_knee" = -0.7', "[home] joint 'left_knee' = -0.7 is outside its range 0 to 2.4"
    ),
    "home not level": ('"*_knee" = 0.7', '"left_knee" = 0.7', "correct [home] or the poses in [limbs]"),
    "home out of balance": (
        '"*_ankle_pitch" = -0.35', '"*_ankle_pitch" = -0.8', "[home] puts the CoM at"
    ),
    "home of text": ('"*_knee" = 0.7', '"*_knee" = "bent"', "'home.*_knee' = 'bent' must be a number"),
    "sole in the shape": (
        "[0.02, 0.0, -0.08]", "[0.02, 0.0, -0.06]",
        "in the home posture a collision shape of body 'left_foot_link' reaches",
    ),
    "feet backwards": (
        "patch = [0.20, 0.10]", "patch = [0.20, 0.10]\nquaternion_wxyz = [0.0, 0.0, 0.0, 1.0]",
        "the feet point against the base's x axis",
    ),
    "no velocity": ('"*" = 10.0', '"*_hip_*" = 10.0', "have no velocity limit; add them to"),
    "negative velocity": (
        '"*" = 10.0', '"*" = -1.0', "'limits.velocity.*' = -1.0 must be a number of at least 1e-06"
    ),
    "position pattern": (
        "[limits.velocity]", '[limits.position]\n"knee" = [0.0, 1.0]\n[limits.velocity]',
        "[limits.position] 'knee' matches no joint",
    ),
    "empty range": (
        "[limits.velocity]", '[limits.position]\n"*_knee" = [1.0, 1.0]\n[limits.velocity]',
        "joint 'left_knee' has the empty range 1 to 1",
    ),
    "locked leg": (
        "[limbs.left_foot]", '[model.locked_joints]\n"*_ankle_roll" = 0.0\n[limbs.left_foot]',
        "left_foot: the leg has no ankle roll, so its foot has to roll on the ground, but",
    ),
    "locked hip": (
        "[limbs.left_foot]", '[model.locked_joints]\n"*_hip_yaw" = 0.0\n[limbs.left_foot]',
        "left_foot: the leg must be hip yaw, roll and pitch in any order, knee pitch, ankle pitch and",
    ),
    "NaN in a table": ("[limits.velocity]", "[declared]\nmass = [1.0, nan]\n[limits.velocity]",
        "'declared.mass.1' = nan must be a finite number up to 1e+09",
    ),
    "infinite home": ('"*_knee" = 0.7', '"*_knee" = inf', "'home.*_knee' = inf must be a finite number"),
    "400 digits": ('"*_knee" = 0.7', f'"*_knee" = {"9" * 400}', "must be a finite number up to 1e+09"),
    "5000 digits": ('"*_knee" = 0.7', f'"*_knee" = {"9" * 5000}', "not valid TOML"),
    "deep nesting": ("[model]", f"[declared]\na = {'[' * 20000}{']' * 20000}\n[model]", "not valid TOML"),
    "NUL in a file name": ('file = "{file}"', 'file = "a\\u0000b"', "does not exist in"),
    "locked pattern": (
        "[limbs.left_foot]", '[model.locked_joints]\n"gripper" = 0.0\n[limbs.left_foot]',
        "[model.locked_joints] 'gripper' matches no joint",
    ),
}  # fmt: skip

BAD_MODEL = {
    "negative armature": ('armature="0.01"', 'armature="-5"', "MuJoCo warns: Inertia matrix is too close to singular"),
    "hardly any torque": ('"-250 250"', '"-250 1e-300"', "MuJoCo cannot compile it: invalid force range"),
    "NaN in a mass": ('mass="8"', 'mass="nan"', "has a NaN: "),
    "NaN in a joint": ('axis="0 1 0"', 'axis="0 nan 0"', "has a NaN: "),
    "huge": ('pos="0 0 0.8"', 'pos="0 0 1e300"', "is more than 10000 m; give plain numbers"),
    "no shapes that collide": (
        "<worldbody>", '<default><geom contype="0" conaffinity="0"/></default><worldbody>',
        "the patch of [limbs.left_foot] is on a body without any collision shape",
    ),
    "no XML": ("<mujoco", "mujoco", "not valid XML"),
    "not a model": (biped_mjcf(), "<sdf/>", "root element <sdf>; expected <mujoco> (MJCF) or <robot> (URDF)"),
    "unknown element": ("<worldbody>", "<worldbody><wheel/>", "MuJoCo cannot load it"),
    "ball joint": (
        KNEE, '<joint name="left_knee" type="ball"/>', "joint 'left_knee' on body 'left_knee_link' is a ball joint"
    ),
    "two free joints": (
        '<geom type="plane" size="1 1 0.1"/>', '<body name="stool"><freejoint/><geom size="0.1"/></body>',
        "must be the only body at the root of robot.xml; found stool, pelvis",
    ),
    "equality": (
        "</mujoco>", '<equality><joint name="tie" joint1="left_knee" joint2="right_knee"/></equality></mujoco>',
        "equality or mimic constraint 'tie' is not supported; remove it, or lock the joints",
    ),
    "tendon": (
        "</mujoco>",
        '<tendon><fixed name="t"><joint joint="left_knee" coef="1"/></fixed></tendon></mujoco>',
        "tendons are not supported",
    ),
    "no range": (KNEE, KNEE.replace('range="0.0 2.4"', ""), "joint 'left_knee' has no position limit; add it to"),
    "no torque": (KNEE, KNEE.replace('actuatorfrcrange="-250 250"', ""), "joint 'left_knee' has no torque limit; add"),
    "nameless joint": (KNEE, KNEE.replace('name="left_knee"', ""), "a joint on body 'left_knee_link' has no name"),
    "joint named like a body": (
        "left_knee_link", "left_knee", "'left_knee' names both a joint and a body; rename the body to 'left_knee_link'"
    ),
    "slide in a leg": ('<joint name="left_hip_yaw"', '<joint name="left_hip_yaw" type="slide"', "left_hip_yaw (slide)"),
    "massless body": ('mass="2"/>', 'mass="0"/>', "MuJoCo cannot compile it"),
    "oblique leg": (
        'name="left_hip_yaw" axis="0 0 1"', 'name="left_hip_yaw" axis="0 1 1"', "left_hip_yaw (oblique)"
    ),
    "knee bends forwards": (
        KNEE, KNEE.replace("0 1 0", "0 -1 0").replace("0.0 2.4", "-2.4 0.0"), "is outside its range"
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_TOML)
def test_bad_robot_toml(tmp_path: Path, case: str) -> None:
    old, new, message = BAD_TOML[case]
    assert old in TOML, "the case does not change anything"
    folder = write_robot(tmp_path / "biped", toml=TOML.replace(old, new))
    with pytest.raises(RobotError, match=re.escape(message)) as caught:
        load_robot(str(folder))
    text = str(caught.value)
    assert "\n" not in text and text.startswith(str(folder.resolve()))


@pytest.mark.parametrize("case", BAD_MODEL)
def test_bad_model_file(tmp_path: Path, case: str) -> None:
    old, new, message = BAD_MODEL[case]
    assert old in biped_mjcf(), "the case does not change anything"
    folder = write_robot(tmp_path / "biped", biped_mjcf().replace(old, new))
    with pytest.raises(RobotError, match=re.escape(message)) as caught:
        load_robot(str(folder))
    text = str(caught.value)
    assert "\n" not in text and text.startswith(str(folder.resolve()))


PALM = """
[limbs.left_palm]
body = "pelvis"
position = [{}, 0.0, 0.25]
patch = [0.05, 0.05]
[home]"""


@pytest.mark.parametrize(("x", "gap"), [(5.0, "4875"), (0.14, "15")])
def test_limb_away_from_the_shapes_of_its_body(tmp_path: Path, x: float, gap: str) -> None:
    folder = write_robot(tmp_path / "biped", toml=TOML.replace("[home]", PALM.format(x)))
    with pytest.raises(
        RobotError, match=rf"\[limbs.left_palm\] is {gap} mm from the nearest collision shape of 'pelvis'"
    ):
        load_robot(str(folder))


def test_soles_below_any_shape_of_the_foot(tmp_path: Path) -> None:
    folder = write_robot(tmp_path / "biped", toml=TOML.replace("-0.08]", "-0.1]"))
    with pytest.raises(
        RobotError, match=r"\[limbs.left_foot\] is 20 mm from the nearest collision shape of 'left_foot_l"
    ):
        load_robot(str(folder))
    padded = TOML.replace("-0.08]", "-0.1]\npad = 0.02")
    assert load_robot(str(write_robot(folder, toml=padded))).legs


def test_robot_without_shapes_above_its_knees(tmp_path: Path) -> None:
    inertial = '<inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.1"/>'
    model = re.sub(r'<geom [^>]*mass="20"/>', "", biped_mjcf())
    model = re.sub(r'<geom [^>]*mass="(8|3|2|0.2)"[^>]*/>', inertial, model)
    robot = load_robot(str(write_robot(tmp_path / "biped", model)))
    with pytest.raises(RobotError, match="no shape above the knees; add geoms to the torso"):
        BodyBox.of(robot)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    folder = write_robot(tmp_path / "biped")
    (tmp_path / "default").write_bytes(b"\xff")
    with pytest.raises(RobotError, match="default: cannot be read .*; name a robot with --robot"):
        load_robot(None, tmp_path)
    with pytest.raises(RobotError, match="is not in"):
        load_robot("a" * 300, tmp_path)
    (folder / "robot.xml").write_bytes(b'<mujoco model="\xff"/>')
    with pytest.raises(RobotError, match="robot.xml: not valid XML"):
        load_robot("biped", tmp_path)
    (folder / "robot.toml").write_bytes(b"\xff")
    with pytest.raises(RobotError, match="robot.toml: not valid TOML: 'utf-8' codec can't decode"):
        load_robot("biped", tmp_path)
    (folder / "robot.toml").unlink()
    (folder / "robot.toml").symlink_to("/dev/full")
    with pytest.raises(RobotError, match="robot.toml: cannot be read .it is not a file"):
        read_description(folder / "robot.toml")


def test_mimic_joints_must_be_locked(tmp_path: Path) -> None:
    finger = (
        '<link name="finger{0}"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" '
        'ixz="0" iyz="0"/></inertial></link>'
        '<joint name="grip{0}" type="revolute"><parent link="pelvis"/><child link="finger{0}"/>'
        '<origin xyz="0 0 0.4"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5" velocity="1"/>{1}</joint>'
    )
    hand = finger.format(1, "") + finger.format(2, '<mimic joint="grip1" multiplier="-1"/>')
    model = biped_urdf().replace("</robot>", hand + "</robot>")
    folder = write_robot(tmp_path / "biped", model, URDF_TOML, "biped.urdf")
    with pytest.raises(RobotError, match="equality or mimic constraint .* is not supported"):
        load_robot(str(folder))
    locked = URDF_TOML.replace("[limbs.left_foot]", '[model.locked_joints]\n"grip*" = 0.5\n[limbs.left_foot]')
    robot = load_robot(str(write_robot(folder, model, locked, "biped.urdf")))
    assert len(robot.joint_names) == 12 and robot.mujoco_model.neq == 0
    assert robot.mass == pytest.approx(28 + 12 * 1.5 + 0.2)


def test_missing_robot(tmp_path: Path) -> None:
    write_robot(tmp_path / "biped")
    with pytest.raises(RobotError, match=r"robot 'bipet' is not in .*; did you mean 'biped'\?"):
        load_robot("bipet", tmp_path)
    with pytest.raises(RobotError, match="robot 'x' is not in .*; allowed: biped"):
        load_robot("x", tmp_path)
    with pytest.raises(RobotError, match="robot '' is not in"):
        load_robot("", tmp_path)
    with pytest.raises(RobotError, match=r"no robot.toml in this folder"):
        load_robot(str(tmp_path))
