"""Whole sequences: feasible walks with the wanted margins, honest refusals, and the program behind them."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from tests.centroidal.walks import foot, walk
from tests.shipped_robots import OWN
from toolkit.centroidal.body import body_residuals
from toolkit.centroidal.build import ProblemConfig, initial_com, sequence_problem
from toolkit.centroidal.layout import Landing
from toolkit.centroidal.problem import Margins
from toolkit.centroidal.program import SMOOTH, Program, Regularisers, wanted_friction
from toolkit.centroidal.residual import check, confirmed, cop_margin
from toolkit.centroidal.sequence import WANTED, WANTED_BODY, SequenceConfig, optimise
from toolkit.centroidal.stages.method import Squares, Work, evaluate, prepare
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.errors import InputError
from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.loader import load_robot
from validation.reference.pieces import pieces
from validation.reference.sequence import Reference


@pytest.fixture(scope="module", params=OWN)
def walker(request):
    return load_robot(request.param)


def solve(robot, steps, stride, timing, *, config=None, friction=0.5, rest=1.0):
    start, schedule = walk(robot, steps, stride, timing, friction=friction, rest=rest)
    config = config or SequenceConfig()
    return optimise(robot, schedule, initial_com(robot, start), np.zeros(3), config=config)


@pytest.mark.parametrize(("timing", "stride"), [((1.0, 1.0), 0.25), ((0.4, 0.6), 0.3), ((0.1, 0.4), 0.3)])
def test_flat_walking_keeps_the_wanted_margins(walker, timing, stride):
    motion = solve(walker, 4, stride, timing)
    assert motion.feasible and motion.outcome == motion.status == "converged", motion.outcome
    assert motion.kept is None and motion.solved.margins == motion.problem.margins == WANTED
    residuals = check(motion)
    assert residuals.within(), residuals
    # the wanted margins of the body are kept as well; the solver's own accuracy aside
    assert body_residuals(motion, walker, WANTED_BODY).largest < 1e-5
    assert cop_margin(motion) >= (walker.limbs[FEET[0]].half_size / 2).min() - 1e-6
    assert motion.objective == pytest.approx(confirmed(motion).objective)
    # at rest at both ends, over the feet
    np.testing.assert_allclose(motion.linear_momentum[-1], 0.0, atol=1e-4)
    assert np.linalg.norm(motion.com[-1, :2] - motion.problem.final_center[:2]) < 0.03
    _, _, first = motion.sample(0.0)
    _, _, last = motion.sample(motion.problem.times[-1])
    assert np.linalg.norm(first) < 1.0 and np.linalg.norm(last) < 0.3


def test_the_centre_of_pressure_stays_where_curved_ground_bears(walker):
    start, schedule = walk(walker, 4, 0.25, (0.6, 0.8), rest=1.0)
    bearing = {Limb.LEFT_FOOT: 0.04, Limb.RIGHT_FOOT: np.inf}
    phases = tuple(
        replace(phase, contacts=tuple(replace(each, bearing=bearing[each.limb]) for each in phase.contacts))
        for phase in schedule.phases
    )
    motion = optimise(walker, replace(schedule, phases=phases), initial_com(walker, start), np.zeros(3))
    assert motion.feasible and check(motion).within()
    for limb, length in bearing.items():
        half = np.minimum(length, walker.limbs[limb].bearing)
        assert (np.abs(motion.cop[:, limb]) <= motion.problem.margins.within(half) + 1e-6).all()


def test_slow_single_support_is_over_the_foot(walker):
    """Slow gaits do not forgive a CoM near the edge of the only foot: it stays over the inner half of the sole."""
    motion = solve(walker, 4, 0.2, (1.0, 1.0))
    problem = motion.problem
    for step in np.flatnonzero(problem.active.sum(1) == 1)[2:-2]:
        limb = int(np.flatnonzero(problem.active[step])[0])
        if problem.active[step - 1].sum() == 1 and problem.active[step + 1].sum() == 1:
            offset = motion.com[step] - problem.position[step, limb]
            assert abs(offset[1]) < 0.75 * walker.limbs[limb].half_size[1]


def test_too_long_a_stride_is_refused_with_its_reason(walker):
    motion = solve(walker, 3, 2.2, (0.4, 0.6))
    assert not motion.feasible
    failure = motion.failure
    assert failure is not None and failure.reason.startswith("infeasible: ")
    assert failure.knot is not None and failure.limb is not None and failure.limb.label in failure.reason
    assert f"in transition {failure.transition}, " in failure.reason and motion.outcome.endswith(failure.reason)
    assert body_residuals(motion, walker).largest > 0.01


def stand(robot, slope, friction=0.5):
    """A robot at rest on a slope in rad for two seconds."""
    stance = Stance(tuple(foot(robot, limb, 0.0, slope=slope, friction=friction) for limb in FEET))
    schedule = ContactSchedule.of(ContactSequence(stance, ()), final_rest=2.0)
    return optimise(robot, schedule, initial_com(robot, stance), np.zeros(3))


def test_margins_shrink_only_where_friction_is_short(walker):
    """Standing on a slope needs tan(slope) / mu of the friction; the motion says how much of its margin is gone."""
    for needed in (0.5, 0.8, 0.95):
        motion = stand(walker, np.arctan(needed * 0.5))
        assert motion.feasible, motion.outcome
        assert motion.problem.margins == WANTED
        assert motion.solved.margins.friction == pytest.approx(max(WANTED.friction, needed), abs=0.03)
        if needed > WANTED.friction:
            assert not check(replace(motion, kept=None)).within()


def test_ice_is_refused_with_its_reason(walker):
    ice = solve(walker, 4, 0.5, (0.15, 0.4), friction=0.01)
    assert not ice.feasible and "infeasible: " in ice.outcome


def test_no_stand_on_a_slope_beyond_the_friction_angle(walker):
    for degrees, holds in [(20, True), (26, True), (27.5, False), (30, False)]:
        motion = stand(walker, np.deg2rad(degrees))
        assert motion.feasible is holds, motion.outcome
        if not holds:
            assert "friction" in motion.outcome


def test_objective_does_not_depend_on_the_discretisation(walker):
    """The objective is an integral over time: twice as many steps give the same value."""
    values = []
    for steps in (5, 10):
        problem = ProblemConfig(steps=steps, max_dt=1.0, margins=WANTED)
        values.append(solve(walker, 2, 0.25, (1.0, 1.0), config=SequenceConfig(problem=problem)).objective)
    assert values[0] == pytest.approx(values[1], rel=0.05)  # piecewise constant wrenches, half as coarse


def test_a_broken_motion_fails_the_checks(walker):
    motion = solve(walker, 2, 0.3, (0.4, 0.6))
    assert check(motion).within()
    for name, shift in [("force", 1.0), ("com", 1e-3), ("linear_momentum", 0.1), ("yaw_torque", 5.0), ("cop", 0.05)]:
        moved = replace(motion, **{name: getattr(motion, name) + shift})
        assert not check(moved).within(), name


def test_contacts_that_are_not_finite_are_an_input_error(walker):
    stance = Stance(tuple(foot(walker, limb, 0.0, friction=np.nan) for limb in FEET))
    schedule = ContactSchedule.of(ContactSequence(stance, ()), final_rest=1.0)
    with pytest.raises(InputError, match="not finite"):
        optimise(walker, schedule, initial_com(walker, stance), np.zeros(3))


def test_palm_presses_as_wanted(walker):
    """A palm on a wall beside the robot: the plan holds it, presses gently, and lets go."""
    limb = next((limb for limb in PALMS if limb in walker.arms), None)
    if limb is None:
        pytest.skip("no palm")
    side = 1 if limb.is_left else -1
    start, _ = walk(walker, 2, 0.2)
    com = initial_com(walker, start)
    arm = walker.arms[limb]
    reach = (arm.min_reach + arm.max_reach) / 2
    rotation = np.array([[1.0, 0, 0], [0, 0, -side], [0, side, 0]])
    palm = Contact(limb, Pose(rotation, com + arm.shoulder_in_com + [0, side * reach, 0]), 0.5)
    sequence = ContactSequence(start, (ContactTransition(limb, palm), ContactTransition(limb, None)))
    schedule = ContactSchedule.of(sequence, final_rest=1.0)
    motion = optimise(walker, schedule, com, np.zeros(3))
    assert motion.feasible, motion.status
    pressed = motion.problem.active[:, limb]
    force = np.einsum("tij,ti->tj", motion.problem.rotation[:, limb], motion.force[:, limb])[:, 2]
    weight = walker.mass * 9.81
    assert pressed.any() and not force[~pressed].any()
    np.testing.assert_allclose(force[pressed] / weight, Regularisers().palm_force, rtol=0.3)
    away = palm.pose.position + [0, side * arm.max_reach, 0]
    far = ContactTransition(limb, Contact(limb, Pose(rotation, away), 0.5))
    schedule = ContactSchedule.of(ContactSequence(start, (far,)), final_rest=1.0)
    refused = optimise(walker, schedule, com, np.zeros(3))
    failure = refused.failure
    assert not refused.feasible and failure is not None and "arm reach" in failure.reason and failure.limb == limb
    assert failure.time is not None and failure.time >= 2.0 - 0.21


@pytest.fixture(scope="module", params=[False, True], ids=["fixed", "moving"])
def program(walker, request):
    start, schedule = walk(walker, 1, 0.3, (0.4, 0.6), rest=0.4)
    config = ProblemConfig(steps=2, margins=WANTED, max_dt=1.0)
    problem = sequence_problem(walker, schedule, initial_com(walker, start), np.zeros(3), config=config)
    landings = [
        Landing(phase.swing, int(np.argmin(abs(problem.times - phase.start))), -np.ones(2), np.ones(2))
        for phase in schedule.phases
        if phase.swing is not None
    ]
    return Program(problem, walker, WANTED_BODY, Regularisers(), landings if request.param else None)


def sample_point(program, rng):
    """A point near standing: lifted CoM, shared weight, small random changes."""
    layout, problem = program.layout, program.problem
    y = np.zeros((problem.steps + 1, layout.size.max()))
    y[:, :3] = problem.com - [0, 0, 0.05]
    step, limb = np.nonzero(problem.active)
    y[step, layout.wrench[step, limb] + 2] = 1 / problem.active.sum(1)[step]
    y += 0.02 * rng.normal(size=y.shape)
    return np.where(np.arange(y.shape[1]) < layout.size[:, None], y, 0.0)


def model_at(program, y, multiplier):
    """The stage solver's model at y, with all multipliers alike: work arrays and objective."""
    layout = program.layout
    stages, m = y.shape
    work = Work.of(stages, layout.states, m)._replace(hessian=np.zeros((stages, m, m)))
    given = program.prices, Squares.none(), program.blocks
    prepare(*given, work)
    for block in program.blocks:
        block.multiplier[:] = multiplier
    value = evaluate(program.steps, *given, 0, stages, layout.size, y, 0.0, False, work)
    return work, value


def test_the_solver_and_casadi_see_the_same_program(program):
    """Objective, gradient, rows, their derivatives and the Hessian: two writings of one problem."""
    rng = np.random.default_rng(8)
    prices, steps = program.prices, program.steps
    wanted = prices._replace(wanted=0.1 * rng.normal(size=len(prices.wanted)))
    turning = steps._replace(turning=0.1 * rng.normal(size=steps.turning.shape))
    program = copy(program)
    program.prices, program.steps = wanted, turning  # other values than a sequence wants
    reference = Reference(program)
    functions, p = reference.assembly.functions(), reference.assembly.parameters
    layout = program.layout
    for _ in range(3):
        y = sample_point(program, rng)
        x, multiplier = reference.flat(y), rng.uniform(0.0, 2.0)
        work, value = model_at(program, y, multiplier)
        cost, gradient = functions["nlp_grad_f"](x, p)
        assert value == pytest.approx(float(cost), rel=1e-9)
        np.testing.assert_allclose(reference.flat(work.gradient), np.array(gradient).ravel(), rtol=1e-9, atol=1e-9)
        rows, jacobian = (np.array(part) for part in functions["nlp_jac_g"](x, p))
        first = 0
        for block in program.blocks:
            n, m = block.value.shape
            at = first + np.arange(n * m).reshape(n, m)
            np.testing.assert_allclose(block.value, rows[at, 0], atol=1e-9)
            ours = np.zeros((n, m, len(x)))
            index = reference.offset[block.stage][:, None] + block.variables
            for i in range(n):
                np.add.at(ours[i].T, index[i], block.slope[i].T)
            np.testing.assert_allclose(ours, jacobian[at], rtol=1e-5, atol=1e-5)
            first += n * m
        dynamics = np.flatnonzero(reference.equal)[layout.states + 3 :]
        defects = [work.defect[step, :12] for count in range(1, 5) for step in steps_with(program, count)]
        if layout.moving:
            defects += list(work.defect[:, 12:])
        np.testing.assert_allclose(-np.concatenate(defects), rows[dynamics, 0], atol=1e-9)
        following = [work.following[step, :12] for count in range(1, 5) for step in steps_with(program, count)]
        numbers = [step for count in range(1, 5) for step in steps_with(program, count)]
        if layout.moving:
            following += list(work.following[:, 12:])
            numbers += list(range(program.problem.steps))
        row = 0
        for step, slope in zip(numbers, following, strict=True):
            size, begin = layout.size[step], reference.offset[step]
            found = -jacobian[dynamics[row : row + len(slope)], begin : begin + size]
            np.testing.assert_allclose(slope[:, :size], found, atol=1e-9)
            row += len(slope)
        lam = np.where(reference.equal, 0.0, -multiplier)
        upper = np.array(functions["nlp_hess_l"](x, p, 1.0, lam))
        hessian = upper + np.triu(upper, 1).T
        for stage, (begin, size) in enumerate(zip(reference.offset, layout.size, strict=True)):
            ours = np.tril(work.hessian[stage, :size, :size])
            ours = ours + np.tril(ours, -1).T
            theirs = hessian[begin : begin + size, begin : begin + size]
            np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=1e-5 * np.abs(theirs).max())


def steps_with(program, count):
    """Steps with so many contacts."""
    return np.flatnonzero(np.diff(program.steps.first) == count)


def test_derivatives_are_those_of_finite_differences(program):
    reference, rng = Reference(program), np.random.default_rng(8)
    x, p = reference.flat(sample_point(program, rng)), reference.assembly.parameters
    functions = reference.assembly.functions()
    rows, jacobian = (np.array(part) for part in functions["nlp_jac_g"](x, p))
    gradient = np.array(functions["nlp_grad_f"](x, p)[1]).ravel()
    np.testing.assert_allclose(rows, np.array(functions["nlp_g"](x, p)), atol=1e-12)
    step = 1e-6
    for index in rng.permutation(len(x))[:60]:
        change = np.zeros(len(x))
        change[index] = step
        slope = np.array(functions["nlp_g"](x + change, p) - functions["nlp_g"](x - change, p)) / (2 * step)
        np.testing.assert_allclose(jacobian[:, [index]], slope, atol=1e-6)
        cost = float(functions["nlp_f"](x + change, p) - functions["nlp_f"](x - change, p)) / (2 * step)
        assert gradient[index] == pytest.approx(cost, abs=1e-5, rel=1e-6)


def test_hessian_is_convex(program):
    """Gauss-Newton in the objective, and friction rows whose multipliers are not positive: no negative curvature."""
    reference, rng = Reference(program), np.random.default_rng(9)
    x, p = reference.flat(sample_point(program, rng)), reference.assembly.parameters
    multipliers = -rng.random(reference.assembly.rows)
    upper = np.array(reference.assembly.functions()["nlp_hess_l"](x, p, 0.7, multipliers))
    assert not np.tril(upper, -1).any()
    hessian = upper + np.triu(upper, 1).T
    assert np.linalg.eigvalsh(hessian)[0] > -1e-6 * np.abs(hessian).max()


def test_program_objective_is_the_paper_s_without_regularisers(walker):
    start, schedule = walk(walker, 1, 0.3, (0.4, 0.6))
    none = Regularisers(*[0.0] * 9, slack=3000.0)
    config = SequenceConfig(problem=ProblemConfig(margins=Margins()), regularisers=none)
    motion = optimise(walker, schedule, initial_com(walker, start), np.zeros(3), config=config)
    regular = optimise(walker, schedule, initial_com(walker, start), np.zeros(3))
    assert motion.feasible and motion.objective < regular.objective


def test_landing_points_move_where_that_helps(walker):
    """Uneven strides become even within their room; the motion keeps every limit where the feet then are."""
    start, schedule = walk(walker, 4, 0.3, (0.1, 0.4), rest=1.0)
    com = initial_com(walker, start)
    fixed = optimise(walker, schedule, com, np.zeros(3))
    room = np.zeros((len(schedule.phases), 2, 2))
    room[1, :, 0], room[2, :, 0] = (-0.05, 0.05), (-0.05, 0.0)
    moved = optimise(walker, schedule, com, np.zeros(3), room=room)
    assert moved.feasible, moved.outcome
    assert check(moved).within() and body_residuals(moved, walker).largest < 1e-5
    np.testing.assert_array_equal(moved.problem.position, fixed.problem.position)
    shift = moved.solved.position - fixed.solved.position
    assert np.abs(shift).max() <= 0.05 + 1e-6 and np.abs(shift[..., 1:]).max() < 1e-9
    assert np.abs(shift).max() > 1e-3
    assert moved.objective < fixed.objective * (1 + 1e-3)
    nowhere = optimise(walker, schedule, com, np.zeros(3), room=0 * room)
    np.testing.assert_allclose(nowhere.com, fixed.com, atol=2e-3)


def test_an_active_upper_bound_on_a_length_brings_its_whole_curvature():
    piece = pieces()["distance"]
    rng = np.random.default_rng(10)
    v, p = rng.normal(size=piece.size), rng.normal(size=piece.parameters)
    multiplier = np.array([0.0, -2.0])

    def gradient(at):
        jacobian = np.zeros((piece.rows, piece.size))
        jacobian[piece.jacobian_pattern] = np.array(piece.first(at, p)[1]).ravel()
        return jacobian.T @ multiplier

    hessian = np.zeros((piece.size, piece.size))
    rows, columns = (np.array(part) for part in piece.hessian_pattern)
    hessian[rows, columns] = np.array(piece.second(v, p, 1.0, multiplier)).ravel()
    step = 1e-6 * np.eye(piece.size)
    numerical = np.stack([(gradient(v + change) - gradient(v - change)) / 2e-6 for change in step])
    np.testing.assert_allclose(hessian, numerical, atol=1e-7)
    assert np.abs(hessian).max() > 0.1


def test_a_lightly_loaded_contact_is_as_curved_along_its_load_as_its_objective():
    piece = pieces()["contact"]
    rng = np.random.default_rng(11)
    p = rng.uniform(0.1, 0.5, piece.parameters)
    v = np.concatenate([[0.001, 0.002, 0.02, 0.004, -0.003, 0.0], np.zeros(3)])
    none = np.zeros(piece.rows)

    def slope(load):
        at = v.copy()
        at[2] = load
        return float(piece.gradient(at, p)[1][2])

    rows, columns = (np.array(part) for part in piece.hessian_pattern)
    at = int(np.flatnonzero((rows == 2) & (columns == 2))[0])
    known = float(np.array(piece.second(v, p, 1.0, none)).ravel()[at])
    exact = (slope(0.02 + 1e-6) - slope(0.02 - 1e-6)) / 2e-6
    assert 0.9 * exact < known < 1.5 * exact


def test_a_steep_tile_is_wanted_to_hold_what_resting_on_it_takes(walker):
    """Between the wanted margin and the friction angle the margin gives way; beyond it nothing rests anyway."""
    for needed, wanted in [(0.2, 0.66), (0.7, 0.8), (0.85, 0.9), (0.99, 0.9), (1.1, 0.66)]:
        stance = Stance(tuple(foot(walker, limb, 0.0, slope=np.arctan(needed * 0.5)) for limb in FEET))
        schedule = ContactSchedule.of(ContactSequence(stance, ()), final_rest=1.0)
        config = SequenceConfig().problem
        problem = sequence_problem(walker, schedule, initial_com(walker, stance), np.zeros(3), config=config)
        steps = np.arange(problem.steps)
        np.testing.assert_allclose(wanted_friction(problem, steps, 0), wanted, atol=1e-12)
        unlimited = replace(problem, margins=Margins())
        np.testing.assert_allclose(wanted_friction(unlimited, steps, 0), 1.0, atol=1e-12)


def test_motions_that_slide_somewhere_are_smoother(walker):
    """The price of jerk, beside that of the momenta, is the same wherever feet rest."""

    def jerk(needed):
        stance = Stance(tuple(foot(walker, limb, 0.0, slope=np.arctan(needed * 0.5)) for limb in FEET))
        schedule = ContactSchedule.of(ContactSequence(stance, ()), final_rest=1.0)
        config = SequenceConfig().problem
        problem = sequence_problem(walker, schedule, initial_com(walker, stance), np.full(3, 0.1), config=config)
        return Program(problem, walker, WANTED_BODY, Regularisers()).steps.weights[:, 4]

    np.testing.assert_array_equal(jerk(0.2), jerk(0.9))
    for slides in (0.97, 1.1):  # more than a plan may use
        np.testing.assert_allclose(jerk(slides), SMOOTH * jerk(0.9))
