"""The fast solver: known answers, symmetries, honesty about feasibility, and agreement with the reference."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from toolkit.centroidal import fast
from toolkit.centroidal.build import ProblemConfig, initial_com, sequence_problem, transition_problem
from toolkit.centroidal.problem import Margins
from toolkit.centroidal.residual import check
from toolkit.contacts.category import Category
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose, rotation_on_surface
from toolkit.world.timing import Timing
from validation import reference_solver
from validation.random_contacts import SamplingConfig, TransitionSample, sample_transition, sample_walk

MIRROR = np.diag([1.0, -1.0, 1.0])


def solve(robot, sample, **options):
    problem = transition_problem(robot, sample.stance, sample.com, sample.com_velocity, sample.transition, **options)
    return fast.solve(problem)


def samples(robot, count, seed=0, config=None):
    """`count` random transitions of each category."""
    return [
        sample_transition(robot, category, np.random.default_rng([seed, category, index]), config)
        for category in Category
        for index in range(count)
    ]


def moved(sample, motion):
    """The sample carried along by a rigid motion (a yaw and a translation)."""
    turn = motion.rotation

    def carry(contact):
        return Contact(contact.limb, motion @ contact.pose, contact.friction)

    transition = sample.transition
    contact = None if transition.contact is None else carry(transition.contact)
    return TransitionSample(
        Stance(tuple(carry(contact) for contact in sample.stance.contacts)),
        motion @ sample.com,
        turn @ sample.com_velocity,
        ContactTransition(transition.limb, contact, transition.timing),
    )


def mirrored(sample):
    """The sample with left and right exchanged."""

    def flip(contact):
        # The y axis of a mirrored frame points the other way, so that it stays right-handed.
        pose = Pose(MIRROR @ contact.pose.rotation @ MIRROR, MIRROR @ contact.pose.position)
        return Contact(contact.limb.mirrored, pose, contact.friction)

    transition = sample.transition
    contact = None if transition.contact is None else flip(transition.contact)
    contacts = sorted((flip(contact) for contact in sample.stance.contacts), key=lambda item: item.limb)
    return TransitionSample(
        Stance(tuple(contacts)),
        MIRROR @ sample.com,
        MIRROR @ sample.com_velocity,
        ContactTransition(transition.limb.mirrored, contact, transition.timing),
    )


def standing_problem(robot, stance, seconds=2.0, config=None):
    schedule = ContactSchedule.of(ContactSequence(stance, ()), initial_rest=seconds)
    return sequence_problem(robot, schedule, initial_com(robot, stance), np.zeros(3), config=config)


def slope(robot, angle, friction):
    """Both feet on a slope that falls along x."""
    rotation = rotation_on_surface(np.array([np.sin(angle), 0.0, np.cos(angle)]), 0.0)
    return Stance(
        tuple(
            Contact(foot, Pose(rotation, np.array([0.0, robot.legs[foot].hip_in_com[1], 0.0])), friction)
            for foot in FEET
        )
    )


def test_standing_feet_share_the_weight(robot, feet):
    motion = fast.solve(standing_problem(robot, feet))
    weight = robot.mass * 9.81
    assert motion.feasible
    np.testing.assert_allclose(motion.force[:, :2, 2], weight / 2, rtol=1e-3)  # to the objective's tolerance
    np.testing.assert_allclose(motion.com, np.tile(motion.com[0], (len(motion.com), 1)), atol=1e-3)
    np.testing.assert_allclose(motion.objective, 10 * 2 * 0.01 / 4, rtol=1e-3)


def test_a_slope_steeper_than_the_friction_angle_does_not_hold(robot):
    """30 degrees at mu 0.5: at rest for 2 s on the slope alone is impossible, 25 degrees is possible."""
    for angle, holds in ((30, False), (27, False), (26, True), (20, True)):
        stance = slope(robot, np.radians(angle), 0.5)
        motion = fast.solve(standing_problem(robot, stance))
        assert motion.feasible == holds, angle
        assert holds or motion.status.startswith("infeasible")


def test_a_step_on_a_slope_from_rest(robot):
    for friction, holds in ((0.5, False), (0.62, True)):
        stance = slope(robot, np.radians(30), friction)
        pose = stance[Limb.LEFT_FOOT].pose
        contact = Contact(Limb.LEFT_FOOT, Pose(pose.rotation, pose @ np.array([0.2, 0.0, 0.0])), friction)
        problem = transition_problem(
            robot, stance, initial_com(robot, stance), np.zeros(3), ContactTransition(Limb.LEFT_FOOT, contact)
        )
        # At rest in the end: otherwise the CoM may slide downhill within the final box.
        assert fast.solve(replace(problem, final_at_rest=True)).feasible == holds


def test_ice_does_not_stop_a_moving_com(robot, feet):
    contact = Contact(Limb.LEFT_FOOT, Pose.from_yaw(np.array([0.2, 0.1, 0.0]), 0.0), 0.005)
    stance = Stance(tuple(replace(item, friction=0.005) for item in feet.contacts))
    transition = ContactTransition(Limb.LEFT_FOOT, contact)
    com, velocity = initial_com(robot, stance), np.array([0.0, 0.6, 0.0])
    assert not fast.solve(transition_problem(robot, stance, com, velocity, transition)).feasible
    grip = ContactTransition(Limb.LEFT_FOOT, replace(contact, friction=0.8))
    stance = Stance(tuple(replace(item, friction=0.8) for item in stance.contacts))
    assert fast.solve(transition_problem(robot, stance, com, velocity, grip)).feasible


def test_a_contact_out_of_reach_is_infeasible(robot, feet):
    contact = Contact(Limb.LEFT_FOOT, Pose.from_yaw(np.array([1.6, 0.1, 0.0]), 0.0), 0.5)
    transition = ContactTransition(Limb.LEFT_FOOT, contact)
    motion = fast.solve(transition_problem(robot, feet, initial_com(robot, feet), np.zeros(3), transition))
    assert not motion.feasible and "multipliers" in motion.status
    high = initial_com(robot, feet) + [0.0, 0.0, 0.2]
    motion = fast.solve(transition_problem(robot, feet, high, np.zeros(3), transition))
    assert not motion.feasible and "initial CoM" in motion.status


def test_too_weak_a_limb_cannot_carry_the_weight(robot, feet):
    config = ProblemConfig(max_normal_force=0.9)
    assert fast.solve(standing_problem(robot, feet, config=config)).feasible
    contact = Contact(Limb.LEFT_FOOT, Pose.from_yaw(np.array([0.2, 0.1, 0.0]), 0.0), 0.5)
    transition = ContactTransition(Limb.LEFT_FOOT, contact, Timing(1.0, 3.0))
    args = (robot, feet, initial_com(robot, feet), np.zeros(3), transition)
    assert not fast.solve(transition_problem(*args, config=config, final_at_rest=True)).feasible
    assert fast.solve(transition_problem(*args, final_at_rest=True)).feasible


def test_without_a_force_bound(robot, feet):
    problem = standing_problem(robot, feet)
    motion = fast.solve(replace(problem, max_normal_force=np.full(4, np.inf)))
    assert motion.feasible


def test_in_the_air_there_is_only_gravity(robot, feet):
    problem = standing_problem(robot, feet, 0.4)
    flying = replace(
        problem, active=np.zeros_like(problem.active), final_at_rest=False, com_velocity=np.array([0, 0, 1.9])
    )
    motion = fast.solve(flying)
    assert motion.feasible
    time = problem.times
    np.testing.assert_allclose(motion.com[:, 2] - motion.com[0, 2], 1.9 * time - 9.81 / 2 * time**2, atol=1e-12)
    assert not fast.solve(replace(flying, final_at_rest=True)).feasible


def test_the_place_and_heading_of_the_world_do_not_matter(robot):
    carry = Pose.from_yaw(np.array([40.0, -25.0, 3.0]), 2.1)
    for sample in samples(robot, 1, seed=3):
        here, there = solve(robot, sample), solve(robot, moved(sample, carry))
        assert here.feasible == there.feasible
        if here.feasible:
            # Rounding differs, and with it the iteration that first meets the tolerance of 1e-4.
            np.testing.assert_allclose(there.objective, here.objective, rtol=1e-3)
            if here.iterations == there.iterations:
                np.testing.assert_allclose(there.com, carry @ here.com, atol=1e-3)


def test_left_and_right_are_alike(robot):
    for sample in samples(robot, 1, seed=4):
        here, there = solve(robot, sample), solve(robot, mirrored(sample))
        assert here.feasible == there.feasible
        if here.feasible:
            np.testing.assert_allclose(there.objective, here.objective, rtol=1e-3)
            if here.iterations == there.iterations:
                np.testing.assert_allclose(there.com, here.com @ MIRROR, atol=1e-3)


def test_heavier_robots_move_the_same_way_under_scaled_weights(robot, feet):
    """With only the terms that scale alike, the motion does not depend on the mass."""
    contact = Contact(Limb.LEFT_FOOT, Pose.from_yaw(np.array([0.3, 0.1, 0.0]), 0.0), 0.5)
    transition = ContactTransition(Limb.LEFT_FOOT, contact)
    heavy = type(robot)(mass=2 * robot.mass)
    motions = []
    for item in (robot, heavy):
        weights = replace(ProblemConfig().weights, force=0.0, lateral_force=0.0, cop=0.0)
        config = ProblemConfig(weights=weights)
        args = (item, feet, initial_com(item, feet), np.array([0.2, 0.1, 0.0]), transition)
        motions.append(fast.solve(transition_problem(*args, config=config), config=fast.FastConfig(tolerance=1e-6)))
    np.testing.assert_allclose(motions[1].com, motions[0].com, atol=1e-3)
    np.testing.assert_allclose(motions[1].objective, 4 * motions[0].objective, rtol=1e-3)


def test_solutions_are_confirmed_and_reproducible(robot):
    for sample in samples(robot, 2, seed=5):
        first, second = solve(robot, sample), solve(robot, sample)
        np.testing.assert_array_equal(first.force, second.force)
        assert not first.status.startswith("undecided")
        if first.feasible:
            assert check(first).largest < 1e-6


def test_margins_are_kept(robot, feet):
    contact = Contact(Limb.LEFT_FOOT, Pose.from_yaw(np.array([0.3, 0.1, 0.0]), 0.2), 0.5)
    transition = ContactTransition(Limb.LEFT_FOOT, contact, Timing(0.2, 0.5))
    config = ProblemConfig(margins=Margins(friction=0.66, cop=(0.055, 0.045), yaw=0.7))
    problem = transition_problem(robot, feet, initial_com(robot, feet), np.zeros(3), transition, config=config)
    motion = fast.solve(problem)
    assert motion.feasible
    assert np.abs(motion.cop[:, 0]).max() <= 0.11 and np.abs(motion.cop[:, 1, 0]).max() <= 0.055 + 1e-9


def test_arrays_of_any_kind_are_taken(robot):
    sample = samples(robot, 1, seed=6)[0]
    problem = transition_problem(robot, sample.stance, sample.com, sample.com_velocity, sample.transition)
    odd = replace(
        problem,
        rotation=np.asfortranarray(problem.rotation),
        position=problem.position.astype(np.float32).astype(object).astype(float)[::1],
        landing_limb=Limb(problem.landing_limb),
        min_height=np.float32(problem.min_height),
    )
    odd.dt.setflags(write=False)
    kernel = fast._solved
    before = len(kernel.signatures)
    fast.solve(odd)
    assert len(kernel.signatures) == max(before, 1)  # nothing was compiled anew


def test_threads_give_the_same_answers(robot):
    problems = [
        transition_problem(robot, s.stance, s.com, s.com_velocity, s.transition) for s in samples(robot, 1, seed=7)
    ]
    alone = [fast.solve(problem) for problem in problems]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(fast.solve, problems))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.force, other.force)


def test_motions_travel_between_processes(robot):
    motion = solve(robot, samples(robot, 1, seed=8)[0])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(motion)).com, motion.com)


@pytest.mark.parametrize("timing", [Timing(1.0, 1.0), Timing(0.1, 0.4)])
def test_walks_are_solved(robot, timing):
    sequence = sample_walk(robot, 20, np.random.default_rng(0), timing=timing)
    schedule = ContactSchedule.of(sequence, initial_rest=0.5, final_rest=1.0)
    problem = sequence_problem(robot, schedule, initial_com(robot, sequence.start), np.zeros(3))
    motion = fast.solve(problem)
    assert motion.feasible, motion.status
    assert motion.iterations < 40
    np.testing.assert_allclose(motion.linear_momentum[-1], 0.0, atol=1e-5)


def compare(robot, items):
    """Shares of transitions on which fast and reference agree: feasibility, objective within 1 %."""
    same, close = [], []
    for sample in items:
        problem = transition_problem(robot, sample.stance, sample.com, sample.com_velocity, sample.transition)
        quick, slow = fast.solve(problem), reference_solver.solve(problem)
        same.append(quick.feasible == slow.feasible)
        if quick.feasible and slow.feasible:
            close.append(abs(quick.objective / slow.objective - 1) < 0.01)
    return np.mean(same), np.mean(close) if close else 1.0


def test_a_walk_agrees_with_the_reference(robot):
    sequence = sample_walk(robot, 2, np.random.default_rng(1), timing=Timing(0.2, 0.5))
    problem = sequence_problem(
        robot, ContactSchedule.of(sequence, final_rest=1.0), initial_com(robot, sequence.start), np.zeros(3)
    )
    quick, slow = fast.solve(problem), reference_solver.solve(problem)
    assert quick.feasible and slow.feasible
    np.testing.assert_allclose(quick.objective, slow.objective, rtol=1e-3)


def test_random_transitions_agree_with_the_reference(robot):
    same, close = compare(robot, samples(robot, 1, seed=9))
    assert same == 1.0 and close == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("category", Category)
def test_many_random_transitions_agree_with_the_reference(robot, category):
    wide = SamplingConfig(friction=(0.3, 0.9), shift=(0.05, 1.0), swing=(0.3, 1.0))
    items = [
        sample_transition(robot, category, np.random.default_rng([10, category, index]), wide if index % 2 else None)
        for index in range(2000)
    ]
    same, close = compare(robot, items)
    assert same >= 0.99 and close >= 0.95
