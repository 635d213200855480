"""Replanning: the program about a plan, and runs with it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from toolkit.centroidal.problem import STANDARD_GRAVITY as G
from toolkit.centroidal.problem import Margins
from toolkit.control.corrector import Cones
from toolkit.control.sampled_plan import sample_reference
from toolkit.execution.config import ExecutionConfig
from toolkit.execution.disturbance import Disturbance
from toolkit.execution.run import execute
from toolkit.geometry.limb import FEET, Limb
from toolkit.physics.wrench import sole_rows
from toolkit.replanning.nominal import HORIZON, Nominal
from toolkit.replanning.replan import ReplanProblem
from toolkit.replanning.replan_program import OPTIONS
from toolkit.replanning.replanner import ReplanCounts
from toolkit.replanning.situation import Situation
from toolkit.robot.model import LINE


@pytest.fixture(scope="module")
def nominal(walking):
    plan = walking
    times = np.arange(0.0, plan.schedule.duration, 0.01)
    return Nominal.of(plan.motion, sample_reference(times, plan))


@pytest.fixture(scope="module")
def problem(walking, nominal):
    return ReplanProblem(nominal, walking.robot, walking.world.surfaces)


def situation(walking, nominal, time, com=(0, 0, 0), velocity=(0, 0, 0), **options):
    """The planned state at a time, displaced."""
    planned_com, planned_velocity, _ = walking.motion.sample(time)
    spin = [np.interp(time, nominal.times, nominal.spin[:, k]) for k in range(3)]
    step = int(np.searchsorted(nominal.times, time + 1e-6)) - 1
    plan = nominal.problem
    standing = {
        Limb(limb): (int(nominal.landing[step, limb]), plan.position[step, limb], plan.rotation[step, limb])
        for limb in np.flatnonzero(plan.active[step])
    }
    moving = {
        index: np.zeros(3)
        for index, swing in enumerate(nominal.swings)
        if swing.start <= time < swing.end and swing.limb not in standing
    }
    values: dict[str, Any] = dict(
        time=time,
        com=planned_com + com,
        velocity=planned_velocity + velocity,
        spin=np.array(spin),
        standing=standing,
        fixed={},
        moving=moving,
        goal={},
        landing={},
        earliest={},
        com_shift=np.zeros(3),
        displaced=True,
        cones=Cones(0.85, 0.8, Margins(cop=(0.02, 0.02)), 1.0),
    )
    return Situation(**(values | options))


def mid_swing(nominal):
    """A time early in the first swing."""
    swing = nominal.swings[0]
    return swing.start + 0.2 * (swing.end - swing.start)


def test_the_grid_is_the_plan(walking, nominal):
    for k in range(0, len(nominal.times), 7):
        com, velocity, _ = walking.motion.sample(float(nominal.times[k]))
        np.testing.assert_allclose(nominal.com[k], com, rtol=0.0, atol=1e-9)
        if nominal.times[k] < walking.motion.problem.times[-1]:
            np.testing.assert_allclose(nominal.velocity[k], velocity, rtol=0.0, atol=1e-9)
    assert nominal.times[-1] >= walking.motion.problem.times[-1] + HORIZON


def test_an_undisturbed_state_changes_nothing(walking, nominal, problem):
    for time in (0.0, mid_swing(nominal), 0.5 * nominal.times[-1]):
        replan = problem.solve(situation(walking, nominal, time))
        assert replan is not None
        # What the solver leaves of the distance to its rows at its tolerance.
        np.testing.assert_allclose(replan.com, 0.0, rtol=0.0, atol=2e-3)
        assert all(np.linalg.norm(shift) < 2e-3 for shift in replan.landing.values())


def test_the_first_step_bears_the_weight_however_short_it_is(walking, nominal, problem):
    """A wrong force for a few milliseconds hardly shows in the objective."""
    for knot in range(2, len(nominal.times) - 1 - int(np.sum(nominal.times > nominal.times[-1] - HORIZON)), 3):
        time = float(nominal.times[knot]) - 0.005
        replan = problem.solve(situation(walking, nominal, time, com=(0.002, 0.003, 0.002)))
        planned = nominal.wrench[knot - 1, :2, 2].sum()
        assert replan.wrench[0, :2, 2].sum() == pytest.approx(planned, abs=0.1)


def test_a_replan_obeys_the_dynamics(walking, nominal, problem):
    time = mid_swing(nominal)
    replan = problem.solve(situation(walking, nominal, time, velocity=(0.05, 0.1, 0.0)))
    dt = np.diff(replan.times)
    k = int(np.searchsorted(nominal.times, time + 1e-6)) - 1
    planned = [walking.motion.sample(float(each))[:2] for each in replan.times]
    com, velocity = (np.array(part) for part in zip(*planned, strict=True))
    velocity[replan.times >= walking.motion.problem.times[-1]] = 0.0
    com, velocity = com + replan.com, velocity + replan.velocity
    spin = (
        np.column_stack([np.interp(replan.times, nominal.times, part) for part in nominal.wrench_spin.T]) + replan.spin
    )
    for t in range(len(dt)):
        force, moment = np.zeros(3), np.zeros(3)
        for limb in np.flatnonzero(nominal.problem.active[k + t]):
            place = nominal.problem.position[k + t, limb].copy()
            event = int(nominal.landing[k + t, limb])
            place += replan.landing.get(event, np.zeros(3))
            turn = nominal.problem.rotation[k + t, limb]
            own = G * turn @ replan.wrench[t, limb, :3]
            force += own
            moment += np.cross(place, own) + G * turn @ replan.wrench[t, limb, 3:]
        acceleration = force - [0.0, 0.0, G]
        np.testing.assert_allclose(np.diff(velocity, axis=0)[t], dt[t] * acceleration, rtol=0.0, atol=OPTIONS.feasible)
        about = spin[t : t + 2] + np.cross(com[t : t + 2], velocity[t : t + 2])
        mean = com[t] + dt[t] * (velocity[t] / 2 + dt[t] * acceleration / 6)
        rate = moment + np.cross(mean, [0.0, 0.0, -G])
        np.testing.assert_allclose(np.diff(about, axis=0)[0], dt[t] * rate, rtol=0.0, atol=2 * OPTIONS.feasible)


def test_a_push_moves_the_landing_along(walking, nominal, problem):
    time = mid_swing(nominal)
    ahead = problem.solve(situation(walking, nominal, time, velocity=(0.4, 0.0, 0.0)))
    back = problem.solve(situation(walking, nominal, time, velocity=(-0.4, 0.0, 0.0)))
    assert ahead.landing[0][0] > 0.005 and back.landing[0][0] < -0.005
    assert max(np.abs(shift).max() for shift in (*ahead.landing.values(), *back.landing.values())) < 0.16


def test_wrenches_stay_in_the_cones_and_on_the_feet(walking, nominal, problem):
    """Also under a push that lets a swing end early. The polygon of the rows is made large enough to hold the cone."""
    time, cones = mid_swing(nominal), Cones(0.85, 0.8, Margins(cop=(0.02, 0.02)), 1.0)
    for push in ((0.1, 0.0, 0.0), (0.0, -0.3, 0.0), (0.0, 0.5, 0.0)):
        state = situation(walking, nominal, time, velocity=push, earliest={0: time + 0.1}, landing={0: np.inf})
        replan = problem.solve(state)
        assert np.isfinite(replan.wrench).all() and replan.wrench[:, :2, 2].sum(1).min() > 0.5
        friction = cones.friction * nominal.problem.friction[0, 0]
        for limb in FEET:
            rows = sole_rows(friction / np.cos(np.pi / 24), cones.within(walking.robot.half_sizes[limb]), cones.yaw)
            assert (replan.wrench[:, limb] @ rows.T).max() < 2e-3  # in weights, and in weights times 1 m
        lands = replan.ends.get(0, nominal.swings[0].end)
        middle = (replan.times[:-1] + replan.times[1:]) / 2
        assert not replan.wrench[middle < lands, nominal.swings[0].limb].any()


def test_the_same_state_has_the_same_answer(walking, nominal, problem):
    state = situation(walking, nominal, mid_swing(nominal), velocity=(0.3, 0.1, 0.0))
    first, second = problem.solve(state), problem.solve(state)
    np.testing.assert_array_equal(first.com, second.com)
    np.testing.assert_array_equal(first.wrench, second.wrench)


def test_a_kept_landing_is_not_moved(walking, nominal, problem):
    time = mid_swing(nominal)
    fixed = {0: np.array([0.01, 0.0, 0.0])}
    kept = situation(walking, nominal, time, velocity=(0.25, 0.0, 0.0), moving={}, fixed=fixed)
    assert 0 not in problem.solve(kept).landing


def test_no_answer_is_none(walking, nominal, problem):
    broken = situation(walking, nominal, 0.0, com=(np.nan, 0.0, 0.0))
    assert problem.solve(broken) is None


def test_a_small_push_moves_no_landing(walking, nominal, problem):
    time = mid_swing(nominal)
    small = problem.solve(situation(walking, nominal, time, velocity=(0.01, 0.0, 0.0), displaced=False))
    assert small is not None and not small.landing and not small.ends
    large = problem.solve(situation(walking, nominal, time, velocity=(0.4, 0.0, 0.0), displaced=False))
    assert large is not None and large.landing[0][0] > 0.005


def test_lines_are_replanned_at_once(walking, nominal, problem):
    """Soles settle by their centre of pressure what lines, where it cannot move, must meet with the next step."""
    narrow = replace(nominal.problem, half_size=np.minimum(nominal.problem.half_size, [np.inf, LINE]))
    lines = ReplanProblem(replace(nominal, problem=narrow), walking.robot, walking.world.surfaces)
    assert lines.deadband < LINE < problem.deadband < walking.robot.half_sizes[FEET, 1].min()
    state = situation(walking, nominal, mid_swing(nominal), com=(0.0, 0.006, 0.0), displaced=False)
    on_soles, on_lines = problem.solve(state), lines.solve(state)
    assert on_soles is not None and on_lines is not None
    np.testing.assert_allclose(on_soles.com[0], 0.0, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(on_lines.com[0], [0.0, 0.006 - lines.deadband, 0.0], rtol=0.0, atol=1e-12)


@pytest.fixture(scope="module")
def without(walking):
    """The walk without replanning; `walked` has it."""
    return walking.run(config=ExecutionConfig(replanning=False))


def test_an_undisturbed_run_is_the_same_with_replanning(walked, without):
    counts = walked.replanning
    assert counts.replans >= 20 * (walked.simulated_seconds - HORIZON)
    assert counts.replan_landings == counts.replan_failures == 0
    assert all(check.result.value == "PASS" for check in walked.checks if check.name != "goal")
    if not counts.replan_departures:
        np.testing.assert_array_equal(walked.controls.ctrl, without.controls.ctrl)
    assert walked.com_rms_error < without.com_rms_error + 1e-3


def test_a_push_is_replanned_and_the_error_counts_from_there(walking):
    run = walking.run(config=ExecutionConfig(disturbance=Disturbance(push=120.0, push_time=0.3, push_direction=1.5)))
    assert not run.fell and run.replanning.replan_departures > 0 and run.replanning.replan_failures == 0
    error = np.sqrt(((run.samples.com - run.samples.com_planned) ** 2).sum(1).mean())
    assert 0.0 < run.com_rms_error < error


def test_a_run_without_it_counts_none(without):
    assert without.replanning == ReplanCounts()


@pytest.mark.slow
def test_a_pushed_run_is_the_same_twice(walking):
    config = ExecutionConfig(disturbance=Disturbance(push=150.0, push_time=0.9, push_direction=1.5))
    first, second = walking.run(config=config), walking.run(config=config)
    assert not first.fell
    np.testing.assert_array_equal(first.controls.ctrl, second.controls.ctrl)


def test_an_answer_that_fails_is_counted_and_the_last_goes_on(walking, monkeypatch):
    monkeypatch.setattr(ReplanProblem, "solve", lambda *_: None)
    run = walking.run(config=ExecutionConfig(disturbance=Disturbance(push=60.0, push_time=0.3, push_direction=1.5)))
    assert run.replanning.replan_failures == run.replanning.replan_departures > 0
    assert not run.fell


def test_a_plan_that_uses_all_friction_is_replanned_too(walking):
    motion = replace(walking.motion, kept=Margins(friction=0.97))
    push = Disturbance(push=60.0, push_time=0.3, push_direction=1.5)
    run = execute(replace(walking.whole, motion=motion), config=ExecutionConfig(disturbance=push))
    assert not run.fell and run.replanning.replan_departures > 0
