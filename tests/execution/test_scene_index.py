"""The robot is found in the scene, and its patches are told from the rest of its body."""

import mujoco
import numpy as np
import pytest

from toolkit.errors import ExecutionError
from toolkit.execution.contact_meter import ContactMeter
from toolkit.execution.scene_index import SceneIndex
from toolkit.world.scene import compose_scene


@pytest.fixture
def scene(robot, flat):
    return compose_scene(robot, flat(0.0))


def test_every_limb_has_a_patch_on_its_own_body(robot, scene):
    index = SceneIndex(scene, robot)
    for limb, model in robot.limbs.items():
        geoms = np.flatnonzero(index.patch_limb == limb)
        assert len(geoms) > 0, limb.label
        body = scene.body(model.body).id
        assert (scene.body_weldid[scene.geom_bodyid[geoms]] == scene.body_weldid[body]).all()
    assert not index.robot_geom[scene.geom_bodyid == 0].any()
    assert index.trunk_geom[scene.geom_bodyid == scene.body(robot.base).id].all()
    assert not index.trunk_geom[index.patch_limb >= 0].any()


def test_a_scene_of_another_robot_is_refused(robot, scene):
    with pytest.raises(ExecutionError, match="compose it from a static world and this robot"):
        SceneIndex(mujoco.MjModel.from_xml_string("<mujoco/>"), robot)


def settle(scene, robot, qpos, steps=1):
    index = SceneIndex(scene, robot)
    meter, data = ContactMeter(index), mujoco.MjData(scene)
    data.qpos[:] = qpos
    for _ in range(steps):
        mujoco.mj_step(scene, data)
        meter.read(data)
    return index, meter, data


def test_wrenches_add_up_to_all_constraint_forces(robot, scene):
    lowered = robot.home.copy()
    lowered[2] -= 0.002
    index, meter, data = settle(scene, robot, lowered)
    assert (meter.normal_force[:2] > 0.0).all() and not meter.unplanned
    expected = np.zeros(scene.nv)
    for limb, site in index.sites.items():
        jacobian = np.zeros((6, scene.nv))
        mujoco.mj_jacSite(scene, data, jacobian[:3], jacobian[3:], site)
        expected += jacobian.T @ meter.wrench[limb]
    # Body positions are those of the step's beginning and Jacobians depend on nothing else; only feet touch.
    np.testing.assert_allclose(expected[:6], data.qfrc_constraint[:6], atol=1e-6 * np.abs(expected[:6]).max())
    assert meter.friction_mismatches == 0


def test_a_robot_on_its_back_is_seen_to_touch_the_world_with_its_trunk(robot, scene):
    lying = robot.home.copy()
    lying[3:7] = [np.cos(np.pi / 4), 0.0, -np.sin(np.pi / 4), 0.0]
    lying[2] = 0.6
    _, meter, _ = settle(scene, robot, lying, steps=400)
    assert meter.trunk_touched and meter.unplanned
    assert all(world == "world/floor" for _, world in meter.unplanned_names)


def test_friction_that_is_not_the_worlds_is_counted(robot, scene):
    lowered = robot.home.copy()
    lowered[2] -= 0.002
    scene.geom_priority[:] = 0
    scene.geom_friction[scene.geom_bodyid != 0, 0] = 5.0
    _, meter, _ = settle(scene, robot, lowered)
    assert meter.friction_mismatches > 0
