"""Swings keep the shin above the foot clear of the world, not the foot alone."""

import numpy as np
import pytest

from tests.wholebody.conftest import world_of
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.wholebody.limb_paths import box_collide
from toolkit.wholebody.swing_planner import plan_swing
from toolkit.wholebody.swing_task import SAMPLES, SwingingLeg, SwingTask

BAR, HEIGHT = 0.33, 0.2  # m; where the bar lies on the way, and its top


def planned(robot, world, height=0.98):
    """The path of the left foot over 0.66 m, and its leg."""
    u = np.linspace(0.0, 1.0, SAMPLES)
    start, end = (Pose.from_yaw(np.array([x, 0.1, 0.0]), 0.0) for x in (0.0, 2 * BAR))
    com = np.column_stack([np.linspace(0.2, 0.45, SAMPLES), np.zeros(SAMPLES), np.full(SAMPLES, height)])
    leg = SwingingLeg(robot.legs[Limb.LEFT_FOOT], u, com, 0.0)
    other = Pose.from_yaw(np.array([BAR, -0.1, 0.0]), 0.0), robot.half_sizes[Limb.RIGHT_FOOT]
    task = SwingTask(0.0, 1.2, start, end, robot.half_sizes[Limb.LEFT_FOOT], True, other=other, leg=leg)
    return plan_swing(task, box_collide(world_of(world))), leg


@pytest.mark.parametrize("thick", [0.03, HEIGHT])
def test_a_bar_is_stepped_over_whether_it_hangs_or_stands(robot, thick):
    path, leg = planned(robot, f'<geom type="box" size="0.02 0.05 {thick / 2}" pos="{BAR} 0.12 {HEIGHT - thick / 2}"/>')
    assert path.clear and path.passes
    points = path.positions(np.linspace(0.0, 1.0, 200))
    over = np.abs(points[:, 0] - BAR) < 0.02 + robot.half_sizes[Limb.LEFT_FOOT][0]
    assert over.any() and points[over, 2].min() > HEIGHT
    for end in leg.shin(path):
        assert end.shape == (SAMPLES, 3) and end[:, 2].min() > 0.05


def test_where_the_shin_cannot_pass_the_path_says_so(robot):
    """A board across the way at the height of the knee: the foot goes below it."""
    path, leg = planned(robot, f'<geom type="box" size="0.02 1 0.12" pos="{BAR} 0 0.5"/>')
    assert path.clear and not path.passes
    ankle, knee = leg.shin(path)
    part = np.linspace(0.0, 1.0, 50)[:, None, None]
    shin = (ankle + part * (knee - ankle)).reshape(-1, 3)
    assert ((np.abs(shin[:, 0] - BAR) < 0.04) & (np.abs(shin[:, 2] - 0.5) < 0.12)).any()
