"""Disturbances change the simulation, and only the simulation."""

import numpy as np
import pytest

from toolkit.errors import InputError
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.disturbance import Disturbance, StateFilter
from toolkit.execution.scene_index import SceneIndex
from toolkit.world.scene import compose_scene

MILD = {
    "push": Disturbance(push=20.0, push_time=0.5, push_direction=1.0),
    "mass": Disturbance(mass_error=0.05),
    "friction": Disturbance(friction_error=-0.1),
    "noise": Disturbance(state_noise=1e-4),
    "delay": Disturbance(delay=0.002),
}


@pytest.mark.parametrize("name", MILD)
def test_a_mild_disturbance_is_survived_and_felt(walking, walked, name):
    execution = walking.run(config=ExecutionConfig(disturbance=MILD[name]), rng=np.random.default_rng(1))
    differs = not np.array_equal(execution.controls.final_qpos, walked.controls.final_qpos)
    assert execution.completed, execution.failure
    # Less friction is not felt where no contact is near its limit; the scene tells.
    assert differs or execution.scene.geom_friction[-1, 0] != walked.scene.geom_friction[-1, 0]
    assert execution.replayable == (name != "push")


def test_the_same_seed_gives_the_same_run(walking):
    config = ExecutionConfig(disturbance=Disturbance(push=30.0, state_noise=1e-4))
    first, second = (walking.run(config=config, rng=np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(first.controls.ctrl, second.controls.ctrl)


def test_models_are_changed_as_declared(robot, flat):
    scene = compose_scene(robot, flat(0.0))
    before = compose_scene(robot, flat(0.0))
    index = SceneIndex(scene, robot)
    world = ~index.robot_geom
    disturbance = Disturbance(mass_error=0.1, friction_error=-0.2, terrain_offset=0.01, terrain_tilt=0.03)
    disturbance.disturb_model(scene, index.robot_geom, np.zeros(scene.ngeom, bool), np.random.default_rng(0))
    np.testing.assert_allclose(scene.body_subtreemass[0], 1.1 * before.body_subtreemass[0], rtol=1e-12)
    np.testing.assert_allclose(scene.geom_friction[world, 0], 0.8 * before.geom_friction[world, 0], rtol=1e-12)
    np.testing.assert_array_equal(scene.geom_friction[~world], before.geom_friction[~world])
    moved = np.linalg.norm(scene.geom_pos[world] - before.geom_pos[world], axis=1)
    assert (moved > 0.0).all() and (moved <= 0.01).all()
    turn = 2.0 * np.arccos(np.clip(np.abs((scene.geom_quat[world] * before.geom_quat[world]).sum(1)), 0.0, 1.0))
    assert (turn > 0.0).all() and (turn <= 0.03).all()
    np.testing.assert_array_equal(scene.geom_pos[~world], before.geom_pos[~world])


def test_geoms_under_the_start_stay(robot, flat):
    scene, before = compose_scene(robot, flat(0.0)), compose_scene(robot, flat(0.0))
    kept = np.ones(scene.ngeom, bool)
    index = SceneIndex(scene, robot)
    Disturbance(terrain_offset=0.01).disturb_model(scene, index.robot_geom, kept, np.random.default_rng(0))
    np.testing.assert_array_equal(scene.geom_pos, before.geom_pos)


def test_the_controller_is_told_an_old_state():
    told = StateFilter(Disturbance(delay=0.004), 0.002, np.random.default_rng(0))
    states = [told(np.full(8, k), np.full(7, k))[0][0] for k in range(5)]
    assert states == [0.0, 0.0, 0.0, 1.0, 2.0]


def test_noise_has_the_declared_size_and_keeps_quaternions_unit():
    told = StateFilter(Disturbance(state_noise=1e-3), 0.002, np.random.default_rng(0))
    qpos, qvel = np.r_[np.zeros(3), 1.0, np.zeros(33)], np.zeros(36)
    samples = [told(qpos, qvel) for _ in range(500)]
    joints, speeds = np.array([q[7:] for q, _ in samples]), np.array([v for _, v in samples])
    np.testing.assert_allclose(joints.std(), 1e-3, rtol=0.05)
    np.testing.assert_allclose(speeds.std(), 1e-2, rtol=0.05)
    np.testing.assert_allclose([np.linalg.norm(q[3:7]) for q, _ in samples], 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    "bad",
    [
        {"delay": -1.0},
        {"state_noise": float("nan")},
        {"mass_error": -1.0},
        {"friction_error": float("inf")},
        {"push": float("nan")},
        {"terrain_tilt": -0.1},
    ],
)
def test_nonsense_is_refused_by_name(bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        Disturbance(**bad)
