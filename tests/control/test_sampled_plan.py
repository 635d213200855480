"""The reference is the plan: sampled exactly, at rest beyond its end."""

import numpy as np

from toolkit.control.dynamics import RobotDynamics
from toolkit.control.sampled_plan import sample_reference
from toolkit.geometry.limb import FEET, Limb
from toolkit.wholebody.motion_dynamics import planned_wrench


def test_com_velocity_and_acceleration_are_derivatives(walking):
    times = np.arange(0.0, walking.schedule.duration, 0.002)
    reference = sample_reference(times, walking)
    # Piecewise quadratic: central differences of neighbours are exact but where the acceleration jumps.
    velocity = (reference.com[2:] - reference.com[:-2]) / 0.004
    np.testing.assert_allclose(velocity, reference.com_velocity[1:-1], atol=5e-3)
    assert np.median(np.abs(velocity - reference.com_velocity[1:-1])) < 1e-9


def test_swings_and_contacts_follow_the_schedule(walking):
    times = np.arange(0.0, walking.schedule.duration + 0.3, 0.002)
    reference = sample_reference(times, walking)
    assert [swing.limb for swing in reference.swings] == [t.limb for t in walking.sequence.transitions]
    for swing in reference.swings:
        assert swing.breaks and swing.contact is not None
        inside = (times > swing.start + 1e-6) & (times < swing.end - 1e-6)
        assert not reference.in_contact[inside, swing.limb].any()
        assert reference.in_contact[inside, swing.limb.mirrored].all()
    assert reference.in_contact[-1, :2].all()


def test_the_plan_rests_after_its_end(walking):
    end = walking.schedule.duration
    reference = sample_reference(np.array([end + 0.1, end + 0.2]), walking)
    for rate in ("com_velocity", "com_acceleration", "angular_momentum_rate", "joint_velocity", "joint_acceleration"):
        assert not getattr(reference, rate).any(), rate
    np.testing.assert_array_equal(reference.com[0], reference.com[1])


def test_angular_momentum_is_that_of_the_postures(walking):
    """By the equation of motion, which shares nothing with the sampled sum over the bodies; smoothed over 0.1 s."""
    trajectory, dynamics = walking.trajectory, RobotDynamics(walking.robot)
    reference = sample_reference(trajectory.times, walking)
    exact = np.zeros((len(trajectory.times), 3))
    for index, state in enumerate(zip(trajectory.qpos, trajectory.qvel, strict=True)):
        dynamics.update(*state)
        exact[index] = dynamics.angular_momentum
    assert np.abs(exact).max() > 0.5  # kg m^2/s: the walk swings its legs
    np.testing.assert_allclose(reference.angular_momentum, exact, atol=0.15 * np.abs(exact).max())
    gained = np.cumsum(reference.angular_momentum_rate, axis=0) * (trajectory.times[1] - trajectory.times[0])
    np.testing.assert_allclose(gained, reference.angular_momentum, atol=0.1 * np.abs(exact).max())


def test_planned_wrenches_balance_the_planned_momentum(walking):
    """Newton and Euler in the world frame, from wrenches about the patches' centres."""
    motion, problem = walking.motion, walking.motion.problem
    wrench = planned_wrench(motion)
    force = np.einsum("nlij,nlj->nli", problem.rotation, wrench[..., :3])
    moment = np.einsum("nlij,nlj->nli", problem.rotation, wrench[..., 3:])
    gained = force.sum(1) + problem.mass * np.array([0.0, 0.0, -9.81])
    change = np.diff(motion.linear_momentum, axis=0) / problem.dt[:, None]
    np.testing.assert_allclose(change, gained, atol=1e-3 * problem.mass)
    about_origin = np.cross(problem.position, force).sum(1) + moment.sum(1)
    weight = problem.mass * np.array([0.0, 0.0, -9.81])
    middle = 0.5 * (motion.com[1:] + motion.com[:-1])  # within dt^2 |c''| / 12 of the interval's mean
    momentum = motion.angular_momentum + np.cross(motion.com, motion.linear_momentum)
    rate = np.diff(momentum, axis=0) / problem.dt[:, None]
    np.testing.assert_allclose(rate, about_origin + np.cross(middle, weight), atol=2.0)


def test_palms_without_contact_are_free(walking):
    reference = sample_reference(np.array([0.0, 1.0]), walking)
    for limb in walking.robot.limbs:
        free = limb not in FEET
        assert (reference.authority[:, limb] == (0.0 if free else 1.0)).all()
    assert not reference.wrench[:, Limb.LEFT_PALM].any()
