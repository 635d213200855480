"""The independent check: a good motion passes, and each kind of broken input fails in its own group."""

from dataclasses import replace

import numpy as np
import pytest

from toolkit.centroidal import residual
from toolkit.centroidal.build import initial_com, transition_problem
from toolkit.centroidal.problem import CentroidalMotion, Margins, Weights
from toolkit.centroidal.residual import Residuals, check, confirmed
from toolkit.centroidal.sequence import optimise_transition
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose


@pytest.fixture
def standing(robot, feet):
    """Standing still on both feet: every number is known."""
    palm = Contact(Limb.LEFT_PALM, Pose(np.eye(3), np.array([0.0, 0.6, 1.3])), 0.5)
    transition = ContactTransition(Limb.LEFT_PALM, palm)
    com = initial_com(robot, feet)
    problem = transition_problem(robot, feet, com, np.zeros(3), transition)
    problem = replace(problem, landing_limb=-1, landing_position=None, landing_rotation=None, final_at_rest=True)
    n = problem.steps
    force = np.zeros((n, 4, 3))
    force[:, :2, 2] = robot.mass * 9.81 / 2
    knots = np.zeros((n + 1, 3))
    return CentroidalMotion(
        problem, False, "made by hand", knots + com, knots, knots, force, np.zeros((n, 4, 2)), np.zeros((n, 4)), 0, 0, 0
    )


def test_standing_still_has_no_residual(standing):
    residuals = check(standing)
    assert residuals.largest < 1e-12
    assert confirmed(standing).feasible


def test_objective_of_standing_still(standing):
    # 2 s in units of 0.2 s, two feet, |f| = half the weight: 10 * 2 * 0.01 / 4.
    np.testing.assert_allclose(confirmed(standing).objective, 0.05, rtol=1e-12)


def broken(standing, group):
    """The motion or its problem broken in one place."""
    p, n = standing.problem, standing.problem.steps
    motion = {name: getattr(standing, name).copy() for name in ("com", "force", "cop", "yaw_torque")}
    weight = p.mass * 9.81
    if group == "initial":
        return replace(standing, problem=replace(p, com=p.com + [0, 0, 1e-3]))
    if group == "dynamics":
        motion["com"][4, 0] += 1e-3
    elif group == "inactive":
        motion["yaw_torque"][2, 3] = 1.0
    elif group == "friction":
        motion["force"][3, 0, 0], motion["force"][3, 1, 0] = 0.3 * weight, -0.3 * weight
    elif group == "normal_force":
        motion["force"][3, 0, 2], motion["force"][3, 1, 2] = -0.1 * weight, 1.1 * weight
    elif group == "cop":
        motion["cop"][3, :2, 0] = [0.12, -0.12]
    elif group == "yaw":
        motion["yaw_torque"][3, :2] = [0.1 * weight, -0.1 * weight]
    elif group == "reach":
        return replace(standing, problem=replace(p, max_reach=p.max_reach - 0.2))
    elif group == "height":
        return replace(standing, problem=replace(p, min_height=2.0))
    elif group == "final_box":
        return replace(standing, problem=replace(p, final_center=p.final_center + [0.3, 0.0, 0.0]))
    elif group == "rest":
        linear = np.tile([0.0, 0.02 * p.mass, 0.0], (n + 1, 1))
        com = standing.com + np.arange(n + 1)[:, None] * 0.2 * linear / p.mass
        p = replace(p, com_velocity=linear[0] / p.mass)
        return replace(standing, problem=p, linear_momentum=linear, com=com)
    return replace(standing, **motion)


@pytest.mark.parametrize("group", Residuals._fields)
def test_each_kind_of_broken_motion_fails(standing, group):
    motion = broken(standing, group)
    residuals = check(motion)
    assert getattr(residuals, group) > 1e-4
    assert not confirmed(motion).feasible
    if group not in ("dynamics", "normal_force", "cop", "yaw"):  # those are not alone
        others = [getattr(residuals, name) for name in Residuals._fields if name not in (group, "dynamics")]
        assert max(others) < 1e-9


def test_what_is_undefined_is_infinite(standing):
    force = standing.force.copy()
    force[0, 0, 0] = np.nan
    motion = replace(standing, force=force)
    assert check(motion).largest == np.inf
    assert not confirmed(motion).feasible and confirmed(motion).objective == np.inf
    assert check(replace(standing, com=standing.com[:-1])).largest == np.inf


def test_the_landing_contact_must_be_within_reach(standing, robot):
    far = np.array([0.0, 0.25 + robot.arms[Limb.LEFT_PALM].max_reach + 0.01, 0.95 + 0.35])
    p = replace(standing.problem, landing_limb=2, landing_position=far, landing_rotation=np.eye(3))
    np.testing.assert_allclose(check(replace(standing, problem=p)).reach, 0.01, rtol=1e-6)


def test_margins_tighten_the_constraints(standing):
    p = standing.problem
    cop = standing.cop.copy()
    cop[3, :2, 0] = [0.08, -0.08]
    shifted = replace(standing, cop=cop)
    assert check(shifted).cop == 0.0
    tight = replace(shifted, problem=replace(p, margins=Margins(cop=(0.05, 0.0))))
    np.testing.assert_allclose(check(tight).cop, 0.02 / 2, rtol=1e-9)  # 2 cm outside, half the weight
    # At most half of a small patch is taken away.
    np.testing.assert_allclose(replace(p, margins=Margins(cop=(0.08, 0.05))).reduced_half_size[0, 0], [0.055, 0.0325])


def test_yaw_moment_at_its_bound(standing):
    # A centred wrench without lateral force holds mu (X + Y) f_z about the normal (Caron et al. 2015).
    p, bound = standing.problem, 0.5 * (0.11 + 0.065) * standing.problem.mass * 9.81 / 2
    torque = standing.yaw_torque.copy()
    torque[:, 0], torque[:, 1] = bound, -bound
    assert check(replace(standing, yaw_torque=torque)).yaw < 1e-12
    assert check(replace(standing, yaw_torque=1.01 * torque)).yaw > 1e-4
    half = replace(p, margins=Margins(yaw=0.5))
    assert check(replace(standing, problem=half, yaw_torque=0.5 * torque)).yaw < 1e-12
    assert check(replace(standing, problem=half, yaw_torque=0.51 * torque)).yaw > 1e-4


def test_margins_of_a_motion(standing):
    np.testing.assert_allclose(residual.friction_margin(standing), 0.5)
    np.testing.assert_allclose(residual.cop_margin(standing), 0.065)


def test_the_objective_is_the_sum_of_its_terms(standing):
    """Term by term, with loops, for a motion that is nothing special."""
    rng = np.random.default_rng(0)
    p, n = standing.problem, standing.problem.steps
    w, weight = p.weights, p.mass * 9.81
    motion = replace(
        standing,
        linear_momentum=rng.normal(size=(n + 1, 3)),
        angular_momentum=rng.normal(size=(n + 1, 3)),
        force=rng.normal(size=(n, 4, 3)) * p.active[:, :, None],
        cop=rng.normal(size=(n, 4, 2)) * p.active[:, :, None],
        yaw_torque=rng.normal(size=(n, 4)) * p.active,
    )
    total = 0.0
    for t in range(n):
        rate = motion.force[t].sum(0) + p.mass * np.array([0, 0, -9.81])
        angular = (motion.angular_momentum[t + 1] - motion.angular_momentum[t]) / p.dt[t]
        cost = w.linear_momentum * motion.linear_momentum[t + 1] @ motion.linear_momentum[t + 1]
        cost += w.linear_momentum_rate * rate @ rate + w.angular_momentum_rate * angular @ angular
        cost += w.angular_momentum * motion.angular_momentum[t + 1] @ motion.angular_momentum[t + 1]
        for i in np.flatnonzero(p.active[t]):
            local = p.rotation[t, i].T @ motion.force[t, i] / weight
            z = motion.cop[t, i] / (2 * p.half_size[t, i])
            cost += w.force * local @ local + w.lateral_force * local[:2] @ local[:2]
            cost += w.torque * motion.yaw_torque[t, i] ** 2 + w.cop * z @ z
        total += p.dt[t] / 0.2 * cost
    np.testing.assert_allclose(confirmed(motion).objective, total, rtol=1e-12)
    assert residual.objective(motion, w) == confirmed(motion).objective
    assert residual.objective(motion, Weights(*[0.0] * 8)) == 0.0
    assert residual.objective(replace(motion, com=motion.com * np.nan), w) == np.inf


def test_feasible_solutions_pass_only_with_their_own_problem(robot, feet):
    contact = Contact(Limb.LEFT_FOOT, Pose.from_yaw(np.array([0.3, 0.1, 0.0]), 0.0), 0.5)
    transition = ContactTransition(Limb.LEFT_FOOT, contact)
    motion = optimise_transition(robot, feet, initial_com(robot, feet), np.zeros(3), transition)
    assert motion.feasible and confirmed(motion).feasible
    slippery = replace(motion.problem, margins=Margins(0.001))
    assert not confirmed(replace(motion, problem=slippery, kept=None)).feasible
