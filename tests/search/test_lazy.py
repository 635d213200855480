"""Transitions that are judged only when they are the best to go on with."""

from dataclasses import replace

import numpy as np

from tests.search.worlds import FLOOR, box, make_world
from toolkit.contacts.projected import Projected
from toolkit.geometry.limb import Limb
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.moves.candidates import Candidates, mean_feet
from toolkit.search.moves.drift import Drift
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.search.states.state import (
    COM,
    CONTACTS,
    LAST,
    OLD,
    TIMING,
    VELOCITY,
    is_pending,
    pack,
    pack_pending,
    unpack,
)
from toolkit.world.timing import Timing

ENDLESS = PlannerConfig(search=AnaStarConfig(epsilon=0.1, max_expansions=30))


class Counting(KinematicEvaluator):
    """Counts what it is asked."""

    asked = 0

    def evaluate(self, stance, com, com_velocity, transitions):
        self.asked += len(transitions)
        return super().evaluate(stance, com, com_velocity, transitions)


class Costly(Counting):
    """The same, asked one by one."""

    costly = True


def test_pending_states_keep_both_ends_of_a_transition():
    before = unpack(pack(np.array([[3, 5, -1, 8]]), np.array([0]), np.array([[0.1, -0.2, 0.9]]), np.ones((1, 3))))[0]
    after = np.array([[3, 6, -1, 8], [3, 5, -1, -1]])
    states = pack_pending(before, after, np.array([Limb.RIGHT_FOOT, Limb.RIGHT_PALM]), np.array([0, 2]))
    assert all(is_pending(state) for state in states) and not is_pending(before.tobytes())
    rows = unpack(states)
    np.testing.assert_array_equal(rows[:, CONTACTS], after)
    np.testing.assert_array_equal(rows[:, LAST], [1, 3])
    np.testing.assert_array_equal(rows[:, OLD], [5, 8])
    np.testing.assert_array_equal(rows[:, TIMING], [0, 2])
    np.testing.assert_array_equal(rows[:, COM], np.tile(before[COM], (2, 1)))
    np.testing.assert_array_equal(rows[:, VELOCITY], np.tile(before[VELOCITY], (2, 1)))


def test_fewer_judgements_until_the_first_plan_of_the_same_graph(robot):
    world = make_world(FLOOR, goal=(1.2, 0, 0))
    found, asked = {}, {}
    for kind in (Counting, Costly):
        evaluator, first = kind(robot), []

        def note(progress, evaluator=evaluator, first=first):
            if progress.cost < np.inf and not first:
                first.append(evaluator.asked)

        result = ContactPlanner(robot, world, evaluator, ENDLESS).search(np.random.default_rng(0), 600.0, note)
        assert result.solutions
        found[kind], asked[kind] = result.solutions, first[0]
        for solution in result.solutions:  # costs and predictions are those of the transitions alone
            sequence = solution.sequence
            stances = sequence.stances
            assert len(solution.objective) == len(sequence.transitions) == len(solution.com) - 1
            cost = CostConfig().time * sequence.duration
            for index, (before, transition) in enumerate(zip(stances, sequence.transitions, strict=False)):
                batch = evaluator.evaluate(before, solution.com[index], np.zeros(3), [transition])
                np.testing.assert_allclose(batch.com[0], solution.com[index + 1], atol=6e-4)  # rounded to 1 mm
                way = np.hypot(*(stances[index + 1].mean_feet.position - before.mean_feet.position)[:2])
                cost += way + 3.0 + 0.1 * batch.objective[0]
            heading = stances[-1].mean_feet.rotation[:, 0]
            ahead = (stances[-1][Limb.LEFT_FOOT].pose.position - stances[-1][Limb.RIGHT_FOOT].pose.position) @ heading
            np.testing.assert_allclose(solution.cost, cost + 5.0 * abs(ahead), atol=1e-6)
    assert asked[Costly] < asked[Counting] / 1.5


def test_same_seed_same_plan(robot):
    world = make_world(FLOOR, goal=(1.0, 0, 0))
    one, other = (
        ContactPlanner(robot, world, Costly(robot), ENDLESS).search(np.random.default_rng(3), 600.0) for _ in range(2)
    )
    np.testing.assert_array_equal(one.expanded, other.expanded)
    assert [solution.cost for solution in one.solutions] == [solution.cost for solution in other.solutions]


def standing(robot, mjcf, timings):
    """Drift in a world, its table, and the numbers of the feet side by side at the start."""
    planner = ContactPlanner(robot, make_world(mjcf, goal=(0.6, 0, 0)), KinematicEvaluator(robot))
    table = planner.ground.moves().table
    numbers = np.array([*(table.add_contact(c) for c in planner.ground.start_stance().contacts), -1, -1])
    return Drift(robot, table, timings), table, numbers


def steps(table, contacts, offsets, timing=0):
    """Candidates that move the left foot by offsets (n, 2) from where it is."""
    n = len(offsets)
    position = np.tile(table.position[contacts[0]], (n, 1))
    position[:, :2] += offsets
    rotation = np.tile(table.rotation[contacts[0]], (n, 1, 1))
    number = table.add(Limb.LEFT_FOOT, Projected(np.zeros(n, int), position, rotation))
    after = np.tile(contacts, (n, 1))
    after[:, 0] = number
    centre, yaw = mean_feet(table, after)
    return Candidates(np.zeros(n, int), number, after, centre, yaw, np.zeros(n), np.zeros(n), np.full(n, timing))


def test_drift_expects_quick_feet_under_the_com(robot):
    drift, table, contacts = standing(robot, FLOOR, (Timing(0.05, 0.35), Timing(1.0, 1.0)))
    com = mean_feet(table, contacts[None])[0][0] + [0.0, 0.0, robot.com_height]
    at = np.array([[0.0, 0.0], [0.3, 0.0], [0.6, 0.0], [1.2, 0.0]])
    still = drift.miss(contacts, com, np.zeros(3), steps(table, contacts, at))
    assert still[0] < 0.03 and (np.diff(still) > 0).all() and still[3] > 0.2
    fast = drift.miss(contacts, com, np.array([1.2, 0.0, 0.0]), steps(table, contacts, at))
    assert fast[3] < 0.15 < fast[0]
    slow = drift.miss(contacts, com, np.array([0.2, 0.0, 0.0]), steps(table, contacts, at[:3], timing=1))
    assert (slow < 0.03).all()


def test_drift_knows_that_nothing_stands_slowly_on_steep_ground(robot):
    times = (Timing(0.05, 0.35), Timing(1.0, 1.0))
    for angle, slides in ((20, False), (30, True)):
        slope = box([0, 0, 0], [3, 3, 0.05], (0, angle, 0), friction=0.5)
        drift, table, contacts = standing(robot, slope, times)
        downhill, gain = table.slide(contacts[:2])
        np.testing.assert_allclose(downhill[0], [1, 0], atol=1e-6)
        sine, cosine = np.sin(np.radians(angle)), np.cos(np.radians(angle))
        np.testing.assert_allclose(gain, max(9.81 * (sine - 0.5 * cosine) * cosine, 0.0), atol=1e-5)  # file's digits
        com = mean_feet(table, contacts[None])[0][0] + [0.0, 0.0, robot.com_height]
        quick, slow = (
            drift.miss(contacts, com, np.zeros(3), steps(table, contacts, np.array([[0.2, 0.0]]), timing))[0]
            for timing in (0, 1)
        )
        assert (slow > 0.5) == slides and quick < 0.1


def test_a_plan_by_guesses_comes_with_a_warning(robot):
    class Trained(Counting):
        """Knows what swings for 0.5 s or more, as networks do."""

        def evaluate(self, stance, com, com_velocity, transitions):
            batch = super().evaluate(stance, com, com_velocity, transitions)
            return replace(batch, untrained=sum(item.timing.swing < 0.5 for item in transitions))

    for timing, strange in (("0.3 0.6", False), ("0.3 0.4", True)):
        world = make_world(FLOOR, goal=(0.6, 0, 0), timing=timing)
        result = ContactPlanner(robot, world, Trained(robot), ENDLESS).search(np.random.default_rng(0), 600.0)
        assert result.solutions
        assert ("below what the networks were trained for" in result.warning) == strange
