"""What is refused or warned of because it would fail later: motors, passive forces, palms, shapes, straight legs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.robot.samples import LEG, TOML, URDF_TOML, arm_toml, biped_mjcf, biped_urdf, write_robot
from toolkit.errors import RobotError
from toolkit.robot.loader import load_robot
from toolkit.robot.motors import PASSIVE_SHARE, SPIN_UP

KNEES = 'name="{}_knee" axis="0 1 0"'


def test_a_good_robot_has_no_warnings(tmp_path: Path) -> None:
    assert load_robot(str(write_robot(tmp_path / "biped"))).warnings == ()


def test_all_that_is_wrong_is_said_at_once(tmp_path: Path) -> None:
    toml = TOML.replace('base = "pelvis"', 'bsae = "pelvis"').replace("patch = [0.20, 0.10]", 'patch = "big"', 1)
    with pytest.raises(RobotError) as caught:
        load_robot(str(write_robot(tmp_path / "biped", toml=toml.replace('licence = "CC0-1.0"', ""))))
    text = str(caught.value)
    assert "4 things are wrong: (1) " in text and "\n" not in text
    for part in ("unknown key 'model.bsae'", "'model.base' is missing", "'licence' is missing", "left_foot.patch"):
        assert part in text
    toml = TOML.replace('"left_foot_link"', '"foot"').replace('"*" = 10.0', '"*_knees" = 10.0')
    toml += '[gains]\n"ancle" = [1.0, 1.0]\n'
    with pytest.raises(RobotError) as caught:
        load_robot(str(write_robot(tmp_path / "biped", toml=toml)))
    for part in ("[limbs.left_foot] body 'foot'", "[limits.velocity] '*_knees'", "[gains] 'ancle'", "no velocity lim"):
        assert part in str(caught.value)
    toml = TOML + "[gains]\n" + "".join(f'"none_{number}" = [1.0, 1.0]\n' for number in range(9))
    with pytest.raises(RobotError, match=r"9 things are wrong: \(1\) .* \(6\) \[gains\] 'none_5' .* and 3 more$"):
        load_robot(str(write_robot(tmp_path / "biped", toml=toml)))


def test_armature_is_assumed_where_the_file_has_none(tmp_path: Path) -> None:
    robot = load_robot(str(write_robot(tmp_path / "biped", biped_urdf(), URDF_TOML, "biped.urdf")))
    expected = [SPIN_UP * torque / 7.5 for *_, torque, _ in LEG]
    expected[3] = 0.05  # said in the robot.toml
    np.testing.assert_allclose(robot.armature[:6], expected, rtol=1e-5)  # six digits in MuJoCo's XML
    (warning,) = [item for item in robot.warnings if "armature" in item]
    assert warning.startswith("joints 'left_hip_pitch', ") and " and 4 more: the file has no armature; " in warning
    said = URDF_TOML.replace("[armature]", '[armature]\n"*" = 0.0')
    robot = load_robot(str(write_robot(tmp_path / "biped", biped_urdf(), said, "biped.urdf")))
    assert robot.armature[0] == 0.0 and not any("armature" in item for item in robot.warnings)


def test_passive_forces_are_cut_unless_the_toml_names_them(tmp_path: Path) -> None:
    knee = 'name="left_knee" axis'
    model = biped_mjcf().replace(knee, knee.replace("axis", 'damping="92" frictionloss="21" axis'))
    model = model.replace('name="right_knee" axis', 'name="right_knee" damping="0.1" frictionloss="0.2" axis')

    def passive(toml: str) -> tuple[list[float], tuple[str, ...]]:
        robot = load_robot(str(write_robot(tmp_path / "biped", model, toml)))
        dofs = [robot.mujoco_model.joint(f"{side}_knee").dofadr[0] for side in ("left", "right")]
        return [*robot.mujoco_model.dof_damping[dofs], *robot.mujoco_model.dof_frictionloss[dofs]], robot.warnings

    values, warnings = passive(TOML)
    np.testing.assert_allclose(values, [PASSIVE_SHARE * 250 / 10, 0.1, PASSIVE_SHARE * 250, 0.2])
    assert len(warnings) == 2 and "passive damping takes more than 5% of the motor's torque" in warnings[0]
    values, warnings = passive(TOML + '[damping]\n"*_knee" = 3.0\n[friction_loss]\n"*" = 0.0\n')
    assert values == [3.0, 3.0, 0.0, 0.0] and not warnings


def test_limits_out_of_any_motors_reach(tmp_path: Path) -> None:
    model = biped_urdf().replace('effort="250"', 'effort="1e9"')
    with pytest.raises(RobotError, match="'left_knee', 'right_knee': a torque limit of 1e.09 N m is out of any motor"):
        load_robot(str(write_robot(tmp_path / "biped", model, URDF_TOML, "biped.urdf")))
    said = URDF_TOML + '[limits.torque]\n"*_knee" = 250.0\n[limits.velocity]\n"*_knee" = 1000.0\n'
    robot = load_robot(str(write_robot(tmp_path / "biped", model, said, "biped.urdf")))
    assert any("'right_knee': a speed limit above 100 rad/s" in item for item in robot.warnings)


@pytest.mark.parametrize("value", ["nan", "inf"])
@pytest.mark.parametrize(
    "where", ['mass value="28"', 'lower="0.0"', 'velocity="7.5"', 'effort="250"', 'xyz="0 0 -0.35"']
)
def test_numbers_of_a_urdf_that_are_none(tmp_path: Path, where: str, value: str) -> None:
    name, _, number = where.rpartition('="')
    model = biped_urdf().replace(where, f'{name}="{value}"' if " " not in number else f'{name}="0 0 {value}"')
    assert model != biped_urdf()
    with pytest.raises(RobotError) as caught:
        load_robot(str(write_robot(tmp_path / "biped", model, URDF_TOML, "biped.urdf")))
    assert "\n" not in str(caught.value)


def test_palms_that_face_their_forearm_or_lie_far_from_their_hand(tmp_path: Path) -> None:
    good = arm_toml("left")
    assert load_robot(str(write_robot(tmp_path / "arm", biped_mjcf("left"), good))).arms
    flipped = good.replace("patch = [0.08, 0.08]", "patch = [0.08, 0.08]\nquaternion_wxyz = [0.0, 1.0, 0.0, 0.0]")
    with pytest.raises(RobotError, match=r"\[limbs.left_palm\] faces its own forearm; turn it over"):
        load_robot(str(write_robot(tmp_path / "arm", biped_mjcf("left"), flipped)))
    far = good.replace("[0.0, 0.0, -0.09]", "[5.0, 0.0, -0.09]\npad = 0.01")
    with pytest.raises(RobotError, match=r"patch of \[limbs.left_palm\] lies 4\d+ mm from its body"):
        load_robot(str(write_robot(tmp_path / "arm", biped_mjcf("left"), far)))


def test_home_legs_too_straight_to_step(tmp_path: Path) -> None:
    straight = TOML.replace('"*_knee" = 0.7', '"*_knee" = 0.2').replace("-0.35", "-0.1")
    robot = load_robot(str(write_robot(tmp_path / "biped", toml=straight)))
    assert len(robot.warnings) == 2 and robot.warnings[0].startswith("left_foot: the leg of the home posture is ")
    assert "bend the knee more in [home]" in robot.warnings[0]


def test_no_shape_above_the_knees(tmp_path: Path) -> None:
    robot = load_robot(str(write_robot(tmp_path / "biped", biped_urdf(), URDF_TOML, "biped.urdf")))
    assert any(item.startswith("no shape above the knees collides") for item in robot.warnings)


def test_gains_follow_the_body(tmp_path: Path) -> None:
    robot = load_robot(
        str(write_robot(tmp_path / "arm", biped_mjcf("left"), arm_toml("left") + '[gains]\n"*knee" = [9.0, 1.0]'))
    )
    stiff = 3 * robot.mass * 9.81 * robot.com_height
    gains = dict(zip(robot.joint_names, zip(robot.kp, robot.kd, strict=True), strict=True))
    assert gains["left_hip_yaw"] == pytest.approx((stiff, stiff / 100))
    assert gains["left_elbow"] == pytest.approx((stiff / 10, stiff / 1000)) and gains["left_knee"] == (9.0, 1.0)
