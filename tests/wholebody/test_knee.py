import numpy as np
import pytest

from tests.robot.samples import TOML, biped_mjcf, write_robot
from tests.wholebody.conftest import FIRST, RISE, world_of
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.physics.leg import leg_posture
from toolkit.robot.loader import load_robot
from toolkit.wholebody.ik import knee_range
from toolkit.wholebody.limb_paths import box_collide
from toolkit.wholebody.swing_planner import plan_swing
from toolkit.wholebody.swing_task import SAMPLES, SPARE, SwingingLeg, SwingTask

KNEE = 'axis="0 1 0" range="0.0 2.4"'


@pytest.mark.parametrize("sign, offset", [(1, 0.0), (1, -0.2), (-1, 0.0), (-1, 0.3)])
def test_least_flexion_whichever_way_the_knee_turns(tmp_path, sign, offset):
    low, high = sorted(sign * limit + offset for limit in (0.0, 2.4))
    model = biped_mjcf().replace(KNEE, f'axis="0 {sign} 0" range="{low} {high}" ref="{offset}"')
    toml = TOML.replace('"*_knee" = 0.7', f'"*_knee" = {sign * 0.7 + offset}')
    robot = load_robot(write_robot(tmp_path / "biped", model, toml))
    for foot in FEET:
        joint, lower, upper = knee_range(robot, foot, 0.1)
        assert robot.joint_names[joint] == f"{foot.label.removesuffix('_foot')}_knee"
        expected = sorted(sign * flexion + offset for flexion in (0.1, 2.4))
        np.testing.assert_allclose([lower, upper], expected, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("trail", [0.0, 0.3])
def test_a_swing_does_not_fold_the_leg_more_than_the_knee_can(robot, trail):
    """Hips are low over a step: the foot goes over it with less to spare, or with its toes up, so that the leg fits.

    Where no path lets it fit, the foot goes as it would under high hips, and the path says so.
    """
    rise, nose, u = 2 * RISE, FIRST, np.linspace(0.0, 1.0, SAMPLES)
    start, end = (
        Pose.from_yaw(np.array([nose - 0.14, 0.1, 0.0]), 0.0),
        Pose.from_yaw(np.array([nose + 0.2, 0.1, rise]), 0.0),
    )
    other = Pose.from_yaw(start.position + [trail, -0.2, 0.0], 0.0), robot.half_sizes[Limb.RIGHT_FOOT]
    box = f'<geom type="box" size="0.5 1 {rise / 2}" pos="{nose + 0.5} 0 {rise / 2}"/>'
    collide = box_collide(world_of(box))

    def planned(height):
        com = np.column_stack(
            [np.linspace(start.position[0], nose, SAMPLES), np.zeros(SAMPLES), np.full(SAMPLES, height)]
        )
        leg = SwingingLeg(robot.legs[Limb.LEFT_FOOT], u, com, 0.0)
        task = SwingTask(0.0, 1.2, start, end, robot.half_sizes[Limb.LEFT_FOOT], True, other=other, leg=leg)
        return plan_swing(task, collide), leg

    def spare(path, leg):
        rotations = path.rotations(u)
        length = leg_posture(leg.leg, leg.com, np.zeros(SAMPLES), path.positions(u), rotations).length
        return (length - leg.leg.min_length).min()

    usual, leg = planned(1.3)
    least = 1.3 - spare(usual, leg)  # m; of the CoM for the usual path, were the foot right below the hip
    fitting = [planned(least - lower) for lower in (0.0, 0.02, 0.04)]
    assert all(path.clear and path.fits for path, _ in fitting)
    assert all(spare(path, leg) > -SPARE for path, leg in fitting)
    low, leg = planned(least - 0.3)
    assert low.clear and not low.fits and spare(low, leg) < -SPARE
