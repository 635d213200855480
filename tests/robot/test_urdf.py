"""The generated URDF against MuJoCo, on models chosen to be nasty; and that the check can fail."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest

from tests.robot.samples import biped_mjcf, write_robot
from toolkit.errors import RobotError
from toolkit.geometry.pose import Pose
from toolkit.robot.agreement import check_agreement, compare_dynamics
from toolkit.robot.loader import load_robot
from toolkit.robot.placo import PinocchioMap
from toolkit.robot.urdf import _roll_pitch_yaw, urdf_from_model

NASTY = """<mujoco>
  <compiler angle="degree" eulerseq="zyx"/>
  <default><default class="small"><geom size="0.03 0.05 0.02"/></default></default>
  <worldbody>
    <body name="trunk" pos="0.3 -0.2 1.1" euler="20 -35 50">
      <freejoint name="root_joint" align="false"/>
      <geom type="box" size="0.1 0.2 0.15" pos="0.02 0.05 0.1" euler="10 20 30" mass="12" contype="0" conaffinity="0"/>
      <body name="arm" pos="0.1 0.2 0.3" euler="0 90 0">
        <joint name="z_first" axis="1 2 3" pos="0.05 0.02 -0.01" ref="25" range="-90 120" armature="0.3"/>
        <joint name="a_second" axis="0 1 0" pos="-0.03 0 0.04" range="-50 50"/>
        <joint name="m_third" type="slide" axis="0 0 1" ref="0.1" range="-0.2 0.3" armature="0.2"/>
        <geom class="small" type="ellipsoid" mass="2" pos="0.1 0 0"/>
        <frame pos="0.05 0 0.1" euler="0 45 10">
          <body name="hand" pos="0 0.1 0" euler="30 0 0">
            <joint name="k_wrist" axis="1 0 -1" pos="0 0.02 0.03" range="-80 80" armature="0.05"/>
            <geom class="small" type="box" mass="0.7" euler="5 15 25"/>
            <site name="tip" pos="0.1 0.02 0.03" euler="40 -90 15"/>
            <body name="thumb" pos="0 0 0.05"><geom size="0.02" mass="0.1"/></body>
          </body>
        </frame>
      </body>
      <body name="tail" pos="-0.1 0 0" euler="0 -90 0">
        <joint name="b_tail" axis="0 0 -1" range="-30 170"/>
        <joint name="free_spin" axis="1 0 0" limited="false"/>
        <inertial pos="0.01 0.02 0.1" mass="1.5" fullinertia="0.02 0.03 0.04 0.001 -0.002 0.003"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""


def nasty() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(NASTY)


def pinocchio_of(model: mujoco.MjModel) -> pinocchio.Model:
    other = pinocchio.buildModelFromXML(urdf_from_model(model), pinocchio.JointModelFreeFlyer())
    order = PinocchioMap.of([model.joint(j).name for j in range(1, model.njnt)], other)
    other.armature = order.v_from_qvel(model.qpos0, model.dof_armature)
    return other


def test_nasty_model_agrees() -> None:
    """Several joints on a body, ref, anchors, slides, frames, rotated base, gimbal lock, unlimited joints."""
    model = nasty()
    worst = compare_dynamics(model, pinocchio_of(model), samples=20, rng=np.random.default_rng(1))
    assert set(worst) >= {"mass", "centre of mass", "mass matrix", "bias forces", "position of 'tip'"}
    assert max(worst.values()) < 1e-11


@pytest.mark.parametrize(
    ("what", "change"),
    [
        ("mass", lambda m: m.body_mass.__setitem__(2, 1.01 * m.body_mass[2])),
        ("mass matrix", lambda m: m.body_inertia.__setitem__(2, 1.01 * m.body_inertia[2])),
        ("mass matrix", lambda m: m.dof_armature.__setitem__(6, 0.0)),
        ("centre of mass", lambda m: m.body_ipos.__setitem__((2, 1), m.body_ipos[2, 1] + 1e-3)),
        ("position of 'tip'", lambda m: m.site_pos.__setitem__((0, 0), m.site_pos[0, 0] + 1e-6)),
        ("rotation of 'hand'", lambda m: m.jnt_axis.__setitem__(4, np.array([1.0, 0, 0]))),
        ("position of 'arm'", lambda m: m.qpos0.__setitem__(7, 0.0)),
        ("upper limits", lambda m: m.jnt_range.__setitem__((1, 1), 1.0)),
    ],
)
def test_every_difference_is_seen(what: str, change) -> None:
    """Each fact changed on MuJoCo's side alone must show up, far above the tolerance."""
    model = nasty()
    other = pinocchio_of(model)
    change(model)
    worst = compare_dynamics(model, other, samples=2, rng=np.random.default_rng(0))
    assert worst[what] > 1e-8


def test_robot_that_disagrees_is_refused(tmp_path: Path) -> None:
    robot = load_robot(str(write_robot(tmp_path / "biped")))
    check_agreement(robot)
    heavier = load_robot(str(write_robot(tmp_path / "biped", biped_mjcf().replace('mass="8"', 'mass="8.001"'))))
    with pytest.raises(
        RobotError, match="robot 'biped': MuJoCo and Pinocchio differ in mass by 2.37e-05 .at most 1e-09"
    ):
        check_agreement(replace(robot, urdf=heavier.urdf))


def test_angles_at_gimbal_lock() -> None:
    rng = np.random.default_rng(0)
    pitches = [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, np.pi / 2 - 1e-5, 1.0]
    for pitch in pitches:
        for roll, yaw in rng.uniform(-np.pi, np.pi, (5, 2)):
            rotation = _rotation(np.array([roll, pitch, yaw]))
            # Exactly at the pole only one of roll and yaw is free; the rotation itself must come back.
            np.testing.assert_allclose(_rotation(_roll_pitch_yaw(rotation)), rotation, atol=3e-9)
    generic = _rotation(np.array([0.4, -1.2, 2.0]))
    np.testing.assert_allclose(_rotation(_roll_pitch_yaw(generic)), generic, atol=1e-15)


def _rotation(angles: np.ndarray) -> np.ndarray:
    rotation = np.eye(3)
    for angle, axis in zip(angles[::-1], np.eye(3)[::-1], strict=True):
        quaternion = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])
        rotation = rotation @ Pose.from_quaternion(np.zeros(3), quaternion).rotation
    return rotation


def test_urdf_refuses_what_it_cannot_say() -> None:
    ball = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="a"><freejoint name="root_joint"/><geom size="0.1"/><body name="b">'
        '<joint name="c" type="ball"/><geom size="0.1"/></body></body></worldbody></mujoco>'
    )
    with pytest.raises(RobotError, match="joint 'c' on body 'b' is neither a hinge nor a slide"):
        urdf_from_model(ball)
    twice = mujoco.MjModel.from_xml_string(NASTY.replace('joint name="k_wrist"', 'joint name="hand"'))
    with pytest.raises(RobotError, match="'hand' names several joints, bodies or sites"):
        urdf_from_model(twice)
