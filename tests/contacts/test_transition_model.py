import numpy as np
import pytest

from tests.robot.samples import TOML, biped_mjcf, write_robot
from tests.shipped_robots import OWN
from toolkit.contacts.transition_model import TransitionModel, palm_rays, running_steps, steps_38, steps_60
from toolkit.geometry.limb import Limb
from toolkit.robot.legroom import legs_touch
from toolkit.robot.loader import load_robot


def rows(array):
    return {tuple(row) for row in np.round(array, 9)}


def test_counts_of_the_paper_and_38_within_60():
    assert len(rows(steps_38())) == 38 and len(rows(steps_60())) == 60
    assert rows(steps_38()) < rows(steps_60())


def test_steps_obey_the_rules():
    steps = steps_60()
    x, y, yaw = steps.T
    assert x.min() == -0.2 and x.max() == 0.4
    assert set(np.round(y, 3)) == {0.2, 0.3, 0.4} and (y[x < 0] == 0.2).all()
    assert set(np.round(np.degrees(yaw)).astype(int)) == {-30, -15, 0, 15, 30}
    assert (yaw[(x == 0) | (x == 0.4)] == 0).all()
    assert (
        running_steps()[:, 0].min() == 0.45
        and running_steps()[:, 0].max() == 0.75
        and (running_steps()[:, 2] == 0).all()
    )


def test_rays_are_unit_and_point_to_the_left():
    rays = palm_rays()
    assert rays.shape == (18, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0)
    assert (rays[:, 0] > 0).all() and (rays[:, 1] > 0).all()
    assert set(np.round(np.degrees(np.arcsin(rays[:, 2]))).astype(int)) == {-20, 0, 20}


@pytest.mark.parametrize("name", OWN)
def test_right_limbs_mirror_left_ones_and_soles_stay_apart(name):
    robot = load_robot(name)
    model = TransitionModel.of(robot, steps_60())
    np.testing.assert_array_equal(model.steps_of(Limb.RIGHT_FOOT), model.steps_of(Limb.LEFT_FOOT) * [1, -1, -1])
    np.testing.assert_array_equal(model.rays_of(Limb.RIGHT_PALM), model.rays_of(Limb.LEFT_PALM) * [1, -1, 1])
    assert model.steps[:, 1].min() >= 2 * robot.half_sizes[Limb.LEFT_FOOT, 1] + 0.04 * robot.scale.length - 1e-12
    assert len(model.rays) == (18 if robot.arms else 0)


def test_a_robot_that_stands_wide_steps_wide(tmp_path):
    hips = "[home]\nflat_soles = true\nleft_hip_roll = 0.35\nright_hip_roll = -0.35"
    folder = write_robot(tmp_path / "wide", toml=TOML.replace("[home]", hips))
    robot, plain = load_robot(str(folder)), load_robot(str(write_robot(tmp_path / "plain")))
    assert plain.stance_width == pytest.approx(0.2) and robot.stance_width > 0.55
    assert TransitionModel.of(robot, steps_60()).steps[:, 1].min() == pytest.approx(0.6 * robot.stance_width)
    assert TransitionModel.of(plain, steps_60()).steps[:, 1].min() == pytest.approx(0.2 * plain.scale.length)


@pytest.mark.parametrize("name", OWN)
def test_legs_with_room_make_every_step(name):
    assert len(TransitionModel.of(load_robot(name), steps_60()).steps) == 60


def thick_legged(folder, size, ahead):
    """A robot with boxes of half extents `size` in m, `ahead` m before the hips, as thighs."""
    thighs = biped_mjcf().replace(
        'type="capsule" size="0.05" fromto="0 0 -0.08 0 0 -0.28" mass="3"',
        f'type="box" size="{size}" pos="{ahead} 0 -0.2" mass="3"',
    )
    return load_robot(str(write_robot(folder, thighs)))


def test_legs_that_are_thicker_than_the_soles_pass_each_other_farther_apart(tmp_path):
    slim, thick = (thick_legged(tmp_path / str(wide), f"0.05 {wide} 0.1", 0.0) for wide in (0.03, 0.08))
    sole = 2.0 * thick.half_sizes[Limb.LEFT_FOOT, 1]
    assert slim.passing_gap < thick.passing_gap <= thick.stance_width - sole


def test_steps_that_turn_thick_thighs_into_each_other_are_left_out(tmp_path):
    robot = thick_legged(tmp_path / "thick", "0.09 0.05 0.1", 0.08)  # which reach far ahead of the hips
    steps = TransitionModel.of(robot, steps_60()).steps
    narrow = steps[steps[:, 1] < steps[:, 1].min() + 0.01]
    assert legs_touch(robot, 0.17, np.radians(30)) and not legs_touch(robot, 0.3, np.radians(15))
    assert not (np.degrees(narrow[:, 2]) < -20).any() and (np.degrees(narrow[:, 2]) > 20).any()
    assert (np.degrees(steps[:, 2]) < -20).any()  # wider apart there is room
