"""Whole runs: standing, walking, replay; and runs that are broken on purpose must fail."""

import copy
import dataclasses

import mujoco
import numpy as np
import pytest

from toolkit.errors import ExecutionError
from toolkit.execution.check import Result
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.disturbance import Disturbance
from toolkit.execution.replay import replay_controls
from toolkit.execution.run import execute
from toolkit.geometry.limb import Limb
from toolkit.wholebody.plan import Manner, whole_body


def failed(execution):
    return {check.name for check in execution.checks if check.result is not Result.PASS}


def test_a_standing_robot_stands_still(standing):
    execution = standing.run()
    assert failed(execution) == set()
    assert execution.com_rms_error < 2e-3
    assert execution.slip == (execution.max_slip,) and execution.max_slip < 1e-3
    weight = standing.robot.mass * 9.81
    np.testing.assert_allclose(execution.samples.wrench[-1, :, 2].sum(), weight, rtol=1e-3)


def test_a_short_walk_arrives(walking, walked):
    assert failed(walked) == set(), walked.checks
    assert walked.failure is None and walked.fall is None
    assert walked.completed and walked.goal_reached and not walked.fell
    assert walked.solver_failures == 0
    assert walked.com_rms_error < 0.01
    assert len(walked.touchdowns) == 2 and walked.max_touchdown_error < 0.01
    assert len(walked.slip) == 3
    for entry, transition in zip(walked.touchdowns, walking.sequence.transitions, strict=True):
        assert entry["limb"] == transition.limb.label
        assert abs(entry["time"] - entry["planned_time"]) < 0.1


def test_measured_forces_carry_the_measured_motion(walking, walked):
    """Newton: contact forces and gravity change the momentum by just what was measured."""
    force = walked.samples.wrench[:, :, :3].sum(1) + walking.robot.mass * np.array([0.0, 0.0, -9.81])
    period = walked.samples.tick_times[1] - walked.samples.tick_times[0]
    gained = np.cumsum(force[:-1], axis=0) * period
    change = walked.samples.momentum[1:, :3] - walked.samples.momentum[0, :3]
    # Implicit damping moves some impulse between neighbouring steps; 1 N s of 700 N is 1.5 ms of weight.
    np.testing.assert_allclose(change, gained, atol=1.0)


def test_replay_of_the_controls_ends_in_the_same_state_exactly(walked):
    again = replay_controls(walked.scene, walked.controls)
    assert np.abs(again - walked.controls.final_qpos).max() == 0.0


def test_only_limited_joint_torques_act(walking, walked):
    limit = walking.robot.torque_limit
    assert (np.abs(walked.controls.ctrl) <= limit).all()
    assert (np.abs(walked.samples.torque) <= limit).all() and walked.max_torque_ratio <= 1.0
    np.testing.assert_array_equal(walked.samples.torque[0], walked.controls.ctrl[0])


def test_sampled_poses_are_those_of_the_sampled_states(walking, walked):
    data = mujoco.MjData(walked.scene)
    for k in (0, len(walked.samples.qpos) // 2, len(walked.samples.qpos) - 1):
        data.qpos[:], data.qvel[:] = walked.samples.qpos[k], walked.samples.qvel[k]
        mujoco.mj_forward(walked.scene, data)
        for limb, model in walking.robot.limbs.items():
            np.testing.assert_allclose(walked.samples.limb_pose[k, limb, :3], data.site(model.site).xpos, atol=1e-12)
        np.testing.assert_allclose(walked.samples.com[k], data.subtree_com[0], atol=1e-12)


def test_a_robot_without_its_motors_falls(walking):
    """A robot whose motors give a hundredth of what the plan needs sinks, and the run says so."""
    weak = dataclasses.replace(walking.robot, torque_limit=0.01 * walking.robot.torque_limit)
    execution = execute(dataclasses.replace(walking.whole, robot=weak))
    assert execution.fall is not None and not execution.completed
    assert {"upright", "completed"} <= failed(execution)
    failure = execution.failure
    assert failure is not None and failure.reason == f"the robot fell: {execution.fall.reason}"
    assert failure.time == execution.fall.time == execution.samples.tick_times[-1]
    assert failure.transition == walking.schedule.phase_at(failure.time).transition


@pytest.mark.parametrize("start", ["qpos", "qvel"])
def test_a_simulation_that_diverges_is_a_fall_and_leaves_no_log(standing, start, tmp_path, monkeypatch, capfd):
    """MuJoCo puts such a state back to where it began, warns, and would write MUJOCO_LOG.TXT."""
    monkeypatch.chdir(tmp_path)
    trajectory = standing.whole.trajectory
    wild = getattr(trajectory, start).copy()
    wild[0, -1] = 1e11
    execution = execute(
        dataclasses.replace(standing.whole, trajectory=dataclasses.replace(trajectory, **{start: wild}))
    )
    assert execution.fall is not None and execution.fall.reason.startswith("the simulation diverged: ")
    assert {"upright", "completed"} <= failed(execution)
    replay_controls(execution.scene, execution.controls)
    assert not list(tmp_path.iterdir()) and capfd.readouterr() == ("", "")


def test_a_push_that_is_too_strong_is_a_fall_and_is_not_replayable(walking):
    config = ExecutionConfig(disturbance=Disturbance(push=3000.0, push_time=0.3, push_duration=0.3))
    execution = walking.run(config=config)
    assert not execution.replayable and execution.fell
    again = replay_controls(execution.scene, execution.controls)
    assert np.abs(again - execution.controls.final_qpos).max() > 0.0


def test_a_foot_planned_below_the_floor_touches_early_and_is_missed_by_its_plan(walking):
    """Touchdown error is measured against the plan, not against where the foot happens to be."""
    moved = walking.sequence.transitions[0]
    pose = dataclasses.replace(moved.contact.pose, position=moved.contact.pose.position - [0.0, 0.0, 0.03])
    contact = dataclasses.replace(moved.contact, pose=pose)
    transitions = (dataclasses.replace(moved, contact=contact), *walking.sequence.transitions[1:])
    sequence = dataclasses.replace(walking.sequence, transitions=transitions)
    execution = walking.run_with(sequence)
    assert execution.touchdowns[0]["position_error"] == pytest.approx(0.03, abs=0.01)


def test_wrong_friction_in_the_scene_is_noticed(walking):
    scene = copy.copy(walking.whole.scene)
    scene.geom_priority[:] = 0  # the larger of both frictions wins: the robot's own 1.0
    scene.geom_friction[:, 0] = np.where(scene.geom_bodyid == 0, scene.geom_friction[:, 0], 1.0)
    assert "friction" in failed(execute(dataclasses.replace(walking.whole, scene=scene)))


def test_the_plan_s_scene_stays_as_it_is(walking):
    """A run that disturbs masses, friction and terrain does so in a scene of its own."""
    before = copy.copy(walking.whole.scene)
    disturbance = Disturbance(mass_error=0.05, friction_error=-0.1, terrain_offset=0.01, terrain_tilt=0.02)
    execution = walking.run(config=ExecutionConfig(timestep=0.001, control_decimation=2, disturbance=disturbance))
    scene = walking.whole.scene
    assert execution.scene is not scene and execution.scene.opt.timestep == 0.001
    for name in ("body_mass", "geom_friction", "geom_pos", "geom_quat", "geom_margin"):
        np.testing.assert_array_equal(getattr(scene, name), getattr(before, name))
    assert scene.opt.timestep == before.opt.timestep


def test_the_controller_tracks_the_paths_of_the_plan(walking, flat):
    """Feet that are planned to swing higher do so in the run: the paths are not planned anew."""
    plan = whole_body(walking.whole, walking.whole.scene, Manner(foot_lift=0.09))
    lift = [execute(each).samples.limb_pose[:, Limb.LEFT_FOOT, 2].max() for each in (walking.whole, plan)]
    assert lift[1] > lift[0] + 0.02


def test_the_goal_counts_for_the_feet(walking, flat):
    execution = execute(dataclasses.replace(walking.whole, world=flat(5.0)))
    assert failed(execution) == {"goal_distance"} and not execution.goal_reached


def test_plans_of_another_length_or_robot_are_refused(walking, standing):
    with pytest.raises(ExecutionError, match="plan both together"):
        execute(dataclasses.replace(walking.whole, motion=standing.motion))
    cut = dataclasses.replace(walking.trajectory, qpos=walking.trajectory.qpos[:, :-1])
    with pytest.raises(ExecutionError, match="plan it with the robot that executes it"):
        execute(dataclasses.replace(walking.whole, trajectory=cut))


def test_progress_is_told(standing):
    told = []
    standing.run(observer=lambda share, detail: told.append((share, detail)))
    shares = [share for share, _ in told]
    assert shares == sorted(shares) and 0.0 <= shares[0] and shares[-1] < 1.0


def test_palms_are_free_without_contacts(walked, walking):
    for palm in (limb for limb in walking.robot.limbs if not limb.is_foot):
        assert (walked.samples.wrench[:, palm] == 0.0).all()
        assert np.isnan(walked.samples.cop_margin[:, palm]).all()
