"""Figures of motions and of runs, against small cases that can be done by hand."""

from dataclasses import replace

import numpy as np
import pytest

from toolkit.centroidal.problem import GRAVITY, CentroidalMotion, CentroidalProblem
from toolkit.geometry.limb import Limb
from validation.motion_figures import motion_figures, pooled
from validation.run_trial import held_within, holds, palm_force_error

MASS = 50.0
WEIGHT = -MASS * GRAVITY[2]


def standing() -> CentroidalMotion:
    """Two steps, 1 s on both feet, 3 s on the left one, with made-up momenta and forces."""
    n = 2
    active = np.zeros((n, 4), bool)
    active[0, :2] = active[1, 0] = True
    problem = CentroidalProblem(
        mass=MASS,
        dt=np.array([1.0, 3.0]),
        active=active,
        position=np.zeros((n, 4, 3)),
        rotation=np.tile(np.eye(3), (n, 4, 1, 1)),
        friction=np.full((n, 4), 0.5),
        half_size=np.tile([0.1, 0.05], (n, 4, 1)),
        max_normal_force=np.full(4, 1e4),
        yaw=np.zeros(n + 1),
        com=np.zeros(3),
        com_velocity=np.zeros(3),
        angular_momentum=np.zeros(3),
        root_in_com=np.zeros((4, 3)),
        tip_in_contact=np.zeros((4, 3)),
        max_reach=np.ones(4),
        min_height=0.0,
        final_center=np.zeros(3),
        final_half_size=np.ones(3),
        final_at_rest=True,
    )
    force = np.zeros((n, 4, 3))
    force[0, :2] = [0.0, 0.0, WEIGHT / 2]
    force[1, 0] = [0.0, 0.1 * WEIGHT, WEIGHT]
    cop = np.zeros((n, 4, 2))
    cop[0, 0] = [0.08, 0.0]
    torque = np.zeros((n, 4))
    torque[1, 0] = -2.0
    return CentroidalMotion(
        problem=problem,
        feasible=True,
        status="",
        com=np.zeros((n + 1, 3)),
        linear_momentum=np.array([[0.0, 0, 0], [4.0, 0, 0], [4.0, 3.0, 0]]),
        angular_momentum=np.array([[0.0, 0, 0], [0, 2.0, 0], [0, 0, 0]]),
        force=force,
        cop=cop,
        yaw_torque=torque,
        objective=0.0,
        seconds=0.0,
        iterations=0,
    )


def test_means_are_over_time_and_over_the_contacts_that_are_made():
    figures = motion_figures(standing())
    assert figures.duration == 4.0
    assert figures.linear_momentum == pytest.approx((1 * 4 + 3 * 5) / 4)
    assert figures.linear_momentum_rate == pytest.approx((1 * 4 + 3 * 1) / 4)
    assert figures.angular_momentum == pytest.approx(0.5)
    assert figures.angular_momentum_rate == pytest.approx((1 * 2 + 3 * 2 / 3) / 4)
    assert figures.force == pytest.approx((1 * 0.5 + 3 * np.sqrt(1.01)) / 4)
    assert figures.torque == pytest.approx(3 * 2.0 / 4)
    assert figures.lateral_force == pytest.approx(3 * 0.1 / 4)
    assert figures.cop_distance == pytest.approx((1 * (0.02 + 0.05) / 2 + 3 * 0.05) / 4)


def test_a_contact_without_load_has_no_centre_of_pressure():
    motion = standing()
    force = motion.force.copy()
    force[0, 0] = 0.0
    assert motion_figures(replace(motion, force=force)).cop_distance == pytest.approx(0.05)


def test_motions_are_pooled_by_their_time():
    short = motion_figures(standing())
    long = replace(short, duration=12.0, force=2.0)
    both = pooled([short, long])
    assert both.duration == 16.0
    assert both.force == pytest.approx(0.25 * short.force + 0.75 * 2.0)
    assert pooled([]) is None


def test_palm_forces_are_compared_where_palms_are_planned_to_push():
    planned = np.zeros((4, 4, 6))
    planned[1:3, Limb.LEFT_PALM, 1] = 50.0
    planned[:, Limb.LEFT_FOOT, 2] = 500.0
    measured = planned.copy()
    measured[1, Limb.LEFT_PALM, 1] = 40.0
    measured[2, Limb.LEFT_PALM, 1] = 60.0
    measured[3, Limb.LEFT_PALM, 1] = 100.0  # not planned: it counts elsewhere
    measured[:, Limb.LEFT_FOOT, 2] = 0.0
    assert palm_force_error(measured, planned) == pytest.approx(0.2)
    assert palm_force_error(planned, planned) == 0.0
    assert palm_force_error(planned, np.zeros_like(planned)) is None


GOOD = {
    "arrived": True,
    "replays": True,
    "max_slip": 0.019,
    "max_scuff": 0.049,
    "unplanned_contacts": 0,
    "max_torque_ratio": 1.0,
    "max_velocity_ratio": 1.0,
}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("arrived", False),
        ("replays", False),
        ("max_slip", 0.021),
        ("max_slip", float("nan")),
        ("max_scuff", 0.051),
        ("unplanned_contacts", 1),
        ("max_torque_ratio", 1.01),
        ("max_velocity_ratio", 1.01),
    ],
)
def test_a_run_that_breaks_one_condition_does_not_hold(name, value):
    assert holds(GOOD)
    assert not holds(GOOD | {name: value})
    if name not in ("arrived", "replays"):
        assert not held_within(GOOD | {name: value})


def test_centres_of_pressure_of_the_feet_alone_leave_palms_out():
    motion = standing()
    active, force, half = motion.problem.active.copy(), motion.force.copy(), motion.problem.half_size.copy()
    active[:, 2], force[:, 2], half[:, 2] = True, [0.0, 0.0, WEIGHT / 10], 0.01
    held = motion_figures(replace(motion, force=force, problem=replace(motion.problem, active=active, half_size=half)))
    assert held.foot_cop_distance == pytest.approx(motion_figures(motion).cop_distance)
    assert held.cop_distance < held.foot_cop_distance
