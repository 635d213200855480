"""Every robot in robots/ against what it declares, and against what every stage relies on."""

from __future__ import annotations

import subprocess
import sys
from fnmatch import fnmatchcase

import mujoco
import numpy as np
import placo
import pytest

from tests.shipped_robots import EVERY, loaded
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.description import FILE_NAME, RobotDescription, read_description
from toolkit.robot.model import RobotModel
from toolkit.robot.picture import standing_scene
from toolkit.robot.placo import pinocchio_map, placo_wrapper


@pytest.fixture(scope="module", params=EVERY)
def robot(request: pytest.FixtureRequest) -> RobotModel:
    return loaded(request.param)


@pytest.fixture(scope="module")
def declared(robot: RobotModel) -> dict:
    return description(robot).declared


def description(robot: RobotModel) -> RobotDescription:
    return read_description(robot.folder / FILE_NAME)


def home_data(robot: RobotModel) -> mujoco.MjData:
    data = mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_forward(robot.mujoco_model, data)
    return data


def within(value: float, bounds: list[float]) -> bool:
    return bounds[0] - 1e-9 <= value <= bounds[1] + 1e-9  # sums of masses carry rounding


def test_some_robot_is_there() -> None:
    assert EVERY


def test_declared_numbers(robot: RobotModel, declared: dict) -> None:
    known = {"joints", "mass", "leg_mass", "thigh", "shin", "armature", "symmetric", "joint_limits"}
    assert set(declared) <= known | {"wrist_lever", "stance_width"}
    model = robot.mujoco_model
    if "joints" in declared:
        assert len(robot.joint_names) == declared["joints"]
    if "mass" in declared:
        assert within(robot.mass, declared["mass"])
    for leg in robot.legs.values():
        for name in {"thigh", "shin"} & set(declared):
            assert within(getattr(leg, name), declared[name])
    if "armature" in declared:
        assert all(within(value, declared["armature"]) for value in robot.armature)
    if "leg_mass" in declared:
        for foot in robot.legs:
            body = model.body(robot.limbs[foot].body).id
            while model.body_parentid[body] != 1:
                body = model.body_parentid[body]
            assert within(model.body_subtreemass[body], declared["leg_mass"])


def test_declared_joint_limits(robot: RobotModel, declared: dict) -> None:
    for pattern, (torque, slowest, fastest, lower, upper) in declared.get("joint_limits", {}).items():
        matched = [i for i, name in enumerate(robot.joint_names) if fnmatchcase(name, pattern)]
        assert matched, pattern
        for i in matched:
            assert robot.torque_limit[i] == torque
            assert slowest <= robot.velocity_limit[i] <= fastest
            assert (robot.lower[i], robot.upper[i]) == (lower, upper)


def test_interface_of_the_model(robot: RobotModel) -> None:
    model, n = robot.mujoco_model, len(robot.joint_names)
    assert (model.nq, model.nv, model.nu) == (7 + n, 6 + n, n)
    assert model.joint(0).name == "root_joint"
    assert model.neq == model.ntendon == model.nkey == 0
    np.testing.assert_array_equal(model.actuator_trnid[:, 0], np.arange(1, n + 1))
    np.testing.assert_array_equal(model.actuator_gear[:, 0], 1.0)
    np.testing.assert_array_equal(model.actuator_ctrlrange, np.c_[-robot.torque_limit, robot.torque_limit])
    np.testing.assert_array_equal(model.actuator_forcerange, model.actuator_ctrlrange)
    assert not model.actuator_biastype.any() and not model.actuator_dyntype.any()
    assert not model.body_gravcomp.any()
    assert not model.geom_priority.any(), "the world's friction must count"
    assert {Limb.LEFT_FOOT, Limb.RIGHT_FOOT} <= set(robot.limbs)
    for limb, item in robot.limbs.items():
        assert item.site == limb.label
        assert model.body(model.site(item.site).bodyid[0]).name == item.body
    again = mujoco.MjModel.from_xml_string(robot.mjcf, robot.assets)
    np.testing.assert_array_equal(again.body_mass, model.body_mass)


def test_home_stands_on_its_soles(robot: RobotModel) -> None:
    data, model = home_data(robot), robot.mujoco_model
    feet = [data.site(robot.limbs[foot].site) for foot in robot.legs]
    np.testing.assert_allclose([foot.xpos[2] for foot in feet], 0, atol=3e-3)
    level = [
        foot.xmat[6] if robot.limbs[limb].rolls else 1 - foot.xmat[8] for limb, foot in zip(FEET, feet, strict=True)
    ]
    np.testing.assert_allclose(level, 0, atol=1e-3)
    np.testing.assert_allclose(np.mean([foot.xpos for foot in feet], 0), 0, atol=1e-9)
    assert feet[0].xpos[1] > feet[1].xpos[1]
    assert data.subtree_com[1, 2] == pytest.approx(robot.com_height, abs=1e-12)
    assert data.ncon == 0, "self-contact in the home posture"
    assert (robot.home[7:] >= robot.lower).all() and (robot.home[7:] <= robot.upper).all()
    half = robot.half_sizes[0, 0]
    assert abs(data.subtree_com[1, 0]) < half / 2
    assert model.body_subtreemass[1] == pytest.approx(robot.mass)


def test_nothing_is_lower_than_the_soles(robot: RobotModel) -> None:
    model = standing_scene(robot)
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home
    mujoco.mj_forward(model, data)
    touching = {int(model.body_weldid[model.geom_bodyid[max(pair)]]) for pair in data.contact.geom}
    assert touching <= {int(model.body_weldid[model.body(robot.limbs[foot].body).id]) for foot in robot.legs}
    assert (data.contact.dist > -3e-3).all()


def test_patches_lie_on_shapes(robot: RobotModel) -> None:
    """The corners of every patch, or the ends of its line, touch a collision shape of its body."""
    model = mujoco.MjModel.from_xml_string(robot.mjcf, robot.assets)
    model.geom_group[:] = np.where(model.geom_contype | model.geom_conaffinity, 0, 5)  # what is only drawn is left out
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home
    mujoco.mj_forward(model, data)
    groups = np.array([1, 0, 0, 0, 0, 0], np.uint8)
    for limb, item in robot.limbs.items():
        site, body = data.site(item.site), model.body(item.body).id
        rotation = site.xmat.reshape(3, 3)
        for x, y in ((1, 0), (-1, 0)) if item.rolls else ((0.9, 0.9), (0.9, -0.9), (-0.9, 0.9), (-0.9, -0.9)):
            corner = site.xpos + rotation @ np.array([x, y, 0] * np.append(item.half_size, 0))
            outside = corner - 0.05 * rotation[:, 2]  # a ray from the touched surface into the limb
            hit = np.zeros(1, np.int32)
            distance = mujoco.mj_ray(model, data, outside, rotation[:, 2], groups, 1, -1, hit)
            assert hit[0] >= 0 and model.body_weldid[model.geom_bodyid[hit[0]]] == model.body_weldid[body], limb.label
            assert distance == pytest.approx(0.05, abs=3e-3), limb.label


def test_left_mirrors_right(robot: RobotModel, declared: dict) -> None:
    if not declared.get("symmetric"):
        pytest.skip("does not declare symmetry")
    data, model = home_data(robot), robot.mujoco_model
    assert abs(data.subtree_com[1, 1]) < 1e-9
    mirror = np.array([1, -1, 1])
    sides = [b for b in range(1, model.nbody) if "left" in model.body(b).name]
    assert sides
    for body in sides:
        other = model.body(model.body(body).name.replace("left", "right")).id
        assert model.body_mass[body] == model.body_mass[other]
        np.testing.assert_allclose(data.xpos[body] * mirror, data.xpos[other], atol=1e-9)
        np.testing.assert_allclose(data.xipos[body] * mirror, data.xipos[other], atol=1e-9)
        np.testing.assert_allclose(np.sort(model.body_inertia[body]), np.sort(model.body_inertia[other]), atol=1e-9)
    for limb in robot.limbs:
        left, right = robot.limbs[limb], robot.limbs[limb.mirrored]
        np.testing.assert_array_equal(left.half_size, right.half_size)
    left, right = robot.legs[Limb.LEFT_FOOT], robot.legs[Limb.RIGHT_FOOT]
    np.testing.assert_allclose(left.hip_in_com * mirror, right.hip_in_com, atol=1e-9)
    for role, (low, high) in left.ranges.items():
        expected = (-high, -low) if role.endswith(("yaw", "roll")) else (low, high)
        np.testing.assert_allclose(right.ranges[role], expected, atol=1e-9)


def test_leg_geometry_predicts_the_ankle(robot: RobotModel) -> None:
    """Two links from the hip centre and the knee's angle give the distance of the joint centres in MuJoCo."""
    data, model = home_data(robot), robot.mujoco_model
    for foot, leg in robot.legs.items():
        base = data.xmat[1].reshape(3, 3)
        hip = data.subtree_com[1] + base @ leg.hip_in_com
        site = data.site(robot.limbs[foot].site)
        ankle = site.xpos + site.xmat.reshape(3, 3) @ leg.ankle_in_sole
        distance = np.linalg.norm(hip - ankle)
        assert leg.min_length < distance < leg.max_length
        assert leg.max_length < leg.thigh + leg.shin
        assert 0.5 < leg.thigh / leg.shin < 2
        assert leg.ranges["knee"][1] > 1.0
        assert min(leg.torques.values()) > 0
    assert model.nbody > 1


def test_palm_force_passes_by_the_wrist(robot: RobotModel, declared: dict) -> None:
    """A force along the palm's normal takes next to no torque of the last three joints, however they stand."""
    if "wrist_lever" not in declared:
        pytest.skip("does not declare a wrist lever")
    model, data, rng = robot.mujoco_model, home_data(robot), np.random.default_rng(0)
    jacobian = np.zeros((3, model.nv))
    for limb in robot.arms:
        site, last = model.site(robot.limbs[limb].site).id, model.body(robot.limbs[limb].body).id
        wrist = [model.jnt_dofadr[model.body_jntadr[body]] for body in (last, last - 1, last - 2)]
        for _ in range(10):
            data.qpos[7:] = rng.uniform(robot.lower, robot.upper)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_jacSite(model, data, jacobian, None, site)
            levers = np.abs(data.site_xmat[site].reshape(3, 3)[:, 2] @ jacobian[:, wrist])
            assert all(within(lever, declared["wrist_lever"]) for lever in levers)


def test_no_self_contact_while_walking(robot: RobotModel, declared: dict) -> None:
    """Legs do not touch in strides of 0.4 m at the declared widths, found by placo and judged by MuJoCo."""
    if "stance_width" not in declared:
        pytest.skip("does not declare a stance width")
    wrapper = placo_wrapper(robot)
    order, data = pinocchio_map(robot, wrapper.model), mujoco.MjData(robot.mujoco_model)
    for width in declared["stance_width"]:
        for stride, rise in ((-0.4, 0.0), (0.0, 0.1), (0.4, 0.1), (0.4, -0.1)):
            wrapper.state.q = order.q_from_qpos(robot.home)
            wrapper.update_kinematics()
            solver = placo.KinematicsSolver(wrapper)
            solver.enable_joint_limits(True)
            targets = {}
            for foot, sign in ((Limb.LEFT_FOOT, 1), (Limb.RIGHT_FOOT, -1)):
                targets[foot] = np.eye(4)
                targets[foot][:3, 3] = sign * np.array([stride, width, rise]) / 2
                solver.add_frame_task(foot.label, targets[foot]).configure(foot.label, "soft", 1e3, 1e3)
            height = 0.95 * robot.com_height
            solver.add_com_task(np.array([0, 0, height])).configure("com", "soft", 100)
            posture = solver.add_joints_task()
            posture.set_joints(dict(zip(robot.joint_names, robot.home[7:], strict=True)))
            posture.configure("posture", "soft", 1e-2)
            for _ in range(40):
                solver.solve(True)
                wrapper.update_kinematics()
            for foot, target in targets.items():
                np.testing.assert_allclose(wrapper.get_T_world_frame(foot.label), target, atol=1e-3)
            data.qpos[:] = order.qpos_from_q(wrapper.state.q)
            mujoco.mj_fwdPosition(robot.mujoco_model, data)
            assert data.ncon == 0


@pytest.mark.parametrize("seconds", [1.0, pytest.param(5.0, marks=pytest.mark.slow)])
def test_stands_under_joint_control(robot: RobotModel, seconds: float) -> None:
    """Joint PD with half the weight on each sole as feed-forward keeps every robot up."""
    model = standing_scene(robot, friction=0.5)
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home
    mujoco.mj_forward(model, data)
    feed, jacobian = data.qfrc_bias.copy(), np.zeros((3, model.nv))
    for foot in robot.legs:
        mujoco.mj_jacSite(model, data, jacobian, None, model.site(robot.limbs[foot].site).id)
        feed -= jacobian.T @ np.array([0, 0, robot.mass * 9.81 / 2])
    while data.time < seconds:
        error = robot.home[7:] - data.qpos[7:]
        data.ctrl[:] = feed[6:] + robot.kp * error - robot.kd * data.qvel[6:]
        mujoco.mj_step(model, data)
    tilt = np.arccos(np.clip(data.xmat[1, 8], -1, 1)) - np.arccos(np.clip(home_data(robot).xmat[1, 8], -1, 1))
    assert abs(tilt) < 0.03
    assert abs(data.qpos[2] - robot.home[2]) < 0.01
    assert np.abs(data.actuator_force / robot.torque_limit).max() < 0.8


def test_model_is_cheap_to_import() -> None:
    """The shared data object must not drag in Pinocchio, placo or the loader."""
    code = "import sys, toolkit.robot.model; print(*(m for m in ('placo', 'pinocchio', 'casadi') if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
