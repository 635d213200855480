"""The body's limits: torques against MuJoCo, CasADi against NumPy, and a broken input for every limit."""

from dataclasses import replace

import casadi as ca
import mujoco
import numpy as np
import pytest

from tests.centroidal.walks import walk
from tests.physics.test_leg import random_legs
from tests.shipped_robots import OWN
from toolkit.centroidal.body import BodyMargins, body_residuals
from toolkit.centroidal.build import initial_com, sequence_problem
from toolkit.centroidal.problem import GRAVITY, OVER, RISEN, CentroidalMotion
from toolkit.centroidal.program import leg_limits
from toolkit.geometry.limb import FEET, Limb
from toolkit.physics.leg import PLANNED, TORQUE_ROLES, ReachMargins, leg_clearances, leg_torques
from toolkit.robot.loader import load_robot
from validation.reference.pieces import pieces


@pytest.fixture(scope="module", params=OWN)
def walker(request):
    return load_robot(request.param)


def still(robot, problem, com=None):
    """A motion that shares the weight between the contacts, with the CoM above the middle of the feet in contact."""
    n, weight = problem.steps, -problem.mass * GRAVITY
    knots, limbs, positions, _ = problem.knot_contacts
    middle = np.stack([positions[(knots == t) & (limbs < 2)].mean(0) for t in range(n + 1)])
    middle[:, 2] += robot.com_height
    force = problem.active[:, :, None] * weight / problem.active.sum(1)[:, None, None]
    zero = np.zeros((n + 1, 3))
    return CentroidalMotion(
        problem, False, "", middle if com is None else com, zero, zero, force, np.zeros((n, 4, 2)),
        np.zeros((n, 4)), 0.0, 0.0, 0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def motion(walker):
    start, schedule = walk(walker, 2, 0.2)
    return still(walker, sequence_problem(walker, schedule, initial_com(walker, start), np.zeros(3)))


def test_torques_are_the_jacobian_transpose(walker):
    rng = np.random.default_rng(5)
    model = walker.mujoco_model
    for limb in FEET:
        leg = walker.legs[limb]
        for data, joints, _, com, position, rotation in random_legs(walker, limb, rng, 20):
            force, moment = rng.normal(size=3) * [50, 50, 300], rng.normal(size=3) * 20
            jacobian = np.zeros((2, 3, model.nv))
            mujoco.mj_jacSite(model, data, jacobian[0], jacobian[1], model.site(limb.label).id)
            torque = (jacobian[0].T @ force + jacobian[1].T @ moment)[model.jnt_dofadr[joints]]
            place = com[None], np.zeros(1), position[None], rotation[None]
            ours = leg_torques(leg, *place, force[None], moment[None])
            ankle = (
                ("ankle_pitch", "ankle_roll")
                if "pitch" in model.joint(joints[4]).name
                else ("ankle_roll", "ankle_pitch")
            )
            hips = [f"hip_{('roll', 'pitch', 'yaw')[axis]}" for axis in leg.hips.order]
            at = {role: number for number, role in enumerate([*hips, "knee", *ankle])}
            for role in TORQUE_ROLES:
                np.testing.assert_allclose(abs(ours[role][0]), abs(torque[at[role]]), atol=1e-6, err_msg=role)


def test_casadi_and_numpy_agree_about_a_leg(walker):
    rng = np.random.default_rng(6)
    wanted = ReachMargins(0.015, 0.1, 0.05)
    for limb in FEET:
        leg = walker.legs[limb]
        for _, _, _, com, position, rotation in random_legs(walker, limb, rng, 20):
            ankle = position + rotation @ leg.ankle_in_sole
            posture = [leg.hip_in_com, ankle, rotation.ravel(), [leg.thigh, leg.shin, 1.0, 0.0], leg.hips.numbers]
            parameters = np.concatenate([*posture, leg_limits(leg, wanted)])
            rows = np.array(pieces()["leg"].value(ca.vertcat(com, 0.0), parameters)).reshape(-1, 2).min(1)
            clearances = leg_clearances(leg, com[None], np.zeros(1), position[None], rotation[None], wanted)
            expected = [clearances[item.name][0] * (5 if item.quantity == "length" else 1) for item in PLANNED]
            np.testing.assert_allclose(rows, expected, atol=1e-9)


def test_casadi_and_numpy_agree_about_torques(walker):
    rng = np.random.default_rng(7)
    limb = Limb.RIGHT_FOOT
    leg = walker.legs[limb]
    for _, _, _, com, position, rotation in random_legs(walker, limb, rng, 20):
        velocity, force, moment = rng.normal(size=3), rng.normal(size=3) * 300, rng.normal(size=3) * 30
        middle = com + 0.05 * velocity
        place = middle[None], np.zeros(1), position[None], rotation[None]
        ours = leg_torques(leg, *place, force[None], moment[None])
        limits = [leg.torques[role] for role in TORQUE_ROLES]
        parameters = np.concatenate(
            [
                [0.05],
                leg.hip_in_com,
                position + rotation @ leg.ankle_in_sole,
                rotation.ravel(),
                [leg.thigh, leg.shin],
                [1.0, 0.0],
                leg.hips.numbers,
                position,
                limits,
                [0.8, 1.0],
            ]
        )
        variables = np.concatenate([com, velocity, rotation.T @ force, rotation.T @ moment, [0.5]])
        rows = np.array(pieces()["torque"].value(variables, parameters)).ravel()
        ratio = np.array([ours[role][0] for role in TORQUE_ROLES]) / limits
        np.testing.assert_allclose(rows, np.concatenate([0.9 - ratio, 0.9 + ratio]), atol=1e-9)


def test_standing_and_slow_steps_are_within_the_limits(walker, motion):
    assert body_residuals(motion, walker).largest == 0.0


def broken(motion, **shift):
    return replace(motion, com=motion.com + np.array([shift.get("x", 0), shift.get("y", 0), shift.get("z", 0)]))


def test_every_limit_is_noticed(walker, motion):
    reach = walker.legs[Limb.LEFT_FOOT].max_length
    cases = {
        "leg length": broken(motion, z=0.5 * reach),
        "swing leg length": broken(motion, z=0.5 * reach),
        "CoM height": broken(motion, z=-0.4 * walker.com_height),
        "ankle roll": broken(motion, y=0.9 * reach),
        "hip roll": broken(motion, y=0.9 * reach),
        "ankle pitch": broken(motion, x=0.4 * reach, z=-0.55 * reach),
        "hip pitch": broken(motion, x=1.5 * reach),
        "knee torque": replace(motion, force=8 * motion.force),
        "hip pitch torque": replace(motion, cop=motion.cop + [0.6, 0.0]),
        "hip roll torque": replace(motion, cop=motion.cop + [0.0, 0.6]),
        "hip yaw torque": replace(motion, yaw_torque=motion.yaw_torque + 1000.0),
        "ankle pitch torque": replace(motion, cop=motion.cop + [0.6, 0.0]),
        "ankle roll torque": replace(motion, cop=motion.cop + [0.0, 0.6]),
    }
    names = set(body_residuals(motion, walker).violation)
    assert names - {"arm reach"} == set(cases)
    for name, case in cases.items():
        assert body_residuals(case, walker).violation[name].max() > 0.0, name
    undefined = replace(motion, com=np.full_like(motion.com, np.nan))
    assert body_residuals(undefined, walker).largest == np.inf


def test_worst_names_where(walker, motion):
    com = motion.com.copy()
    com[7, 2] += 0.4
    name, knot, limb = body_residuals(replace(motion, com=com), walker).worst
    assert name.endswith("leg length") and knot == 7 and limb in FEET


def test_legs_in_the_air_fold_no_farther_than_their_knees(walker, motion):
    knots, delays, limbs, _, _ = motion.problem.swing_ankles
    leg = walker.legs[Limb(int(limbs[0]))]
    low = replace(motion, com=motion.com - [0.0, 0.0, walker.com_height + leg.hip_in_com[2] - 0.5 * leg.min_length])
    folded = body_residuals(low, walker).violation["swing leg length"]
    assert folded[knots[delays == 0.0]].max() > 0.1 * leg.min_length


@pytest.mark.parametrize("climb", [-0.2, 0.0, 0.05, 0.25, 0.5])
def test_feet_that_climb_go_up_before_they_go_on(walker, motion, climb):
    """The path begins and ends at the contacts; a climb is over what it climbs before half of the swing has passed."""
    problem, s = motion.problem, np.linspace(0.0, 1.0, 101)
    height = problem._risen(s, s, climb)
    np.testing.assert_allclose(height[[0, -1]], [0.0, climb], atol=1e-12)
    over = height.max() - max(climb, 0.0)
    if climb <= 0.0:
        np.testing.assert_allclose(height, s * climb + 4 * problem.swing_lift * s * (1 - s))
    elif climb >= 0.25:
        assert over == pytest.approx(OVER * problem.swing_lift, rel=1e-3)
        assert (height[s > 0.35] > climb).mean() > 0.95 and s[np.argmax(height)] == pytest.approx(RISEN)
    else:
        assert problem.swing_lift / 2 < over < OVER * problem.swing_lift


def test_margins_tighten(walker, motion):
    loose = body_residuals(motion, walker).violation
    tight = body_residuals(motion, walker, BodyMargins(0.01, 0.1, 0.05, 0.02, 0.8)).violation
    for name, taken in [("leg length", 0.01), ("ankle roll", 0.1), ("hip pitch", 0.05), ("knee torque", 0.2)]:
        kept = np.isfinite(loose[name])
        np.testing.assert_allclose(tight[name][kept] - loose[name][kept], taken, atol=1e-12)


def test_contacts_at_knots_and_swings(walker, motion):
    problem = motion.problem
    knots, limbs, _, _ = problem.knot_contacts
    seen = list(zip(knots.tolist(), limbs.tolist(), strict=True))
    assert len(seen) == len(set(seen))
    active = problem.active
    expected = {(t + side, limb) for t, limb in zip(*np.nonzero(active), strict=True) for side in (0, 1)}
    assert set(seen) == expected
    swing_knots, delays, swing_limbs, ankles, tangents = problem.swing_ankles
    inner = {(t, limb) for limb in (0, 1) for t in range(1, problem.steps) if not active[t - 1 : t + 1, limb].any()}
    at_knots = delays == 0.0
    assert set(zip(swing_knots[at_knots].tolist(), swing_limbs[at_knots].tolist(), strict=True)) == inner
    edges = {(t, limb) for limb in (0, 1) for t in range(problem.steps) if not active[t, limb]} - {
        (t, limb) for t, limb in inner if (t + 1, limb) in inner
    }
    between = zip(swing_knots[~at_knots].tolist(), swing_limbs[~at_knots].tolist(), strict=True)
    assert set(between) == edges  # the first and the last step of each swing
    np.testing.assert_allclose(delays[~at_knots], problem.dt[swing_knots[~at_knots]] / 2)
    tips = problem.position + np.einsum("tlij,lj->tli", problem.rotation, problem.tip_in_contact)
    for knot, limb, ankle in zip(swing_knots, swing_limbs, ankles, strict=True):
        before = tips[np.flatnonzero(active[: knot + 1, limb])[-1], limb]
        after = tips[knot + np.flatnonzero(active[knot:, limb])[0], limb]
        assert min(before[0], after[0]) <= ankle[0] <= max(before[0], after[0]) and ankle[2] > before[2]
    # a displaced contact takes the path along: wholly at its end, not at all at the other
    share = np.einsum("nij,nij->n", tangents[:, :, :2], tangents[:, :, :2]) / 2
    left = np.einsum("nij,nij->n", tangents[:, :, 2:], tangents[:, :, 2:]) / 2
    np.testing.assert_allclose(np.sqrt(share) + np.sqrt(left), 1.0, atol=1e-12)
    height, _ = problem.lowest_foot
    np.testing.assert_allclose(height, 0.0, atol=1e-12)
