"""A small robot of primitives, and worlds written on the spot."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.model import LegGeometry, LimbModel, RobotModel
from toolkit.world.loader import load_world

# Names, options, friction and contact bits are chosen to clash with a world's.
ROBOT = """
<mujoco model="stool">
  <compiler angle="radian"/>
  <option timestep="0.005" gravity="0 0 -3" cone="pyramidal" impratio="1" integrator="RK4"/>
  <default>
    <geom friction="1.2" contype="2" conaffinity="4" priority="3"/>
    <default class="tile"><geom rgba="0 1 0 1"/></default>
  </default>
  <asset>
    <material name="checker" rgba="1 0 1 1"/>
    <texture name="sky" type="2d" builtin="flat" width="4" height="4"/>
  </asset>
  <worldbody>
    <body name="floor" pos="0 0 0.5">
      <freejoint name="root_joint"/>
      <geom name="floor" type="box" size="0.1 0.1 0.1" mass="5"/>
      <geom name="decoration" type="sphere" size="0.3" contype="0" conaffinity="0" mass="0"/>
      <body name="left_leg" pos="0 0.1 -0.1">
        <joint name="left_knee" axis="0 1 0" range="-1 1"/>
        <geom name="left_sole" class="tile" type="box" pos="0 0 -0.35" size="0.11 0.06 0.05" mass="1"/>
        <site name="left_foot" pos="0 0 -0.4"/>
      </body>
      <body name="right_leg" pos="0 -0.1 -0.1">
        <joint name="right_knee" axis="0 1 0" range="-1 1"/>
        <geom name="right_sole" class="tile" type="box" pos="0 0 -0.35" size="0.11 0.06 0.05" mass="1" contype="1"
          conaffinity="0" friction="0.1"/>
        <site name="right_foot" pos="0 0 -0.4"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="left_knee" joint="left_knee"/>
    <motor name="right_knee" joint="right_knee"/>
  </actuator>
  <keyframe><key name="home" qpos="0 0 0.5 1 0 0 0 0.1 0.1"/></keyframe>
</mujoco>
"""

LEG = LegGeometry(np.zeros(3), np.zeros(3), 0.4, 0.4, 0.0, 0.8, {}, {})


@pytest.fixture
def stool():
    """A robot with two legs and a knee each."""
    model = mujoco.MjModel.from_xml_string(ROBOT)
    return RobotModel(
        name="stool",
        folder=Path("stool"),
        mjcf=ROBOT,
        assets={},
        mujoco_model=model,
        urdf="",
        base="floor",
        joint_names=("left_knee", "right_knee"),
        lower=np.full(2, -1.0),
        upper=np.ones(2),
        velocity_limit=np.ones(2),
        torque_limit=np.ones(2),
        armature=np.zeros(2),
        kp=np.ones(2),
        kd=np.ones(2),
        home=np.array([0, 0, 0.5, 1, 0, 0, 0, 0, 0.0]),
        mass=7.0,
        com_height=0.4,
        limbs={
            limb: LimbModel(limb, limb.label, limb.label.replace("foot", "leg"), np.array([0.11, 0.06]))
            for limb in (Limb.LEFT_FOOT, Limb.RIGHT_FOOT)
        },
        legs=dict.fromkeys(FEET, LEG),
        arms={},
        fingerprint="",
    )


def mjcf_of(geoms: str = "", assets: str = "", start: str = "0 0 0", goal: str = "1 0 0", more: str = "") -> str:
    """A world's text around some geoms."""
    return f"""
    <mujoco>
      <asset>{assets}</asset>
      <worldbody>
        {geoms}
        <site name="start" pos="{start}"/>
        <site name="goal" type="cylinder" pos="{goal}" size="0.2 0.01"/>
      </worldbody>
      {more}
    </mujoco>
    """


@pytest.fixture
def make_world(tmp_path):
    """A function from geoms to a loaded world."""

    def make(*args, **kwargs):
        config = kwargs.pop("config", None)
        text = mjcf_of(*args, **kwargs)
        extra = {} if config is None else {"config": config}
        return load_world(tmp_path / "made.xml", mjcf=text, **extra)

    return make
