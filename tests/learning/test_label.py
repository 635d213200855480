"""Labels of whole sequences, the judge of single transitions, and sequences made of others."""

from dataclasses import replace

import numpy as np
import pytest

from tests.centroidal.walks import foot
from toolkit.centroidal.build import initial_com
from toolkit.centroidal.sequence import optimise
from toolkit.contacts.category import Category, category_of
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.learning.boundary import at_boundary
from toolkit.learning.feasible import transition_feasible
from toolkit.learning.label import FINAL_REST, INITIAL_REST, label, sample_of
from toolkit.learning.quota import Quota
from toolkit.learning.scout import Scout
from toolkit.learning.variants import part_of, timed, with_palms
from toolkit.pipeline.config import PipelineConfig
from toolkit.prediction.features import encode
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.robot.loader import load_robot
from toolkit.world.timing import Timing

TIMING = Timing(0.6, 0.8)


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


@pytest.fixture(scope="module")
def walk(robot):
    """Four steps ahead."""
    start = Stance(tuple(foot(robot, limb, 0.0) for limb in FEET))
    places = [0.2, 0.4, 0.6, 0.6]
    steps = (ContactTransition(Limb(i % 2), foot(robot, Limb(i % 2), x), TIMING) for i, x in enumerate(places))
    return ContactSequence(start, tuple(steps))


@pytest.fixture(scope="module")
def labelled(robot, walk):
    found = label(robot, walk)
    assert found is not None
    return found


def test_labels_are_those_of_the_executed_motion(robot, walk, labelled):
    config = PipelineConfig()
    assert (INITIAL_REST, FINAL_REST) == (config.initial_rest, config.final_rest)
    schedule = ContactSchedule.of(walk, initial_rest=config.initial_rest, final_rest=config.final_rest)
    motion = optimise(robot, schedule, initial_com(robot, walk.start), np.zeros(3), config=config.sequence)
    objectives = [labelled.outcome(index)[0] for index in range(4)]
    assert min(objectives) > 0.0
    assert sum(objectives) == pytest.approx(motion.objective, rel=1e-9)
    # One transition begins where the one before it ended.
    for index in range(3):
        _, com, velocity = labelled.outcome(index)
        problem = labelled.problem(index + 1)
        np.testing.assert_array_equal(problem.com, com)
        np.testing.assert_array_equal(problem.com_velocity, velocity)
    np.testing.assert_allclose(labelled.problem(0).com, initial_com(robot, walk.start), atol=1e-12)


def test_a_sequence_without_a_motion_has_no_label(robot, walk):
    far = replace(walk.transitions[0], contact=foot(robot, Limb.LEFT_FOOT, 1.6))
    assert label(robot, ContactSequence(walk.start, (far, *walk.transitions[1:]))) is None
    assert label(robot, ContactSequence(walk.start, ())) is None


def test_a_sample_has_the_outcome_in_the_frame_of_its_features(robot, labelled):
    problem, outcome = labelled.problem(1), labelled.outcome(1)
    category, sample = sample_of(problem, True, outcome, labelled.goal, 17)
    assert category == Category.MOVE_FOOT and sample.world.tolist() == [17] and sample.known.all()
    frame, features = encode(problem.stance, problem.com, problem.com_velocity, [problem.transition])
    assert frame.mirrored
    np.testing.assert_allclose(sample.features, features, atol=1e-6)
    np.testing.assert_allclose(frame.point_back(sample.targets[0, 1:4]), outcome[1], atol=1e-6)
    np.testing.assert_allclose(frame.vector_back(sample.targets[0, 4:7]), outcome[2], atol=1e-6)
    np.testing.assert_allclose(frame.point_back(sample.goal[0]), labelled.goal, atol=1e-6)
    _, judged = sample_of(problem, False, None, labelled.goal, 17)
    assert not judged.known.any() and not judged.feasible.any()


def test_transitions_of_feasible_sequences_are_feasible(labelled):
    for index in range(4):
        assert transition_feasible(labelled.problem(index))


@pytest.mark.parametrize(
    "change",
    [
        lambda p: replace(p, com=p.com + [0.0, 0.0, 0.3]),  # legs too short at the start
        lambda p: replace(p, com=p.com - [0.0, 0.0, 0.45]),  # too low
        lambda p: replace(p, com_velocity=p.com_velocity + [0.0, 2.5, 0.0]),  # it would tip over
        lambda p: replace(p, transition=moved(p.transition, [1.2, 0.0, 0.0])),
        lambda p: replace(p, transition=moved(p.transition, [0.0, 0.0, 0.7])),
    ],
)
def test_what_no_motion_can_do_is_infeasible(labelled, change):
    assert not transition_feasible(change(labelled.problem(1)))


def moved(transition, way):
    contact = transition.contact
    pose = Pose(contact.pose.rotation, contact.pose.position + way)
    return replace(transition, contact=replace(contact, pose=pose))


def test_a_palm_out_of_reach_is_infeasible(robot, labelled):
    problem = labelled.problem(1)
    arm = robot.arms[Limb.LEFT_PALM]
    normal = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # z points back at the robot
    for part, feasible in ((0.8, True), (1.3, False)):
        place = problem.com + arm.shoulder_in_com + [0.0, part * arm.max_reach, 0.0]
        palm = ContactTransition(Limb.LEFT_PALM, Contact(Limb.LEFT_PALM, Pose(normal, place), 0.7), TIMING)
        assert transition_feasible(replace(problem, transition=palm)) == feasible


def test_both_sides_of_the_boundary_are_found(labelled):
    rng = np.random.default_rng(0)
    found = [item for _ in range(6) for item in at_boundary(labelled.problem(1), rng)]
    judged = [feasible for _, feasible in found]
    assert judged.count(False) >= 4 and judged.count(True) >= 3
    for problem, feasible in found:
        assert transition_feasible(problem) == feasible
    same = [item for _ in range(6) for item in at_boundary(labelled.problem(1), np.random.default_rng(0))][:2]
    np.testing.assert_array_equal(same[0][0].com, found[0][0].com)


def test_parts_and_timings_of_a_sequence(walk):
    rng = np.random.default_rng(1)
    timings = [Timing(0.3, 0.5), Timing(1.0, 1.0)]
    for _ in range(20):
        part = part_of(walk, rng)
        assert 2 <= len(part.transitions) <= 4
        first = next(row for row, item in enumerate(walk.transitions) if item is part.transitions[0])
        assert all(item is walk.transitions[first + row] for row, item in enumerate(part.transitions))
        assert part.start.limbs == walk.start.limbs
        for mine, original in zip(part.start.contacts, walk.stances[first].contacts, strict=True):
            np.testing.assert_array_equal(mine.pose.position, original.pose.position)
        other = timed(walk, timings, rng)
        assert all(a.contact is b.contact for a, b in zip(other.transitions, walk.transitions, strict=True))
        assert {item.timing for item in other.transitions} <= set(timings)


def test_palms_touch_and_let_go_between_steps(robot, walk):
    """Both palms on walls, at every stance, where the search would have put them."""
    scout = Scout(KinematicEvaluator(robot), np.ones(len(Category)), 0.0, np.random.default_rng(0))
    for stance in walk.stances:
        com = initial_com(robot, stance)
        palms = []
        for limb, side in ((Limb.LEFT_PALM, 1.0), (Limb.RIGHT_PALM, -1.0)):
            inwards = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -side], [0.0, side, 0.0]])
            place = com + robot.arms[limb].shoulder_in_com + [0.1, side * 0.8 * robot.arms[limb].max_reach, 0.0]
            palms.append(ContactTransition(limb, Contact(limb, Pose(inwards, place), 0.7), TIMING))
        scout.evaluate(stance, com, np.zeros(3), palms)
        assert [item.limb for item in scout.touched(stance, Limb.LEFT_PALM)] == [Limb.LEFT_PALM]
    quota, rng, seen = Quota(1, list(Category)), np.random.default_rng(2), set()
    for _ in range(60):
        sequence = with_palms(robot, walk, scout, quota, rng)
        steps = [item for item in sequence.transitions if item.limb.is_foot]
        assert all(a is b for a, b in zip(steps, walk.transitions, strict=True))
        for stance, item, after in zip(sequence.stances, sequence.transitions, sequence.transitions[1:], strict=False):
            seen.add(category_of(stance, item))
            assert item.limb != after.limb or item.limb.is_foot or after.contact is None
    assert seen == set(Category)
