"""Two-link legs and arm reaches against MuJoCo's kinematics, on joints with other signs, zeros and orders too."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.robot.samples import TOML, biped_mjcf, write_robot
from tests.shipped_robots import OWN
from toolkit.errors import RobotError
from toolkit.geometry.limb import FEET, Limb
from toolkit.physics.leg import leg_posture, leg_torques
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from toolkit.search.moves.limits import sole_room

LEFT = Limb.LEFT_FOOT


def reversed_knees() -> tuple[str, str]:
    """Knees that turn about -y, and thighs whose zero points 0.3 rad forwards."""
    model = biped_mjcf()
    for side in ("left", "right"):
        model = model.replace(
            f'name="{side}_knee" axis="0 1 0" range="0.0 2.4"', f'name="{side}_knee" axis="0 -1 0" range="-2.4 0"'
        )
        model = model.replace(f'name="{side}_hip_pitch" axis', f'name="{side}_hip_pitch" ref="0.3" axis')
    model = model.replace('range="-2.0 1.0"', 'range="-1.7 1.3"')
    toml = TOML.replace('"*_knee" = 0.7', '"*_knee" = -0.7').replace('"*_hip_pitch" = -0.35', '"*_hip_pitch" = -0.05')
    return model, toml


def bent_zero() -> tuple[str, str]:
    """Knees whose zero is flexed by 0.4 rad: the link itself is turned."""
    quaternion = f'quat="{np.cos(0.2)} 0 {np.sin(0.2)} 0"'
    model = biped_mjcf()
    for side in ("left", "right"):
        model = model.replace(
            f'name="{side}_knee_link" pos="0 0 -0.35"', f'name="{side}_knee_link" pos="0 0 -0.35" {quaternion}'
        )
    model = model.replace('range="0.0 2.4"', 'range="-0.4 2.0"')
    return model, TOML.replace('"*_knee" = 0.7', '"*_knee" = 0.3')


@pytest.fixture(params=["plain", "reversed knees", "bent zero", *OWN])
def robot(request: pytest.FixtureRequest, tmp_path: Path) -> RobotModel:
    variants = {"plain": (biped_mjcf(), TOML), "reversed knees": reversed_knees(), "bent zero": bent_zero()}
    if request.param not in variants:
        return load_robot(request.param)
    return load_robot(str(write_robot(tmp_path / "biped", *variants[request.param])))


def test_leg_lengths_and_angles(robot: RobotModel) -> None:
    """In random crouches the hip stands where the two links and the sole's angles put it."""
    model, data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_forward(model, data)
    base = data.xmat[1].reshape(3, 3)
    hips = {foot: base.T @ (data.subtree_com[1] - data.xpos[1]) + leg.hip_in_com for foot, leg in robot.legs.items()}
    rng = np.random.default_rng(3)
    for foot, leg in robot.legs.items():
        side = foot.label.partition("_")[0]
        for _ in range(20):
            angles = {role: rng.uniform(*leg.ranges[role]) for role in ("hip_pitch", "knee", "ankle_pitch")}
            data.qpos[:] = robot.home
            for role, angle in angles.items():
                joint = model.joint(f"{side}_{role}")
                _set(data, model, joint.id, angle, leg.ranges[role])
            mujoco.mj_kinematics(model, data)
            base = data.xmat[1].reshape(3, 3)
            sole = data.site(robot.limbs[foot].site)
            rotation = sole.xmat.reshape(3, 3)
            ankle = sole.xpos + rotation @ leg.ankle_in_sole
            h = rotation.T @ (data.xpos[1] + base @ hips[foot] - ankle)  # hip seen from the ankle, in the sole frame
            shin, thigh = angles["ankle_pitch"], angles["ankle_pitch"] + angles["knee"]
            expected = -leg.shin * np.array([np.sin(shin), 0, -np.cos(shin)])
            expected += -leg.thigh * np.array([np.sin(thigh), 0, -np.cos(thigh)])
            np.testing.assert_allclose(h[[0, 2]], expected[[0, 2]], atol=1e-9)
            pitch = sum(angles.values())
            expected_sole = [[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]]
            np.testing.assert_allclose(base.T @ rotation, expected_sole, atol=1e-9)


def test_angles_and_torques_whatever_the_order_of_a_hip(robot: RobotModel) -> None:
    """On deeply bent legs too, where the order of the hip's joints tells most."""
    model, data, rng = robot.mujoco_model, mujoco.MjData(robot.mujoco_model), np.random.default_rng(5)
    jacobian = np.zeros((2, 3, model.nv))
    for foot, leg in robot.legs.items():
        joints = {role: model.joint(f"{foot.label.partition('_')[0]}_{role}") for role in leg.ranges}
        for bend in np.linspace(0.0, 1.2, 20):
            angles = dict(zip(joints, rng.uniform(-0.3, 0.3, 6), strict=True))
            angles |= {"hip_pitch": angles["hip_pitch"] - bend, "knee": 0.5 + bend}
            angles["ankle_pitch"] = 0.0  # the small robots' ankles roll above it, which is the same only so
            data.qpos[:] = robot.home
            mujoco.mj_kinematics(model, data)  # joints' directions are seen in it
            for role, angle in angles.items():
                if role.endswith(("roll", "yaw")):  # these have their plain zeros and signs in every variant
                    data.qpos[joints[role].qposadr] = angle
                else:
                    _set(data, model, joints[role].id, angle, leg.ranges[role])
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            base, sole = data.xmat[1].reshape(3, 3), data.site(robot.limbs[foot].site)
            com = data.xanchor[joints["hip_pitch"].id] - base @ leg.hip_in_com
            place = sole.xpos[None], sole.xmat.reshape(1, 3, 3)
            posture = leg_posture(leg, com[None], np.zeros(1), *place)
            for role, angle in angles.items():
                assert getattr(posture, role)[0] == pytest.approx(angle, abs=1e-6), role
            force, moment = rng.normal(size=3) * [30, 30, 300], rng.normal(size=3) * 5
            mujoco.mj_jacSite(model, data, jacobian[0], jacobian[1], sole.id)
            expected = jacobian[0].T @ force + jacobian[1].T @ moment
            for role, torque in leg_torques(leg, com[None], np.zeros(1), *place, force[None], moment[None]).items():
                if not role.startswith("ankle"):
                    assert abs(torque[0]) == pytest.approx(abs(expected[joints[role].dofadr[0]]), abs=1e-4), role


def _set(data: mujoco.MjData, model: mujoco.MjModel, joint: int, angle: float, bounds: tuple[float, float]) -> None:
    """Put a joint where its role's angle is; range ends map onto range ends, so no sign or zero is assumed."""
    low, high = model.jnt_range[joint]
    share = (angle - bounds[0]) / (bounds[1] - bounds[0])
    forward = data.xaxis[joint] @ data.xmat[1].reshape(3, 3)[:, 1] > 0 if data.xaxis[joint].any() else True
    data.qpos[model.jnt_qposadr[joint]] = low + share * (high - low) if forward else high - share * (high - low)


def test_length_limits(robot: RobotModel) -> None:
    for leg in robot.legs.values():
        thigh, shin, flexion = leg.thigh, leg.shin, leg.ranges["knee"][1]
        expected = np.hypot(thigh + shin * np.cos(flexion), shin * np.sin(flexion))
        assert leg.min_length == pytest.approx(expected)
        assert leg.max_length <= 0.985 * (thigh + shin) + 1e-12
        assert leg.ranges["knee"][0] < 0.5 < leg.ranges["knee"][1]


def test_offset_zeros_are_taken_out(tmp_path: Path) -> None:
    plain = load_robot(str(write_robot(tmp_path / "plain"))).legs[LEFT]
    for index, variant in enumerate((reversed_knees(), bent_zero())):
        leg = load_robot(str(write_robot(tmp_path / str(index), *variant))).legs[LEFT]
        for role, bounds in plain.ranges.items():
            # MuJoCo writes XML with six digits
            np.testing.assert_allclose(leg.ranges[role], bounds, atol=2e-6, err_msg=role)
        np.testing.assert_allclose(leg.hip_in_com, plain.hip_in_com, atol=2e-6)


def test_knee_that_cannot_straighten_limits_the_length(tmp_path: Path) -> None:
    model = biped_mjcf().replace('range="0.0 2.4"', 'range="0.5 2.4"')
    leg = load_robot(str(write_robot(tmp_path / "biped", model))).legs[LEFT]
    assert leg.max_length == pytest.approx(np.hypot(0.35 + 0.30 * np.cos(0.5), 0.30 * np.sin(0.5)))


@pytest.mark.parametrize("name", OWN)
def test_arm_reach(name: str) -> None:
    """No bend of the joints beyond the shoulder reaches farther, and the reach given keeps a margin."""
    robot = load_robot(name)
    model, data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_forward(model, data)
    base = data.xmat[1].reshape(3, 3)
    rng = np.random.default_rng(0)
    for limb, arm in robot.arms.items():
        shoulder = data.subtree_com[1] + base @ arm.shoulder_in_com
        side = limb.label.partition("_")[0]
        outward = base[:, 1] @ (shoulder - data.subtree_com[1])
        assert outward > 0.05 if limb.is_left else outward < -0.05
        other = mujoco.MjData(model)
        distances = []
        for _ in range(300):
            other.qpos[:] = robot.home
            for joint in range(1, model.njnt):
                if model.joint(joint).name.startswith(side):
                    other.qpos[model.jnt_qposadr[joint]] = rng.uniform(*model.jnt_range[joint])
            mujoco.mj_kinematics(model, other)
            distances.append(np.linalg.norm(other.site(robot.limbs[limb].site).xpos - shoulder))
        assert max(distances) <= arm.max_reach / 0.95 + 1e-6
        assert 0.1 < arm.min_reach < 0.6 * arm.max_reach
    assert set(robot.legs) == set(FEET)


def test_arm_with_too_few_joints(tmp_path: Path) -> None:
    stump = (
        '<body name="stump" pos="0 0.2 0.3"><joint name="shoulder" axis="0 1 0" range="-1 1" actuatorfrcrange="-9 9"/>'
    )
    stump += '<geom size="0.03" mass="0.5"/></body>'
    model = biped_mjcf().replace('<body name="left_hip_pitch_link"', stump + '<body name="left_hip_pitch_link"')
    toml = TOML.replace("[home]", '[limbs.left_palm]\nbody = "stump"\npatch = [0.05, 0.05]\n[home]')
    with pytest.raises(RobotError, match="left_palm: 1 joints between the trunk and the palm; an arm needs four"):
        load_robot(str(write_robot(tmp_path / "biped", model, toml)))


def oblique_hips() -> str:
    """Hips whose two upper joints lie between roll and yaw, with the pitch below them."""
    model = biped_mjcf()
    for side in ("left", "right"):
        names = {role: f'name="{side}_{role}"' for role in ("hip_pitch", "hip_roll", "hip_yaw")}
        model = model.replace(f'{names["hip_pitch"]} axis="0 1 0" range="-2.0 1.0"', "first")
        bounds = "-0.5 1.0" if side == "left" else "-1.0 0.5"
        model = model.replace(f'{names["hip_yaw"]} axis="0 0 1" range="{bounds}"', "third")
        model = model.replace(f'{names["hip_roll"]} axis="1 0 0" range="-0.5 0.5"', "second")
        model = model.replace("first", f'{names["hip_yaw"]} axis="1 0 1" range="-0.6 0.6"')
        model = model.replace("second", f'{names["hip_roll"]} axis="-1 0 1" range="-0.6 0.6"')
        model = model.replace("third", f'{names["hip_pitch"]} axis="0 1 0" range="-2.0 1.0"')
    return model


def test_two_oblique_joints_share_roll_and_yaw_of_the_hip(tmp_path: Path) -> None:
    robot = load_robot(str(write_robot(tmp_path / "oblique", oblique_hips())))
    model, data = robot.mujoco_model, mujoco.MjData(robot.mujoco_model)
    for foot, leg in robot.legs.items():
        side = foot.label.partition("_")[0]
        for role in ("hip_roll", "hip_yaw"):  # half as far: the joints have to serve the other axis as well
            np.testing.assert_allclose(leg.ranges[role], [-0.6 / np.sqrt(2), 0.6 / np.sqrt(2)], rtol=1e-5)
        assert leg.ranges["hip_pitch"] == pytest.approx((-2.0, 1.0), abs=0.01)
        thigh = model.body(model.jnt_bodyid[model.joint(f"{side}_hip_pitch").id]).id
        for roll, yaw in ((0.2, 0.3), (-0.3, 0.1), (0.42, -0.42)):
            data.qpos[:] = 0.0
            data.qpos[3] = 1.0
            joints = np.linalg.inv([[1, -1], [1, 1]]) @ [np.sqrt(2) * roll, np.sqrt(2) * yaw]
            for name, angle in zip(("hip_yaw", "hip_roll"), joints, strict=True):
                assert abs(angle) <= 0.6
                data.qpos[model.jnt_qposadr[model.joint(f"{side}_{name}").id]] = angle
            mujoco.mj_kinematics(model, data)
            turned = data.xmat[thigh].reshape(3, 3)  # yaw, then roll, to the second order
            np.testing.assert_allclose([-turned[0, 1], turned[2, 1]], [yaw, roll], atol=0.12)


def test_hips_without_three_directions_are_refused(tmp_path: Path) -> None:
    model = biped_mjcf().replace('hip_yaw" axis="0 0 1"', 'hip_yaw" axis="0 1 0.3"')
    with pytest.raises(RobotError, match="the leg must be hip yaw, roll and pitch in any order"):
        load_robot(str(write_robot(tmp_path / "twice", model)))


def test_a_foot_that_is_wider_than_its_sole_keeps_its_room(tmp_path: Path) -> None:
    sole = '<geom type="box" size="0.1 0.05 0.01" pos="0.02 0 -0.07" mass="1"/>'
    shoe = '<body pos="0.03 -0.01 -0.02"><geom type="box" size="0.11 0.06 0.02"/></body>'
    robots = [
        load_robot(str(write_robot(tmp_path / name, biped_mjcf().replace(sole, sole + more))))
        for name, more in (("plain", ""), ("shoe", shoe))
    ]
    outlines = [robot.foot_outline for robot in robots]
    np.testing.assert_allclose(outlines, [[0.1, 0.05], [0.12, 0.07]], atol=1e-6)
    plain, wide = (sole_room(robot) for robot in robots)
    spare = robots[0].scale.length * 0.01
    np.testing.assert_allclose(plain, [0.1 + spare, 0.05 + spare], atol=1e-6)
    np.testing.assert_allclose(wide, [0.119, 0.069], atol=1e-6)
