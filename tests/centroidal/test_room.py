"""The room that the world leaves to the CoM: kept by the solver and by Ipopt, and checked without either."""

from dataclasses import replace

import numpy as np
import pytest

from tests.centroidal.walks import walk
from tests.shipped_robots import OWN
from toolkit.centroidal.body import body_residuals
from toolkit.centroidal.build import initial_com
from toolkit.centroidal.problem import ComRoom
from toolkit.centroidal.program import Program
from toolkit.centroidal.sequence import SequenceConfig, guess, optimise
from toolkit.geometry.limb import Limb
from toolkit.physics.leg import leg_posture
from toolkit.robot.loader import load_robot
from validation.reference.sequence import solve

CONFIG = SequenceConfig()


@pytest.fixture(scope="module", params=OWN)
def walker(request):
    return load_robot(request.param)


class Passage:
    """Between two x in m, the CoM is lowered by `sink` m and stays within `aside` m of the middle in y."""

    def __init__(self, robot, low, high, sink, aside=np.inf):
        self.height, self.low, self.high, self.depth, self.aside = robot.com_height, low, high, sink, aside

    def sink(self, stance):
        return self.depth * (self.low <= stance.mean_feet.position[0] <= self.high)

    def room(self, problem):
        x = guess_of(problem)
        inside = np.flatnonzero((x >= self.low) & (x <= self.high))
        sink = np.zeros(problem.steps + 1)
        sink[inside] = self.depth
        rows = [([0.0, 0.0, 1.0], self.height - self.depth)]
        if np.isfinite(self.aside):
            rows += [([0.0, 1.0, 0.0], self.aside), ([0.0, -1.0, 0.0], self.aside)]
        normals, bounds = (np.array(part) for part in zip(*rows, strict=True))
        count = len(inside)
        return ComRoom(sink, np.tile(inside, len(rows)), normals.repeat(count, 0), bounds.repeat(count))

    def leans(self, problem):
        return None


class Risers:
    """The shin over the third foot in contact may lean by `lean` rad at most."""

    def __init__(self, lean):
        self.lean = lean

    def sink(self, stance):
        return 0.0

    def room(self, problem):
        return None

    def leans(self, problem):
        leans = np.full((problem.steps, 2), np.inf)
        leans[on_third(problem), 0] = self.lean
        return leans


def on_third(problem):
    """(k,) int; steps in which the left foot stands where it lands first."""
    places = problem.position[:, 0, 0]
    return np.flatnonzero(problem.active[:, 0] & (places == np.unique(places)[1]))


def greatest_lean(robot, motion):
    """Greatest lean in rad of the shin over that foot at the knots after the steps in which it stands."""
    p, step = motion.problem, on_third(motion.problem)
    place = motion.com[step + 1], p.yaw[step + 1], p.position[step, 0], p.rotation[step, 0]
    return float(-leg_posture(robot.legs[Limb.LEFT_FOOT], *place).ankle_pitch.min())


def guess_of(problem):
    """(N + 1,) m; where the feet are along x."""
    step = np.minimum(np.arange(problem.steps + 1), problem.steps - 1)
    return problem.position[step, :2, 0].mean(1)


def motions(robot, surroundings):
    """The motion of a walk of six steps, with these surroundings."""
    start, schedule = walk(robot, 6, 0.3, (0.6, 0.8))
    com = initial_com(robot, start)
    if surroundings is not None:
        com[2] -= surroundings.sink(start)
    return optimise(robot, schedule, com, np.zeros(3), surroundings=surroundings)


def test_a_walk_sinks_below_a_ceiling_and_rises_again(walker):
    ceiling = Passage(walker, 0.3, 0.8, 0.15)
    motion = motions(walker, ceiling)
    assert motion.feasible, motion.outcome
    room = motion.problem.room
    assert room is not None and len(room.knot) > 5
    assert room.excess(motion.com).max() < 1e-6
    height = motion.com[:, 2] / walker.com_height
    assert height[0] == 1.0 and height[-1] > 0.95 and 0.7 < height.min() < 0.86


@pytest.mark.parametrize("where", [-1.0, 1.0])
def test_a_walk_begins_or_ends_below_a_ceiling(walker, where):
    ceiling = Passage(walker, *sorted((where * 10.0, 0.5)), 0.2)
    motion = motions(walker, ceiling)
    assert motion.feasible, motion.outcome
    low = motion.com[0 if where < 0.0 else -1, 2]
    assert low <= 0.81 * walker.com_height + 1e-6
    assert motion.problem.room is not None and motion.problem.room.excess(motion.com).max() < 1e-6


def test_walls_hold_the_com_between_them(walker):
    free = motions(walker, None)
    sway = np.abs(free.com[:, 1]).max()
    held = motions(walker, Passage(walker, 0.2, 0.9, 0.0, aside=0.7 * sway))
    assert held.feasible, held.outcome
    assert held.problem.room is not None and held.problem.room.excess(held.com).max() < 1e-6


def test_surroundings_without_limits_change_nothing(walker):
    class Open:
        def sink(self, stance):
            return 0.0

        def room(self, problem):
            return None

        def leans(self, problem):
            return None

    one, other = motions(walker, None), motions(walker, Open())
    np.testing.assert_array_equal(one.com, other.com)


def test_leaving_the_room_is_a_violation_at_its_knot(walker):
    motion = motions(walker, Passage(walker, 0.3, 0.8, 0.1))
    room = motion.problem.room
    assert room is not None
    lower = replace(room, bound=room.bound - np.where(room.knot == room.knot[2], 0.5, 0.0))
    strict = replace(motion, problem=replace(motion.problem, room=lower))
    residuals = body_residuals(strict, walker)
    name, knot, _ = residuals.worst
    assert (name, knot) == ("room of the body", room.knot[2])
    assert residuals.largest > 0.4


def test_more_than_the_legs_can_do_is_refused(walker):
    motion = motions(walker, Passage(walker, 0.3, 0.8, 0.6 * walker.com_height))
    assert not motion.feasible and motion.failure is not None


def test_solver_and_reference_agree_on_a_room(walker):
    motion = motions(walker, Passage(walker, 0.3, 0.8, 0.12, aside=0.08))
    program = Program(motion.problem, walker, CONFIG.body, CONFIG.regularisers)
    theirs = solve(program, guess(program))
    assert motion.feasible and theirs.feasible, (motion.outcome, theirs.outcome)
    np.testing.assert_allclose(motion.objective, theirs.objective, rtol=1e-2)
    assert motion.problem.room is not None and motion.problem.room.excess(theirs.com).max() < 1e-6


def test_shins_lean_no_farther_than_what_stands_before_the_feet_lets_them(walker):
    free = motions(walker, None)
    most = greatest_lean(walker, free)
    held = motions(walker, Risers(most - 0.1))
    assert free.feasible and held.feasible, held.outcome
    assert greatest_lean(walker, held) <= most - 0.1 + 1e-6
    residuals = body_residuals(replace(free, problem=held.problem), walker)
    assert residuals.worst[0] == "room of the shin" and residuals.worst[2] == Limb.LEFT_FOOT
    assert residuals.largest == pytest.approx(0.1, abs=1e-6)


def test_solver_and_reference_agree_on_the_room_of_shins(walker):
    most = greatest_lean(walker, motions(walker, None))
    motion = motions(walker, Risers(most - 0.1))
    program = Program(motion.problem, walker, CONFIG.body, CONFIG.regularisers)
    theirs = solve(program, guess(program))
    assert motion.feasible and theirs.feasible, (motion.outcome, theirs.outcome)
    np.testing.assert_allclose(motion.objective, theirs.objective, rtol=1e-2)
