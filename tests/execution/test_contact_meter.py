import mujoco
import numpy as np
import pytest

from toolkit.execution.contact_meter import ContactMeter
from toolkit.execution.scene_index import SceneIndex
from toolkit.geometry.limb import FEET, Limb
from toolkit.world.scene import compose_scene


@pytest.fixture
def landed(standing):
    """A meter and a state with both soles on the floor."""
    scene = compose_scene(standing.robot, standing.world)
    data = mujoco.MjData(scene)
    data.qpos[:] = standing.trajectory.qpos[0]
    data.qpos[2] -= 1e-4
    mujoco.mj_step(scene, data)
    return ContactMeter(SceneIndex(scene, standing.robot)), data


def test_soles_on_the_floor_are_planned(landed):
    meter, data = landed
    meter.read(data)
    assert (meter.normal_force[list(FEET)] > 0.0).all()
    assert not meter.unplanned


def test_a_patch_that_should_be_free_touches_unplanned(landed):
    """Its force is read all the same."""
    meter, data = landed
    meter.expected[Limb.LEFT_FOOT] = False
    meter.read(data)
    assert meter.unplanned and meter.first_touch is not None
    assert meter.first_touch.time == pytest.approx(data.time)
    assert all("floor" in world for _, world in meter.unplanned_names)
    assert meter.normal_force[Limb.LEFT_FOOT] > 0.0


def test_the_wrench_is_that_of_all_contacts(landed):
    meter, data = landed
    meter.read(data)
    scene, wrench, force = meter._index.scene, np.zeros((2, 6)), np.zeros(6)
    for number in range(data.ncon):
        contact = data.contact[number]
        limb = meter._index.patch_limb[contact.geom].max()
        mujoco.mj_contactForce(scene, data, number, force)
        sign = 1.0 if meter._index.robot_geom[contact.geom[1]] else -1.0
        linear, angular = sign * force.reshape(2, 3) @ contact.frame.reshape(3, 3)
        lever = contact.pos - data.site_xpos[meter._index.sites[limb]]
        wrench[limb] += np.hstack([linear, angular + np.cross(lever, linear)])
    assert np.count_nonzero(wrench) == wrench.size
    np.testing.assert_allclose(meter.wrench[list(FEET)], wrench, atol=1e-9)


def test_links_that_press_on_each_other_are_named(standing):
    """The legs are crossed; what touches from the start does not count."""
    robot = standing.robot
    scene = compose_scene(robot, standing.world)
    data, index = mujoco.MjData(scene), SceneIndex(scene, robot)
    data.qpos[:] = robot.home
    data.qpos[2] += 0.5
    hip = 7 + robot.joints_to(Limb.LEFT_FOOT)[:3]
    free = ContactMeter(index)
    mujoco.mj_step(scene, data)
    free.read(data)
    assert free.press is None
    for joint in hip:
        for angle in (-0.4, 0.4):
            data.qpos[:] = robot.home
            data.qpos[2] += 0.5
            data.qpos[joint] += angle
            data.qvel[:] = 0.0
            mujoco.mj_step(scene, data)
            free.read(data)
    assert free.press is not None and free.press.force > 0.05 * 9.81 * robot.mass
    assert all(scene.body(name).rootid[0] == scene.body_rootid[index.base] for name in free.press[:2])
    from_the_start = ContactMeter(index)
    for _ in range(2):
        from_the_start.read(data)
    assert from_the_start.press is None
