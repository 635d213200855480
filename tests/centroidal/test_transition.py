"""Motions of single transitions and of standing: known answers, symmetries, and honesty about feasibility."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from toolkit.centroidal.body import BodyMargins, body_residuals
from toolkit.centroidal.build import ProblemConfig, initial_com
from toolkit.centroidal.problem import Margins
from toolkit.centroidal.program import Regularisers
from toolkit.centroidal.residual import check
from toolkit.centroidal.sequence import SequenceConfig, optimise, optimise_transition
from toolkit.centroidal.stages.method import minimise
from toolkit.contacts.category import Category
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose, rotation_on_surface
from toolkit.world.timing import Timing
from validation.random_contacts import TransitionSample, sample_transition, sample_walk

MIRROR = np.diag([1.0, -1.0, 1.0])
TIMING = Timing(1.0, 1.0)


def solve(robot, sample, **options):
    return optimise_transition(robot, sample.stance, sample.com, sample.com_velocity, sample.transition, **options)


def samples(robot, count, seed):
    """`count` random transitions of each category."""
    return [
        sample_transition(robot, category, np.random.default_rng([seed, category, index]))
        for category in Category
        for index in range(count)
    ]


def with_problem(**changes):
    """The default settings with another problem."""
    config = SequenceConfig()
    return replace(config, problem=replace(config.problem, **changes))


def stand(robot, stance, seconds=2.0, config=None):
    """The motion of standing still."""
    schedule = ContactSchedule.of(ContactSequence(stance, ()), final_rest=seconds)
    return optimise(robot, schedule, initial_com(robot, stance), np.zeros(3), config=config or SequenceConfig())


def step(x, *, yaw=0.0, friction=0.5, timing=TIMING):
    """A step of the left foot."""
    contact = Contact(Limb.LEFT_FOOT, Pose.from_yaw(np.array([x, 0.1, 0.0]), yaw), friction)
    return ContactTransition(Limb.LEFT_FOOT, contact, timing)


def moved(sample, motion):
    """The sample carried along by a rigid motion (a yaw and a translation)."""

    def carry(contact):
        return Contact(contact.limb, motion @ contact.pose, contact.friction)

    transition = sample.transition
    contact = None if transition.contact is None else carry(transition.contact)
    return TransitionSample(
        Stance(tuple(carry(contact) for contact in sample.stance.contacts)),
        motion @ sample.com,
        motion.rotation @ sample.com_velocity,
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


def test_standing_feet_share_the_weight(robot, feet):
    motion = stand(robot, feet)
    assert motion.feasible and motion.kept is None
    np.testing.assert_allclose(motion.force[:, :2, 2], robot.mass * 9.81 / 2, rtol=1e-3)
    np.testing.assert_allclose(motion.com, np.tile(motion.com[0], (len(motion.com), 1)), atol=1e-3)
    np.testing.assert_allclose(motion.objective, 10 * 2 * 0.01 / 4, rtol=1e-3)  # to the solver's tolerance


def test_a_step_on_a_slope_beyond_the_friction_angle_is_refused(robot):
    """30 degrees at mu 0.5, at rest in the end: otherwise the CoM may slide downhill within the final box."""
    rotation = rotation_on_surface(np.array([np.sin(np.pi / 6), 0.0, np.cos(np.pi / 6)]), 0.0)
    for friction, holds in ((0.5, False), (0.62, True)):
        poses = {foot: Pose(rotation, np.array([0.0, robot.legs[foot].hip_in_com[1], 0.0])) for foot in FEET}
        stance = Stance(tuple(Contact(foot, pose, friction) for foot, pose in poses.items()))
        ahead = Pose(rotation, poses[Limb.LEFT_FOOT] @ np.array([0.1, 0.0, 0.0]))
        transition = ContactTransition(Limb.LEFT_FOOT, Contact(Limb.LEFT_FOOT, ahead, friction))
        given = robot, stance, initial_com(robot, stance), np.zeros(3), transition
        motion = optimise_transition(*given, final_at_rest=True)
        assert motion.feasible == holds, motion.outcome
        assert holds or "infeasible: friction of" in motion.outcome


def test_ice_does_not_stop_a_moving_com(robot, feet):
    for friction, holds in ((0.005, False), (0.8, True)):
        stance = Stance(tuple(replace(item, friction=friction) for item in feet.contacts))
        given = initial_com(robot, stance), np.array([0.0, 0.6, 0.0]), step(0.2, friction=friction)
        assert optimise_transition(robot, stance, *given).feasible == holds


def test_a_contact_out_of_reach_is_infeasible(robot, feet):
    com = initial_com(robot, feet)
    motion = optimise_transition(robot, feet, com, np.zeros(3), step(1.6))
    assert not motion.feasible and motion.failure is not None and "leg length" in motion.failure.reason
    motion = optimise_transition(robot, feet, com + [0.0, 0.0, 0.2], np.zeros(3), step(0.2))
    assert not motion.feasible and motion.failure is not None and "leg length" in motion.failure.reason
    assert motion.failure.knot == 0


def test_too_weak_a_limb_cannot_carry_the_weight(robot, feet):
    weak = with_problem(max_normal_force=0.9)
    assert stand(robot, feet, config=weak).feasible
    given = robot, feet, initial_com(robot, feet), np.zeros(3), step(0.2, timing=Timing(1.0, 3.0))
    assert not optimise_transition(*given, config=weak, final_at_rest=True).feasible
    assert optimise_transition(*given, final_at_rest=True).feasible


def test_without_a_force_bound(robot, feet):
    assert stand(robot, feet, config=with_problem(max_normal_force=np.inf)).feasible


def test_too_weak_a_knee_cannot_carry_the_weight(robot, feet):
    """A bent knee takes a torque; the same step is possible with a stronger one."""
    com = initial_com(robot, feet) - [0.0, 0.0, 0.1]
    for torque, holds in ((20.0, False), (1000.0, True)):
        legs = {foot: replace(leg, torques=dict.fromkeys(leg.torques, torque)) for foot, leg in robot.legs.items()}
        motion = optimise_transition(replace(robot, legs=legs), feet, com, np.zeros(3), step(0.1))
        assert motion.feasible == holds
        assert holds or (motion.failure is not None and "torque" in motion.failure.reason)


def alike(here, there, com):
    """Two solutions of one problem: rounding differs, and with it the iteration that first meets the tolerance."""
    assert here.feasible == there.feasible
    if here.feasible:
        np.testing.assert_allclose(there.objective, here.objective, rtol=1e-3)
        if here.iterations == there.iterations:
            np.testing.assert_allclose(com, here.com, atol=1e-3)


def test_the_place_and_heading_of_the_world_do_not_matter(robot):
    carry = Pose.from_yaw(np.array([40.0, -25.0, 3.0]), 2.1)
    for sample in samples(robot, 1, seed=3):
        there = solve(robot, moved(sample, carry))
        alike(solve(robot, sample), there, (there.com - carry.position) @ carry.rotation)


def test_left_and_right_are_alike(robot):
    for sample in samples(robot, 1, seed=4):
        there = solve(robot, mirrored(sample))
        alike(solve(robot, sample), there, there.com @ MIRROR)


def test_heavier_robots_move_the_same_way_under_scaled_weights(robot, feet):
    """With only the terms that scale alike, the motion does not depend on the mass."""
    weights = replace(SequenceConfig().problem.weights, force=0.0, lateral_force=0.0, cop=0.0)
    only = Regularisers(*[0.0] * 9, slack=3000.0)
    config = SequenceConfig(ProblemConfig(weights=weights, min_dt=0.02), BodyMargins(), only)
    motions = [
        optimise_transition(item, feet, initial_com(item, feet), np.array([0.2, 0.1, 0.0]), step(0.3), config=config)
        for item in (robot, replace(robot, mass=2 * robot.mass))
    ]
    assert all(motion.feasible for motion in motions)
    np.testing.assert_allclose(motions[1].com, motions[0].com, atol=2e-3)
    np.testing.assert_allclose(motions[1].objective, 4 * motions[0].objective, rtol=1e-3)


def test_solutions_are_confirmed_and_reproducible(robot):
    found = 0
    for sample in samples(robot, 2, seed=5):
        first, second = solve(robot, sample), solve(robot, sample)
        np.testing.assert_array_equal(first.force, second.force)
        assert first.feasible == (first.failure is None)
        if first.feasible:
            found += 1
            assert check(first).largest < 1e-6 and body_residuals(first, robot).largest < 1e-5
    assert found >= 5


def test_margins_are_kept_where_that_is_possible(robot, feet):
    margins = Margins(friction=0.66, cop=(0.055, 0.045), yaw=0.7)
    transition = step(0.3, yaw=0.2, timing=Timing(0.2, 0.5))
    given = robot, feet, initial_com(robot, feet), np.zeros(3), transition
    motion = optimise_transition(*given, config=with_problem(margins=margins))
    assert motion.feasible and motion.kept is None and motion.solved.margins == margins
    assert np.abs(motion.cop[:, 1, 0]).max() <= 0.055 + 1e-6
    lateral = np.hypot(motion.force[:, :2, 0], motion.force[:, :2, 1])
    assert (lateral - 0.66 * 0.5 * motion.force[:, :2, 2]).max() < 1e-6 * robot.mass * 9.81


def test_arrays_of_any_kind_are_taken(robot):
    """Nothing is compiled anew for another kind of array, and nothing is written back."""
    sample = samples(robot, 1, seed=6)[0]
    expected = solve(robot, sample)

    def odd(contact):
        pose = Pose(np.asfortranarray(contact.pose.rotation), contact.pose.position[::-1].copy()[::-1])
        pose.position.setflags(write=False)
        return Contact(contact.limb, pose, np.float64(contact.friction))

    stance = Stance(tuple(odd(contact) for contact in sample.stance.contacts))
    timing = Timing(np.float64(sample.transition.timing.shift), np.float64(sample.transition.timing.swing))
    transition = ContactTransition(sample.transition.limb, odd(sample.transition.contact), timing)
    com, velocity = sample.com.tolist(), sample.com_velocity.copy()
    velocity.setflags(write=False)
    before = len(minimise.signatures)
    found = optimise_transition(robot, stance, com, velocity, transition, final_at_rest=np.False_)
    assert len(minimise.signatures) == before
    np.testing.assert_array_equal(found.force, expected.force)


def test_threads_give_the_same_answers(robot):
    items = samples(robot, 1, seed=7)
    alone = [solve(robot, item) for item in items]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda item: solve(robot, item), items))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.force, other.force)


def test_motions_travel_between_processes(robot):
    motion = solve(robot, samples(robot, 1, seed=8)[0])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(motion)).com, motion.com)


@pytest.mark.parametrize("timing", [Timing(1.0, 1.0), Timing(0.1, 0.4)])
def test_walks_are_solved(robot, timing):
    sequence = sample_walk(robot, 20, np.random.default_rng(0), timing=timing)
    schedule = ContactSchedule.of(sequence, initial_rest=0.5, final_rest=1.0)
    motion = optimise(robot, schedule, initial_com(robot, sequence.start), np.zeros(3))
    assert motion.feasible, motion.outcome
    assert motion.iterations < 60
    np.testing.assert_allclose(motion.linear_momentum[-1], 0.0, atol=1e-4)
