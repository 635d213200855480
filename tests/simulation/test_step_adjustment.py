"""Landing points move with the CoM, and stay on their surfaces and clear of the other foot."""

import numpy as np
import pytest
import shapely

from toolkit.geometry.limb import FEET, Limb
from toolkit.simulation.config import ControllerConfig, ExecutionConfig, StepAdjustmentConfig, TouchdownConfig
from toolkit.simulation.disturbance import Disturbance
from toolkit.simulation.dynamics import RobotDynamics
from toolkit.simulation.limb_target import LimbTargets
from toolkit.simulation.reference import sample_reference
from toolkit.simulation.step_adjustment import StepAdjuster
from toolkit.simulation.touchdown import ContactTracker
from toolkit.wholebody.limb_paths import limb_paths
from toolkit.world.surface import Surface

PERIOD, CONFIG = 0.002, StepAdjustmentConfig(enabled=True)


def shifted(plan, com_error, surfaces=None):
    """Landing shift of the first foot after its swing, with the CoM held off its plan."""
    times = np.arange(0.0, plan.schedule.duration, PERIOD)
    paths = limb_paths(plan.robot, plan.world, plan.schedule, plan.motion)
    limbs = tuple(sorted(plan.robot.limbs))
    reference = sample_reference(times, plan.sequence, plan.schedule, plan.motion, plan.trajectory, paths, limbs)
    dynamics = RobotDynamics(plan.robot)
    dynamics.update(plan.trajectory.qpos[0], plan.trajectory.qvel[0])
    tracker = ContactTracker(reference, limbs, 700.0, np.full(4, np.inf), ControllerConfig(), TouchdownConfig())
    targets = LimbTargets(reference, tracker, ControllerConfig())
    adjuster = StepAdjuster(reference, plan.world.surfaces if surfaces is None else surfaces, plan.robot, CONFIG)
    swing, path = reference.swings[0], []
    for index in np.flatnonzero(times < swing.end - 0.01):
        dynamics.com = reference.com[index] + com_error + adjuster.com_offset
        dynamics.com_velocity[:] = reference.com_velocity[index] + adjuster.com_offset_velocity
        tracker.update(float(times[index]), PERIOD, np.zeros(4))
        adjuster.update(int(index), PERIOD, dynamics, tracker, targets)
        path.append(targets.shift[swing.limb].copy())
    return swing, np.array(path)


def test_small_deviations_move_nothing(walking):
    _, path = shifted(walking, np.array([0.9 * CONFIG.deadband, 0.0, 0.0]))
    assert not path.any()


def test_a_foot_follows_the_com_at_a_bounded_speed(walking):
    error = np.array([0.05, 0.03, 0.0])
    _, path = shifted(walking, error)
    length = np.linalg.norm(error)
    np.testing.assert_allclose(path[-1], error * (1.0 - CONFIG.deadband / length), atol=1e-6)
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() <= CONFIG.slew * PERIOD * (1 + 1e-9)


def test_the_shift_is_bounded(walking):
    _, path = shifted(walking, np.array([0.5, 0.0, 0.0]))
    np.testing.assert_allclose(np.linalg.norm(path[-1]), CONFIG.max_shift, rtol=1e-6)


@pytest.mark.parametrize("error", [(0.08, 0.0), (-0.08, 0.0), (0.0, 0.08)])
def test_the_whole_sole_stays_on_its_surface(walking, error):
    contact = walking.sequence.transitions[0].contact
    half = walking.robot.half_sizes[Limb.LEFT_FOOT] + 0.04
    ring = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half
    tile = Surface(0, "tile", contact.pose, (ring,), (ring,), 0.7, True, False)
    swing, path = shifted(walking, np.array([*error, 0.0]), (tile,))
    room = shapely.Polygon(ring).buffer(-CONFIG.margin + 1e-9)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * walking.robot.half_sizes[swing.limb]
    assert room.contains(shapely.Polygon(corners + path[-1][:2]))
    assert np.linalg.norm(path[-1]) > 0.01


def test_feet_do_not_land_on_each_other(walking):
    swing, path = shifted(walking, np.array([0.0, -0.5, 0.0]))
    apart = walking.robot.legs[Limb.LEFT_FOOT].hip_in_com[1] * 2 - 2 * walking.robot.half_sizes[swing.limb][1]
    assert apart + path[-1][1] >= CONFIG.gap - 1e-9


def test_a_pushed_walk_goes_on(walking):
    config = ExecutionConfig(
        step_adjustment=StepAdjustmentConfig(enabled=True, max_swing=1.0),
        disturbance=Disturbance(push=40.0, push_time=0.6, push_direction=0.5),
    )
    execution = walking.run(config=config)
    assert execution.completed, execution.fall_reason
    assert len(FEET) == 2 and execution.max_slip < 0.02
