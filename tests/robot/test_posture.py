"""The posture that a draft proposes."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.robot.samples import biped_mjcf
from toolkit import robots
from toolkit.robot.anatomy import Anatomy, find_anatomy
from toolkit.robot.loader import load_robot
from toolkit.robot.posture import standing, stands

KNEELESS = '<key name="stand" qpos="0 0 0.8 1 0 0 0 {angles}"/>'


def arm(side: str, sign: int, joints: int) -> str:
    """An arm of three or four joints that points to the side, as in many files."""
    wrist = f'<body name="{side}_hand" pos="0 {0.2 * sign} 0"><joint name="{side}_wrist" axis="0 0 1" range="-1 1"/>'
    wrist += f'<geom size="0.03" pos="0 {0.05 * sign} 0" mass="0.3"/></body>'
    return f"""<body name="{side}_shoulder" pos="0 {0.16 * sign} 0.36">
      <joint name="{side}_shoulder_pitch" axis="0 {sign} 0" range="-2.5 2.5"/>
      <geom size="0.03" mass="0.5" contype="0" conaffinity="0"/>
      <body name="{side}_upper"><joint name="{side}_shoulder_roll" axis="1 0 0" range="-1.7 1.7"/>
        <geom type="capsule" size="0.03" fromto="0 {0.06 * sign} 0 0 {0.2 * sign} 0" mass="1"/>
        <body name="{side}_lower" pos="0 {0.25 * sign} 0"><joint name="{side}_elbow" axis="1 0 0" range="-2 2"/>
          <geom type="capsule" size="0.03" fromto="0 {0.06 * sign} 0 0 {0.2 * sign} 0" mass="0.6"/>
          {wrist if joints == 4 else ""}
    </body></body></body>"""


def model_of(arms: int = 3, angles: str = "", trunk: float = 0.02) -> mujoco.MjModel:
    """The biped with two arms, and a keyframe where angles are given; the trunk's weight can be ahead of the hips."""
    text = biped_mjcf().replace('pos="0.02 0 0.25"', f'pos="{trunk} 0 0.25"')
    start = text.index("<body name", text.index("<freejoint/>"))
    text = text[:start] + arm("left", 1, arms) + arm("right", -1, arms) + text[start:]
    if angles:
        text = text.replace("</mujoco>", f"<keyframe>{KNEELESS.format(angles=angles)}</keyframe></mujoco>")
    return mujoco.MjModel.from_xml_string(text)


def posed(model: mujoco.MjModel, angles: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for name, angle in angles.items():
        data.qpos[model.jnt_qposadr[model.joint(name).id]] = angle
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


@pytest.mark.parametrize("joints", [3, 4])
def test_arms_that_point_to_the_side_hang_in_the_posture(joints: int) -> None:
    model = model_of(joints)
    anatomy = find_anatomy(model)
    assert [len(each) for each in anatomy.arms] == [joints, joints] and len(anatomy.palms) == (2 if joints == 4 else 0)
    angles = standing(model, anatomy, {})
    assert angles["left_shoulder_roll"] == -angles["right_shoulder_roll"]  # mirrored
    data = posed(model, angles)
    for side, sign in (("left", 1), ("right", -1)):
        upper = data.body(f"{side}_lower").xpos - data.body(f"{side}_shoulder").xpos
        lower = data.body(f"{side}_lower").xipos - data.body(f"{side}_lower").xpos
        assert upper[2] < -0.9 * np.linalg.norm(upper) and sign * upper[1] > 0  # down, and out to its side
        assert lower[2] < -0.7 * np.linalg.norm(lower)


def test_arms_keep_out_of_a_wide_trunk() -> None:
    model = model_of()
    model.geom_size[model.body_geomadr[1] + 1, 1] = 0.35  # as wide as the arms hang
    data = posed(model, standing(model, find_anatomy(model), {}))
    mujoco.mj_collision(model, data)
    names = {model.body(b).name for b in model.geom_bodyid[data.contact.geom].ravel()}
    assert not names & {"left_lower", "right_lower"}


def sole_middle(model: mujoco.MjModel, data: mujoco.MjData, anatomy: Anatomy) -> float:
    feet = [data.body(foot.body) for foot in anatomy.feet]
    points = [f.xmat.reshape(3, 3) @ p.pose.position + f.xpos for f, p in zip(feet, anatomy.feet, strict=True)]
    return float(np.mean(points, axis=0)[0])


@pytest.mark.parametrize("trunk", [-0.05, 0.02, 0.1])
def test_knees_bend_and_the_com_is_over_the_soles(trunk: float) -> None:
    model = model_of(trunk=trunk)
    anatomy = find_anatomy(model)
    angles = standing(model, anatomy, {})
    assert angles["left_knee"] == pytest.approx(0.7, abs=0.01) and angles["right_knee"] == angles["left_knee"]
    ankles = {
        f"{side}_ankle_pitch": -angles[f"{side}_hip_pitch"] - angles[f"{side}_knee"] for side in ("left", "right")
    }
    data = posed(model, angles | ankles)
    assert data.subtree_com[0, 0] == pytest.approx(sole_middle(model, data, anatomy), abs=0.01)


def test_a_keyframe_with_straight_knees_keeps_its_arms_and_bends_its_legs() -> None:
    model = model_of(angles="0.3 0.2 0.1 -0.3 -0.2 -0.1 " + "0 " * 12)
    keyframe = {model.joint(j).name: float(model.key(0).qpos[model.jnt_qposadr[j]]) for j in range(1, model.njnt)}
    angles = standing(model, find_anatomy(model), keyframe)
    assert set(angles) == {f"{side}_{joint}" for side in ("left", "right") for joint in ("hip_pitch", "knee")}
    bent = keyframe | {f"{side}_{joint}": angle for side in ("left", "right") for joint, angle in (("knee", 0.6),)}
    assert standing(model, find_anatomy(model), bent) == {}


def key(base: str, left: float, right: float) -> str:
    """A keyframe with the base turned, and knees bent, as hips and ankles make up for."""
    legs = " ".join(f"{-knee / 2} 0 0 {knee} {-knee / 2} 0" for knee in (left, right))
    return f'<key qpos="0 0 0.8 {base} {legs}"/>'


def test_keyframes_that_squat_lie_or_stand_on_one_leg_are_not_at_ease() -> None:
    upright, prone = "1 0 0 0", "0.7 0 0.7 0"
    keys = [key(upright, 0.6, 0.6), key(upright, 0.0, 0.0), key(upright, 2.0, 2.0), key(upright, 0.3, 1.0)]
    keys.append(key(prone, 0.6, 0.6))
    text = biped_mjcf().replace("</mujoco>", f"<keyframe>{''.join(keys)}</keyframe></mujoco>")
    model = mujoco.MjModel.from_xml_string(text)
    anatomy = find_anatomy(model)
    assert [stands(model, anatomy, each) for each in range(5)] == [True, True, False, False, False]


def test_a_draft_names_both_sides_at_once(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = tmp_path / "biped.xml"
    file.write_text(biped_mjcf())
    assert robots.main(["--inspect", str(file), "--out", str(tmp_path / "biped")]) == 1
    toml = (tmp_path / "biped" / "robot.toml").read_text()
    assert '"*_knee" = 0.7' in toml and re.search(r'^"\*_hip_yaw" = \[\d+', toml, re.MULTILINE)
    assert 'or say "*" = 10.0 of all\n# [limits.velocity]\n# "*_hip_pitch" =' in toml
    with (tmp_path / "biped" / "robot.toml").open("a") as draft:
        draft.write('[limits.velocity]\n"*" = 10.0\n')
    capsys.readouterr()
    assert robots.main([str(tmp_path / "biped")]) == 0
    assert "short of straight" not in capsys.readouterr().out
    home = load_robot(str(tmp_path / "biped")).home
    assert (np.abs(home[7:]) > 0.3).sum() >= 4
