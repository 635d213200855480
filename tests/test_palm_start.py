"""A robot that leans on a wall when it starts: from the world's site to the simulation."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.shipped_robots import OWN
from toolkit import pipeline
from toolkit.geometry.limb import Limb
from toolkit.robot.loader import load_robot
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner import PlannerConfig
from toolkit.world.loader import load_world

PALM = Limb.LEFT_PALM


def leaning(robot):
    """Level ground and a wall at the left palm's side."""
    arm = robot.arms[PALM]
    x, y, z = arm.shoulder_in_com + [0.0, 0.0, robot.com_height] + arm.max_reach * np.array([0.3, 0.6, -0.25])
    return load_world(
        Path("leaning.xml"),
        mjcf=f"""<mujoco><custom><numeric name="transition_timing" data="0.4 0.6"/></custom><worldbody>
          <geom type="plane" size="0 0 1" friction="0.7"/>
          <geom type="box" pos="{x} {y + 0.05} {z}" size="0.6 0.05 0.5" friction="0.7"/>
          <site name="start" pos="0 0 0"/>
          <site name="start_left_palm" pos="{x} {y} {z}"/>
          <site name="goal" type="cylinder" pos="0.4 0 0" size="0.2 0.01"/>
        </worldbody></mujoco>""",
    )


@pytest.mark.parametrize("name", OWN)
def test_a_start_on_a_palm_is_planned_executed_and_replayed(name):
    robot = load_robot(name)
    if PALM not in robot.arms:
        pytest.skip("has no arm for it")
    world = leaning(robot)
    config = PlannerConfig(search=AnaStarConfig(max_expansions=60))
    planner = pipeline.make_planner(robot, world, "kinematic", config)
    result = pipeline.run(robot, world, planner, pipeline.PipelineConfig())
    assert result.passed, result.reason
    trial = result.trial
    assert trial is not None and trial.trajectory is not None and trial.execution is not None
    contact = trial.plan.sequence.start[PALM]

    data = mujoco.MjData(robot.mujoco_model)  # the first posture, by MuJoCo's own kinematics
    data.qpos[:] = trial.trajectory.qpos[0]
    mujoco.mj_kinematics(robot.mujoco_model, data)
    site = data.site(robot.limbs[PALM].site)
    np.testing.assert_allclose(site.xpos, contact.pose.position, atol=2e-3)  # what inverse kinematics is allowed
    assert site.xmat.reshape(3, 3)[:, 2] @ contact.pose.normal > np.cos(0.05)

    execution = trial.execution
    break_time = next(
        (phase.start for phase in trial.plan.schedule.phases if PALM not in [item.limb for item in phase.contacts]),
        np.inf,
    )
    held = execution.samples.tick_times < break_time - 0.1
    assert held.sum() * np.diff(execution.samples.tick_times).mean() > 0.4
    force = execution.samples.wrench[held, PALM, :3] @ contact.pose.normal
    planned = execution.samples.wrench_planned[held, PALM, :3] @ contact.pose.normal
    assert force.mean() == pytest.approx(planned.mean(), abs=10.0)  # N: it bears what the plan says
    assert np.abs(force - planned).mean() < 0.09 * planned.mean()  # at all times: the feet balance
    assert force.max() < 2.0 * planned.max() + 20.0  # without an impact
    away = execution.samples.limb_pose[held, PALM, :3] - contact.pose.position
    assert np.abs(away @ contact.pose.normal).max() < 5e-3 and np.linalg.norm(away, axis=1).max() < 0.02

    replay = mujoco.MjData(execution.scene)
    replay.qpos[:], replay.qvel[:] = execution.controls.qpos0, execution.controls.qvel0
    for ctrl in execution.controls.ctrl:
        replay.ctrl[:] = ctrl
        mujoco.mj_step(execution.scene, replay)
    np.testing.assert_array_equal(replay.qpos, execution.controls.final_qpos)
