"""`python -m toolkit.robots --inspect`: a model nobody has described, and the draft that loads."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.robot.samples import LEG, biped_mjcf, biped_urdf, write_robot
from tests.shipped_robots import OWN
from toolkit import robots
from toolkit.errors import InputError, PackageError
from toolkit.geometry.limb import FEET, PALMS
from toolkit.geometry.pose import Pose
from toolkit.robot.anatomy import find_anatomy
from toolkit.robot.loader import load_robot
from toolkit.robot.located import locate
from toolkit.robot.source import read_model


@pytest.mark.parametrize("name", OWN)
def test_patches_are_found_where_a_person_put_them(name: str) -> None:
    robot = load_robot(name)
    (path,) = robot.folder.glob("*.xml")
    anatomy = find_anatomy(read_model(path).spec.compile())
    assert anatomy.base == robot.base and anatomy.forward == pytest.approx([1, 0], abs=1e-9)
    for found, labels in ((anatomy.feet, FEET), (anatomy.palms, PALMS)):
        for patch, limb in zip(found, labels, strict=True):
            site = robot.mujoco_model.site(limb.label)
            expected = Pose.from_quaternion(site.pos, site.quat)
            assert patch.body == robot.limbs[limb].body
            np.testing.assert_allclose(patch.pose.position, expected.position, atol=2e-3)
            assert patch.pose.rotation[:, 2] @ expected.rotation[:, 2] > 0.999
            np.testing.assert_allclose(patch.size, 2 * robot.limbs[limb].half_size, atol=2e-3)


def solid(urdf: str) -> str:
    """The URDF with a trunk that collides."""
    box = '<collision><origin xyz="0 0 0.2"/><geometry><box size="0.2 0.2 0.4"/></geometry></collision></link>'
    return urdf.replace("</link>", box, 1)


def test_a_draft_loads(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = tmp_path / "biped.urdf"
    file.write_text(solid(biped_urdf()))
    out = tmp_path / "robots" / "biped"
    assert robots.main(["--inspect", str(file), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "left_knee: about y, 0.000…2.400 rad, 250 N m, 7.5 rad/s, armature 0" in text
    assert "the draft loads: 12 joints" in text and "no armature" in text
    assert 'file = "../../biped.urdf"' in (out / "robot.toml").read_text()
    robot = load_robot("biped", tmp_path / "robots")
    assert robot.joint_names[:6] == tuple(f"left_{joint}" for joint, *_ in LEG)
    np.testing.assert_allclose(2 * robot.limbs[FEET[0]].half_size, [0.2, 0.1])
    np.testing.assert_allclose(robot.legs[FEET[0]].ankle_in_sole, [-0.02, 0, 0.08], atol=1e-9)
    with pytest.raises(InputError, match="has a robot.toml already; choose another folder"):
        robots.main(["--inspect", str(file), "--out", str(out)])


@pytest.fixture
def inspected(tmp_path: Path, capsys: pytest.CaptureFixture) -> Callable[[str, str], str]:
    """What is printed of a model, by the name of its file and its text, whose draft is not complete."""

    def inspect(name: str, text: str) -> str:
        (tmp_path / name).write_text(text)
        assert robots.main(["--inspect", str(tmp_path / name)]) == 1
        return capsys.readouterr().out

    return inspect


def test_what_is_missing_is_said_at_once(inspected: Callable[[str, str], str]) -> None:
    text = inspected("biped.xml", biped_mjcf())
    assert "does not load yet: look up [limits.velocity] of 12 joints (left_hip_pitch, " in text
    assert '# "*_knee" =' in text and "limits.torque" not in text


def test_torques_of_no_motor_are_to_be_looked_up(inspected: Callable[[str, str], str]) -> None:
    text = inspected("biped.xml", biped_mjcf().replace("-250 250", "-250000 250000"))
    assert "look up [limits.torque] of 2 joints (left_knee, right_knee); [limits.velocity] of 12" in text
    assert '# [limits.torque]\n# "*_knee" =\n' in text


def test_a_hand_without_shapes_ends_where_its_inertia_does(tmp_path: Path) -> None:
    """As hands are that come without the gripper that a program attaches."""
    (path,) = load_robot(OWN[0]).folder.glob("*.xml")
    spec = read_model(path).spec
    before = find_anatomy(spec.compile())
    hand = spec.body(before.palms[0].body)
    for geom in list(hand.geoms):
        spec.delete(geom)
    hand.mass, hand.ipos, hand.inertia, hand.explicitinertial = 0.5, [0.0, 0.0, -0.08], [6e-4, 6e-4, 2e-4], True
    found = find_anatomy(spec.compile()).palms[0]
    half = np.sqrt(1.5 * (6e-4 + 6e-4 + 2e-4 - 2 * np.array([6e-4, 6e-4, 2e-4])) / 0.5)  # of a box with that inertia
    assert found.seen and not found.shaped and before.palms[0].shaped
    np.testing.assert_allclose(found.pose.position, [0.0, 0.0, -0.08 - half[2]], atol=2e-3)


def test_feet_without_shapes_are_said_to_be_guessed(inspected: Callable[[str, str], str]) -> None:
    sole = '<mesh filename="sole.dae"/>'
    text = inspected("biped.urdf", biped_urdf().replace('<box size="0.2 0.1 0.02"/>', sole))
    assert "the draft loads: 12 joints, CoM at 0." in text
    assert ", but look up [limbs.left_foot]: 'left_foot_link' has no shape that can be read" in text
    assert '[mend]\ncollision = { left_sole = "none", right_sole = "none" }' in text


def test_a_base_that_looks_back_a_waist_below_the_trunk_and_an_empty_root(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    start, end = biped_mjcf().index("<freejoint/>"), biped_mjcf().rindex("</body>")
    inner = biped_mjcf()[start + len("<freejoint/>") : end]
    waist = f'<body name="waist" quat="0 0 0 1"><joint name="waist" axis="0 0 1" range="-1 1"/>{inner}</body>'
    trunk = f'<geom size="0.1" mass="1"/>{waist}'
    text = biped_mjcf()[:start] + "<freejoint/>" + trunk + biped_mjcf()[end:]
    file.write_text(text.replace("</worldbody>", '<body name="map"/></worldbody>'))
    anatomy = find_anatomy(read_model(file).spec.compile())
    assert anatomy.shared == ("waist",) and anatomy.others == ("map",)
    np.testing.assert_allclose(anatomy.forward, [-1, 0], atol=1e-9)
    assert [patch.body for patch in anatomy.feet] == ["left_foot_link", "right_foot_link"]


TURNS = {
    "y up": [0.0, 0.70710678, 0.70710678, 0.0],
    "looks to the left": [0.70710678, 0.0, 0.0, 0.70710678],
    "lies on its back, askew": [0.6, 0.1, -0.75, 0.2],
    "upside down": [0.0, 0.0, 1.0, 0.0],
}


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS)
def test_a_base_with_any_axes_gives_the_same_robot(turn: list[float], tmp_path: Path) -> None:
    """The base's axes are turned in its file, and everything on it stays where it is; the draft turns them back."""
    text, quaternion = biped_mjcf(), " ".join(map(str, turn))
    w, x, y, z = turn
    start, end = text.index("<freejoint/>") + len("<freejoint/>"), text.rindex("</body>")
    inner = f'<frame quat="{w} {-x} {-y} {-z}">{text[start:end]}</frame>'
    turned = text[:start].replace('pos="0 0 0.8"', f'pos="0 0 0.8" quat="{quaternion}"') + inner + text[end:]
    robots_made = []
    for name, model in (("plain", text), ("turned", turned)):
        (tmp_path / f"{name}.xml").write_text(model)
        folder = tmp_path / name
        assert robots.main(["--inspect", str(tmp_path / f"{name}.xml"), "--out", str(folder)]) == 1
        with (folder / "robot.toml").open("a") as draft:
            draft.write('[limits.velocity]\n"*" = 10.0\n')
        robots_made.append(load_robot(str(folder)))
    plain, robot = robots_made
    assert "[mend]" not in (tmp_path / "plain" / "robot.toml").read_text()
    assert robot.com_height == pytest.approx(plain.com_height, abs=1e-6)
    for foot in FEET:
        np.testing.assert_allclose(robot.legs[foot].hip_in_com, plain.legs[foot].hip_in_com, atol=1e-6)
        np.testing.assert_allclose(robot.legs[foot].ankle_in_sole, plain.legs[foot].ankle_in_sole, atol=1e-6)
    np.testing.assert_allclose(robot.home[7:], plain.home[7:], atol=0.02)


@pytest.mark.parametrize("waist", [False, True])
def test_toes_are_held_still_and_belong_to_the_sole(waist: bool, tmp_path: Path) -> None:
    """A sole of two parts with a joint between them; ankles, which are no toes, move, also below a waist."""
    text = biped_mjcf()
    if waist:
        start, end = text.index("<freejoint/>") + len("<freejoint/>"), text.rindex("</body>")
        joints = '<joint name="turn" axis="0 0 1" range="-1 1"/><joint name="lean" axis="1 0 0" range="-1 1"/>'
        text = f'{text[:start]}<geom size="0.1"/><body name="hips">{joints}{text[start:end]}</body>{text[end:]}'
    plain = text
    for side in ("left", "right"):
        at = text.index("<geom", text.index(f'<body name="{side}_foot_link"'))
        toe = f"""<body name="{side}_toe_link" pos="0.12 0 -0.065">
          <joint name="{side}_toe" axis="0 1 0" range="-1 0.2"/>
          <geom type="box" size="0.03 0.05 0.0075" pos="0.03 0 -0.0075" mass="0.1"/></body>"""
        text = text[:at] + toe + text[at:]
    (tmp_path / "biped.xml").write_text(text)
    anatomy = find_anatomy(read_model(tmp_path / "biped.xml").spec.compile())
    before = find_anatomy(mujoco.MjModel.from_xml_string(plain))
    assert anatomy.beyond == ("left_toe", "right_toe") and before.beyond == () and not anatomy.arms
    for found, foot in zip(anatomy.feet, before.feet, strict=True):
        assert found.body == foot.body and found.joints == foot.joints
        np.testing.assert_allclose(found.size, foot.size + [0.06, 0.0], atol=1e-6)
    assert robots.main(["--inspect", str(tmp_path / "biped.xml"), "--out", str(tmp_path / "biped")]) == 1
    held = "turn = 0, lean = 0, " * waist + "left_toe = 0, right_toe = 0"
    assert f"locked_joints = {{ {held} }}" in (tmp_path / "biped" / "robot.toml").read_text()


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_knee_that_bends_against_the_other_is_named_with_its_range(
    side: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    file = tmp_path / "biped.urdf"
    before, name, after = solid(biped_urdf()).partition(f'<joint name="{side}_knee"')
    file.write_text(before + name + after.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 -1 0"/>', 1))
    assert robots.main(["--inspect", str(file)]) == 1
    text = capsys.readouterr().out
    assert f"{side}_knee: about -y, 0.000…2.400 rad" in text and "toes along (1.00, " in text
    assert f"[limits.position] of '{side}_knee', which bends against the other knee" in text
    assert "perhaps [-2.4, 0]" in text


def test_models_are_found_by_package_and_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere.xml: no such file; give an MJCF or URDF file, or PACKAGE:FILE"):
        locate("nowhere.xml")
    with pytest.raises(PackageError, match="'no-such-package' is neither a file nor an installed package; `pip ins"):
        locate("no-such-package")
    with pytest.raises(InputError, match="package 'numpy' has 0 models; name one as numpy:FILE: none"):
        locate("numpy")
    located = locate(str(write_robot(tmp_path / "a") / "robot.xml"))
    assert located.lines(tmp_path / "b") == ['file = "../a/robot.xml"']
    with pytest.raises(InputError, match="--out is the folder of a draft; it needs --inspect"):
        robots.main(["--out", "there"])


def test_a_model_that_cannot_be_compiled_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "bad.xml"
    file.write_text(biped_mjcf().replace('type="box" size="0.08 0.12 0.05"', 'type="mesh" mesh="none"'))
    with pytest.raises(InputError, match=r"bad.xml: MuJoCo cannot"):
        robots.main(["--inspect", str(file)])
