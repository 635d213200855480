"""[mend], keyframes and flat soles: model files that cannot be used as they are, put right by the robot.toml."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import mujoco
import numpy as np
import pytest

from tests.robot.samples import TOML, URDF_TOML, biped_mjcf, biped_urdf, write_robot
from toolkit.errors import PackageError, RobotError
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.loader import load_robot


def mended(text: str, toml: str = TOML) -> str:
    return toml.replace("[limbs.left_foot]", f"[mend]\n{text}\n\n[limbs.left_foot]")


def test_names_of_bodies_and_joints(tmp_path: Path) -> None:
    model = biped_mjcf().replace("left_knee_link", "left_knee").replace('"right_knee"', '"right_nee"')
    exclude = '<contact><exclude body1="left_knee" body2="right_knee_link"/></contact></mujoco>'
    model = model.replace("</mujoco>", exclude)
    text = 'rename_bodies = { left_knee = "left_shin" }\nrename_joints = { right_nee = "right_knee" }'
    robot = load_robot(str(write_robot(tmp_path / "biped", model, mended(text))))
    assert "right_knee" in robot.joint_names and robot.mujoco_model.body("left_shin").id > 0
    assert robot.mujoco_model.nexclude == 1
    wrong = 'rename_bodies = { left_nee = "a", left_knee = "pelvis" }'
    with pytest.raises(RobotError, match="'left_nee' does not exist; did you mean .*'pelvis' exists already"):
        load_robot(str(write_robot(tmp_path / "biped", model, mended(wrong))))


def test_speed_limits_of_a_urdf_follow_their_joints(tmp_path: Path) -> None:
    model = biped_urdf().replace('"left_knee"', '"bend"')
    toml = mended('rename_joints = { bend = "left_knee" }', URDF_TOML)
    robot = load_robot(str(write_robot(tmp_path / "biped", model, toml, "biped.urdf")))
    np.testing.assert_array_equal(robot.velocity_limit, 7.5)


def test_empty_roots_are_dropped_and_the_base_is_not(tmp_path: Path) -> None:
    model = biped_mjcf().replace("</worldbody>", '<body name="map"><body name="odom"/></body></worldbody>')
    with pytest.raises(RobotError, match="found pelvis, map; drop the others in .mend."):
        load_robot(str(write_robot(tmp_path / "biped", model)))
    robot = load_robot(str(write_robot(tmp_path / "biped", model, mended('drop = ["map"]'))))
    assert robot.mujoco_model.nbody == mujoco.MjModel.from_xml_string(biped_mjcf()).nbody
    with pytest.raises(RobotError, match="drop 'pel.*' would remove the base 'pelvis'"):
        load_robot(str(write_robot(tmp_path / "biped", model, mended('drop = ["map", "pel*"]'))))
    with pytest.raises(RobotError, match="drop 'mop' matches no body; did you mean 'map'"):
        load_robot(str(write_robot(tmp_path / "biped", model, mended('drop = ["mop"]'))))


def test_collision_shapes(tmp_path: Path) -> None:
    """Shapes of a group that were switched off, boxes around shapes, boxes of numbers, and none at all."""
    model = biped_mjcf().replace("<worldbody>", '<default><geom contype="0" conaffinity="0"/></default><worldbody>')
    robot = load_robot(str(write_robot(tmp_path / "biped", model, mended('collision = { "*" = "group 0" }'))))
    plain = load_robot(str(write_robot(tmp_path / "plain")))
    assert (robot.mujoco_model.geom_contype == 1).all() and robot.mass == pytest.approx(plain.mass)
    text = """
    [mend.collision]
    "*" = "none"
    "*_foot_link" = "box"
    "*_hip_yaw_link" = "box"
    "pelvis" = [[0.01, 0.0, 0.2], [0.1, 0.2, 0.3]]"""
    robot = load_robot(str(write_robot(tmp_path / "biped", model, mended(text))))
    compiled = robot.mujoco_model
    colliding = np.flatnonzero(compiled.geom_contype)
    assert len(colliding) == 5 and robot.mass == pytest.approx(plain.mass)
    by_body = {compiled.body(compiled.geom_bodyid[geom]).name: geom for geom in colliding}
    np.testing.assert_allclose(compiled.geom_size[by_body["pelvis"]], [0.05, 0.1, 0.15])
    np.testing.assert_allclose(compiled.geom_size[by_body["left_hip_yaw_link"]], [0.05, 0.05, 0.15], atol=1e-9)
    with pytest.raises(RobotError, match="'mend.collision.pelvis' = 'ball' must be 'none', 'box', 'group N' or"):
        load_robot(str(write_robot(tmp_path / "biped", model, mended('collision = { pelvis = "ball" }'))))


def test_collision_meshes_that_cannot_be_read(tmp_path: Path) -> None:
    model = biped_urdf().replace("visual>", "collision>")
    folder = write_robot(tmp_path / "biped", model, URDF_TOML, "biped.urdf")
    with pytest.raises(RobotError, match="replace the shape in .mend.collision."):
        load_robot(str(folder))
    toml = mended("collision = { pelvis = [[0.0, 0.0, 0.2], [0.2, 0.3, 0.4]] }", URDF_TOML)
    robot = load_robot(str(write_robot(folder, model, toml, "biped.urdf")))
    assert not any("above the knees" in warning for warning in robot.warnings)


def test_excluded_pairs(tmp_path: Path) -> None:
    wide = biped_mjcf().replace('type="capsule" size="0.04"', 'type="capsule" size="0.12"')
    pairs = 'exclude = [["left_*", "right_*"]]'
    robot = load_robot(str(write_robot(tmp_path / "biped", wide, mended(pairs))))
    assert robot.mujoco_model.nexclude >= 36  # six bodies of each leg


@pytest.mark.parametrize("urdf", [False, True])
def test_a_base_that_looks_backwards(tmp_path: Path, urdf: bool) -> None:
    """Turned by half a turn, the robot is the same as one whose base looks ahead, but for the base's own axes."""
    ahead, toml, file = (biped_urdf(), URDF_TOML, "b.urdf") if urdf else (biped_mjcf(), TOML, "b.xml")
    back = _backwards_urdf() if urdf else _backwards_mjcf()
    with pytest.raises(RobotError, match="the feet point against the base's x axis"):
        load_robot(str(write_robot(tmp_path / "back", back, toml, file)))
    plain = load_robot(str(write_robot(tmp_path / "ahead", ahead, toml, file)))
    robot = load_robot(str(write_robot(tmp_path / "back", back, mended("forward = [-1.0, 0.0]", toml), file)))
    for foot in FEET:
        np.testing.assert_allclose(robot.legs[foot].hip_in_com, plain.legs[foot].hip_in_com, atol=1e-9)
    data = [mujoco.MjData(item.mujoco_model) for item in (plain, robot)]
    for item, state in zip((plain, robot), data, strict=True):
        state.qpos[:] = item.home
        mujoco.mj_forward(item.mujoco_model, state)
    np.testing.assert_allclose(data[1].xpos, data[0].xpos, atol=1e-9)
    np.testing.assert_allclose(data[1].subtree_com[1], data[0].subtree_com[1], atol=1e-9)


def _backwards_mjcf() -> str:
    start = biped_mjcf().index("<freejoint/>") + len("<freejoint/>")
    end = biped_mjcf().rindex("</body>")
    text = biped_mjcf()
    return f'{text[:start]}<frame quat="0 0 0 1">{text[start:end]}</frame>{text[end:]}'


def _backwards_urdf() -> str:
    text = biped_urdf().replace('<origin xyz="0.012 0 0.15"/>', '<origin xyz="-0.012 0 0.15"/>')
    for y in (0.1, -0.1):
        text = text.replace(f'<origin xyz="0 {y} -0.05"/>', f'<origin xyz="0 {-y} -0.05" rpy="0 0 {np.pi!r}"/>')
    return text


def test_inertia_that_no_body_can_have(tmp_path: Path) -> None:
    bad = '<inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.5"/>'
    model = biped_mjcf().replace("<freejoint/>", f"<freejoint/>{bad}")
    with pytest.raises(RobotError, match="inertia"):
        load_robot(str(write_robot(tmp_path / "biped", model)))
    robot = load_robot(str(write_robot(tmp_path / "biped", model, mended("balance_inertia = true"))))
    np.testing.assert_allclose(robot.mujoco_model.body_inertia[1], 0.7 / 3, rtol=1e-5)
    text = "balance_inertia = true\nleast_mass = 6.0\nleast_inertia = 0.01"
    robot = load_robot(str(write_robot(tmp_path / "biped", model, mended(text))))
    assert robot.mujoco_model.body_mass[1:].min() >= 6.0 and robot.mujoco_model.body_inertia[1:].min() >= 0.01


def test_tendons_are_left_out_with_what_pulls_and_measures_them(tmp_path: Path) -> None:
    fixed = '<fixed name="hamstring" range="-1 2" limited="true"><joint joint="left_knee" coef="1"/></fixed>'
    tendon = f"<tendon>{fixed}</tendon>"
    motor = '<actuator><motor name="pull" tendon="hamstring"/></actuator>'
    sensor = '<sensor><tendonpos name="length" tendon="hamstring"/></sensor>'
    model = biped_mjcf().replace("</mujoco>", f"{tendon}{motor}{sensor}</mujoco>")
    with pytest.raises(RobotError, match="tendons are not supported; remove them, or say without_tendons = true"):
        load_robot(str(write_robot(tmp_path / "biped", model)))
    robot = load_robot(str(write_robot(tmp_path / "biped", model, mended("without_tendons = true"))))
    plain = load_robot(str(write_robot(tmp_path / "biped", biped_mjcf())))
    assert robot.mjcf == plain.mjcf


KEY = "<keyframe><key name='stand' qpos='0 0 0 1 0 0 0 {}'/></keyframe></mujoco>"


def test_a_keyframe_is_home_and_ankles_make_the_soles_flat(tmp_path: Path) -> None:
    legs = "-0.3 0.02 0 0.7 0 -0.3 -0.3 -0.02 0 0.7 0 -0.3"
    model = biped_mjcf().replace("</mujoco>", KEY.format(legs))
    home = '[home]\nkeyframe = "stand"\n'
    toml = TOML[: TOML.index("[home]")] + home + TOML[TOML.index("[limits.velocity]") :]
    with pytest.raises(RobotError, match="leaves the soles 2.1° and .* let `flat_soles = true` in .home. turn"):
        load_robot(str(write_robot(tmp_path / "biped", model, toml)))
    robot = load_robot(str(write_robot(tmp_path / "biped", model, toml.replace(home, f"{home}flat_soles = true\n"))))
    home_of = dict(zip(robot.joint_names, robot.home[7:], strict=True))
    assert home_of["left_knee"] == 0.7 and home_of["left_hip_roll"] == 0.02
    assert home_of["left_ankle_pitch"] == pytest.approx(-0.4, abs=1e-3)  # the hip is rolled
    assert home_of["left_ankle_roll"] == pytest.approx(-0.02, abs=1e-3)
    data = mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(robot.mujoco_model, data)
    for foot in FEET:
        np.testing.assert_allclose(data.site(foot.label).xmat[8], 1.0, atol=1e-12)
    with pytest.raises(RobotError, match=r"\[home\] keyframe 'stnd' does not exist in robot.xml; did you mean 'stand'"):
        load_robot(str(write_robot(tmp_path / "biped", model, toml.replace('"stand"', '"stnd"'))))


def test_a_model_by_its_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in for robot_descriptions, whose modules download when they are imported."""
    (tmp_path / "far.xml").write_text(biped_mjcf())
    toml = TOML.replace('file = "{file}"', 'robot_descriptions = "biped_description"')
    folder = write_robot(tmp_path / "biped", toml=toml)
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    with pytest.raises(PackageError, match="package 'robot_descriptions' is not installed; `pip install"):
        load_robot(str(folder))
    package, module = ModuleType("robot_descriptions"), ModuleType("robot_descriptions.biped_description")
    package.__path__ = []
    monkeypatch.setitem(sys.modules, "robot_descriptions", package)
    with pytest.raises(RobotError, match="robot_descriptions has no module 'biped_description'"):
        load_robot(str(folder))
    monkeypatch.setitem(sys.modules, "robot_descriptions.biped_description", module)
    with pytest.raises(RobotError, match="robot_descriptions.biped_description names no model file"):
        load_robot(str(folder))
    vars(module)["MJCF_PATH"] = str(tmp_path / "far.xml")
    assert load_robot(str(folder)).legs[Limb.LEFT_FOOT].shin == pytest.approx(0.3)
    folder = write_robot(tmp_path / "both", toml=toml.replace("[model]", '[model]\nfile = "a.xml"'))
    with pytest.raises(RobotError, match="model.robot_descriptions stands for model.file and model.package"):
        load_robot(str(folder))


def test_a_download_that_fails_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "robot_descriptions"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "far_description.py").write_text("raise OSError('no route to host\\nat all')\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "robot_descriptions", raising=False)
    toml = TOML.replace('file = "{file}"', 'robot_descriptions = "far_description"')
    with pytest.raises(PackageError, match="far_description cannot be fetched: no route to host at all$"):
        load_robot(str(write_robot(tmp_path / "biped", toml=toml)))
    monkeypatch.delitem(sys.modules, "robot_descriptions", raising=False)


def test_a_site_with_the_name_of_its_body(tmp_path: Path) -> None:
    site = '<body name="left_knee_link"'
    model = biped_mjcf()
    assert site in model
    at = model.index(">", model.index(site)) + 1
    model = model[:at] + '<site name="left_knee_link"/><site/>' + model[at:]
    robot = load_robot(str(write_robot(tmp_path / "biped", model)))
    assert {robot.mujoco_model.site(i).name for i in range(robot.mujoco_model.nsite)} == {
        limb.label for limb in robot.limbs
    }
