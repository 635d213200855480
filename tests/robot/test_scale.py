"""Numbers are written for one body, and have their factors in one place."""

import pytest

from tests.robot.samples import write_scaled
from tests.shipped_robots import EVERY, OWN, loaded
from toolkit.centroidal.body import BodyMargins
from toolkit.centroidal.problem import Margins, Weights
from toolkit.centroidal.program import Regularisers
from toolkit.physics.leg import ReachMargins
from toolkit.robot.loader import load_robot
from toolkit.robot.scale import USUAL, Scale
from toolkit.wholebody.avoidance import BODY, Damper


def test_the_usual_body_has_factors_of_exactly_one():
    assert load_robot(None).scale == USUAL == (1.0, 1.0)
    assert USUAL.time == USUAL.speed == USUAL.moment == 1.0


def test_bodies_of_nearly_the_same_size_are_alike():
    assert Scale.of(0.797, 68.02) == USUAL
    assert Scale.of(0.632, 33.34) == (0.79, 0.49)
    assert Scale.of(1e-3, 1e-3).length > 0.0 and Scale.of(1e-3, 1e-3).force > 0.0


def test_times_are_those_of_a_pendulum_and_moments_are_forces_times_lengths():
    scale = Scale(0.25, 0.1)
    assert scale.time == scale.speed == 0.5 and scale.moment == pytest.approx(0.025)


def test_the_same_motion_to_scale_has_the_same_price():
    scale, usual = Scale(0.5, 0.1), Weights()
    small = usual.scaled(scale)
    speed, turning = scale.speed, scale.length * scale.speed  # of the CoM, and angular momentum per mass
    assert small.linear_momentum * (scale.force * speed) ** 2 == pytest.approx(usual.linear_momentum)
    assert small.linear_momentum_rate * scale.force**2 == pytest.approx(usual.linear_momentum_rate)
    assert small.angular_momentum * (scale.force * turning) ** 2 == pytest.approx(usual.angular_momentum)
    assert small.angular_momentum_rate * scale.moment**2 == pytest.approx(usual.angular_momentum_rate)
    assert small.torque * scale.moment**2 == pytest.approx(usual.torque)
    assert (small.force, small.lateral_force, small.cop) == (usual.force, usual.lateral_force, usual.cop)
    assert usual.scaled(USUAL) is usual


def test_what_makes_a_plan_easy_to_execute_follows_the_objective():
    """A motion to scale lasts longer by the factor on times, and so do the integrals that the objective consists of."""
    scale, usual = Scale(0.25, 0.1), Regularisers()
    small = usual.scaled(scale)
    lasts = scale.time
    jerk = 1.0 / scale.time  # accelerations are the same
    assert small.jerk * jerk**2 * lasts == pytest.approx(usual.jerk * lasts)
    assert small.height * scale.length**2 * lasts == pytest.approx(usual.height * lasts)
    assert small.final_center * scale.length**2 == pytest.approx(usual.final_center * lasts)
    assert small.final_acceleration == pytest.approx(usual.final_acceleration * lasts)
    assert small.final_spin * (scale.length * scale.speed) ** 2 == pytest.approx(usual.final_spin * lasts)
    assert small.landing * scale.length**2 == pytest.approx(usual.landing * lasts)
    relative = ("load", "palm", "palm_force", "cop", "slack", "excess")
    assert all(getattr(small, name) == getattr(usual, name) for name in relative)
    assert usual.scaled(USUAL) is usual


def test_margins_and_dampers_scale_their_lengths_and_times_alone():
    assert Margins(0.7, (0.05, 0.04), 0.6).scaled(0.5) == Margins(0.7, (0.025, 0.02), 0.6)
    assert ReachMargins(0.01, 0.1, 0.05).scaled(0.5) == ReachMargins(0.005, 0.1, 0.05)
    assert BodyMargins(0.01, 0.1, 0.05, 0.02, 0.8).scaled(0.5) == BodyMargins(0.005, 0.1, 0.05, 0.01, 0.8)
    assert Damper(0.04, 0.02, 0.08, 0.1, 10.0).scaled(Scale(0.25, 0.1)) == Damper(0.01, 0.005, 0.02, 0.05, 160.0)
    assert BODY.scaled(USUAL) == BODY


@pytest.mark.parametrize("name", EVERY)
def test_a_robots_scale_is_near_one_where_it_is_a_humanoid_of_a_persons_size(name):
    scale = loaded(name).scale
    assert 0.5 < scale.length < 1.5 and 0.3 < scale.force < 2.0


@pytest.mark.parametrize("name", OWN)
def test_a_robot_made_smaller_is_smaller_by_that(name, tmp_path):
    usual, small = load_robot(name), load_robot(str(write_scaled(tmp_path / "small", name, 0.5, 0.1)))
    assert small.scale == (round(0.5 * usual.scale.length, 2), pytest.approx(0.1 * usual.scale.force))
    assert small.mass == pytest.approx(0.1 * usual.mass)
    assert small.com_height == pytest.approx(0.5 * usual.com_height)
    assert small.half_sizes == pytest.approx(0.5 * usual.half_sizes)
    assert small.torque_limit == pytest.approx(0.05 * usual.torque_limit)
    assert small.kd == pytest.approx(0.05 * 0.5**0.5 * usual.kd)
    assert small.velocity_limit == pytest.approx(2**0.5 * usual.velocity_limit)
    assert small.arms[next(iter(small.arms))].max_reach == pytest.approx(
        0.5 * usual.arms[next(iter(usual.arms))].max_reach
    )
