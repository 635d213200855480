import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.search.worlds import FLOOR, box, corridor, make_world
from toolkit.centroidal.build import initial_com
from toolkit.contacts.category import Category, category_of
from toolkit.contacts.failure import Failure
from toolkit.errors import InputError, PlanningError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import rotation_about_z
from toolkit.physics.leg import PLANNED, ReachMargins, leg_clearances
from toolkit.prediction.kinematic import KinematicConfig, KinematicEvaluator
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig, backwards
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.world.timing import Timing

QUICK = PlannerConfig(search=AnaStarConfig(max_expansions=150))


def plan(robot, world, config=QUICK, seed=0, kinematic=None, limit=600.0):
    planner = ContactPlanner(robot, world, KinematicEvaluator(robot, kinematic), config)
    return planner.search(np.random.default_rng(seed), limit)


def check(robot, world, result, price=CostConfig.time):
    """What must hold for every solution, recomputed from the sequence alone, at a price per second."""
    assert result.solutions and result.reason == ""
    half = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    for solution in result.solutions:
        stances = solution.sequence.stances
        moved = [transition.limb for transition in solution.sequence.transitions]
        assert all(a != b for a, b in zip(moved, moved[1:], strict=False))
        final = stances[-1].mean_feet.position
        assert np.linalg.norm(final[:2] - world.goal.position[:2]) <= world.goal.radius + 1e-9
        assert solution.com.shape == solution.com_velocity.shape == (len(stances), 3)
        cost = price * solution.sequence.duration
        for before, after, objective in zip(stances[:-1], stances[1:], solution.objective, strict=True):
            x, y = (after.mean_feet.position - before.mean_feet.position)[:2]
            d, back = np.hypot(x, y), backwards(np.arctan2(y, x) - after.mean_feet.yaw)
            cost += d + 3.0 + 0.1 * objective + CostConfig.heading * d * back
        heading = stances[-1].mean_feet.rotation[:, 0]
        left, right = (stances[-1][limb].pose.position for limb in FEET)
        assert solution.cost == pytest.approx(cost + 5.0 * abs((left - right) @ heading), abs=1e-6)
        for stance in stances:
            for contact in stance.contacts:
                surface = world.surfaces[contact.surface]
                corners = contact.pose @ np.column_stack([half * robot.half_sizes[contact.limb], np.zeros(4)])
                local = surface.pose.inverse() @ corners
                np.testing.assert_allclose(local[:, 2], 0.0, atol=1e-6)
                np.testing.assert_allclose(contact.pose.normal, surface.normal, atol=1e-9)
                assert all(inside(point, surface.boundary) for point in local[:, :2])
    costs = [solution.cost for solution in result.solutions]
    assert costs == sorted(set(costs), reverse=True)


def inside(point, rings):
    """Even-odd rule over all rings."""
    odd = False
    for ring in rings:
        for (ax, ay), (bx, by) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            if (ay > point[1]) != (by > point[1]):
                odd ^= point[0] < ax + (point[1] - ay) / (by - ay) * (bx - ax)
    return odd


def test_walks_on_flat_ground(robot):
    world = make_world(FLOOR)
    result = plan(robot, world)
    check(robot, world, result)
    last = result.solutions[-1].sequence
    limbs = [transition.limb for transition in last.transitions]
    assert set(limbs) == set(FEET) and len(limbs) <= 8
    assert all(abs(stance[limb].pose.yaw) < 0.6 for stance in last.stances for limb in FEET)


@pytest.mark.parametrize(("x", "turns"), [(-5.0, True), (-0.5, False)])
def test_robots_turn_to_goals_far_behind_them(robot, x, turns):
    world = make_world(box([-2.0, 0, -0.05], [4.0, 2.0, 0.05]), goal=(x, 0, 0))
    result = plan(robot, world)
    check(robot, world, result)
    final = result.solutions[-1].sequence.stances[-1].mean_feet
    assert (abs(final.yaw) > 2.0) if turns else (abs(final.yaw) < 0.8)


def test_start_stance_is_the_home_stance(robot):
    world = make_world(FLOOR, start=(0.3, -0.2, 0.1), goal=(1.5, 0, 0))
    stance = ContactPlanner(robot, world, KinematicEvaluator(robot)).ground.start_stance()
    np.testing.assert_allclose(stance.mean_feet.position[1:], [-0.2, 0], atol=1e-6)
    width = stance[Limb.LEFT_FOOT].pose.position[1] - stance[Limb.RIGHT_FOOT].pose.position[1]
    assert 0.1 < width < 0.4


@pytest.mark.parametrize("slope", [0.0, 10.0, 20.0, 26.0])
@pytest.mark.parametrize("heading", range(0, 360, 45))
def test_robots_that_find_a_stance_at_the_start_stand_within_their_limits(robot, slope, heading):
    """Where the ground is steep, or ankles are narrow, the CoM at rest is lower, or over one of the feet."""
    stiff = dict(ankle_roll=(-0.26, 0.26), ankle_pitch=(-0.86, 0.53))
    legs = {
        limb: replace(leg, max_length=leg.max_length - 0.03, ranges=leg.ranges | stiff)
        for limb, leg in robot.legs.items()
    }
    robot, up = replace(robot, legs=legs), np.tan(np.radians(slope))
    ground = f'<geom type="plane" size="0 0 1" euler="0 {-slope} 0" friction="0.9"/>'
    world = make_world(ground, goal=(2.0, 0.0, 2.0 * up), heading=heading)
    try:
        stance = ContactPlanner(robot, world, KinematicEvaluator(robot)).ground.start_stance()
    except PlanningError as error:
        assert slope > 15.0 and "ankle" in str(error)
        return
    com, feet = initial_com(robot, stance), stance.mean_feet
    if slope == 0.0:
        np.testing.assert_array_equal(com, feet.position + [0.0, 0.0, robot.com_height])
    for limb in FEET:
        sole = stance[limb].pose
        posed = com[None], np.array([feet.yaw]), sole.position[None], sole.rotation[None]
        spare = leg_clearances(legs[limb], *posed, ReachMargins(ankle=0.0))
        assert all(spare[limit.name][0] > 0.0 for limit in PLANNED)


def test_a_gap_needs_places_drawn_from_the_ground(robot):
    gap = [box([0, 0, -0.05], [0.5, 0.6, 0.05]), box([1.7, 0, -0.05], [0.7, 0.6, 0.05])]  # 0.5 m wide
    world = make_world(*gap, goal=(1.7, 0, 0))
    check(robot, world, plan(robot, world, PlannerConfig(search=AnaStarConfig(max_expansions=600))))
    with pytest.raises(PlanningError, match=r"made\.xml: nothing leads to the goal at \(1\.7, 0\): .* gap wider than"):
        plan(robot, world, PlannerConfig(drawn=False))


@pytest.mark.parametrize(
    ("geoms", "goal", "message"),
    [
        ([box([0, 0, -0.05], [0.5, 0.5, 0.05]), box([2.5, 0, -0.05], [0.5, 0.5, 0.05])], (2.5, 0), "gap wider"),
        ([box([0, 0, -0.05], [1, 1, 0.05]), box([2, 0, 0.45], [1, 1, 0.05])], (2, 0), "a rise higher"),
        ([FLOOR, box([1.0, 0, 1.3], [0.3, 30, 0.2])], (2, 0), "no room for the body"),
        ([FLOOR, box([1.0, 0, 1.0], [0.05, 30, 1.0])], (2, 0), "no room for the body"),
        ([box([0, 0, -0.05], [1, 1, 0.05])], (2, 0), "no surface within its radius"),
        ([FLOOR, box([1.5, 0, 0.5], [0.5, 0.5, 0.5])], (1.5, 0), "a rise higher"),
    ],
)
def test_unreachable_goals_say_why(robot, geoms, goal, message):
    world = make_world(*geoms, goal=(*goal, 0))
    with pytest.raises(PlanningError, match=f"nothing leads to the goal.*{message}"):
        plan(robot, world)


def test_start_without_room(robot):
    tiny = make_world(box([0, 0, -0.05], [0.12, 0.09, 0.05]), box([1, 0, -0.05], [0.5, 0.5, 0.05]), goal=(1, 0, 0))
    with pytest.raises(PlanningError, match="cannot stand at the start|no room for the (left|right) foot"):
        plan(robot, tiny)
    low = make_world(FLOOR, box([0, 0, 1.3], [0.5, 0.5, 0.1]))
    with pytest.raises(PlanningError, match=r"cannot stand at the start \(body hits the world\)"):
        plan(robot, low)


def test_a_way_around_a_wall(robot):
    wall = box([0.8, -1.0, 1.0], [0.05, 2.0, 1.0])  # free for y > 1
    world = make_world(FLOOR, wall, goal=(1.6, 0, 0))
    result = plan(robot, world, PlannerConfig(search=AnaStarConfig(max_expansions=400)))
    check(robot, world, result)
    assert max(stance.mean_feet.position[1] for stance in result.solutions[-1].sequence.stances) > 1.1


def test_reason_of_failure_names_what_rejected_most(robot):
    steep = make_world(
        box([0, 0, -0.05], [0.5, 0.5, 0.05]),
        *[box([x, 0, -0.05], [0.15, 0.5, 0.05], [0, 25, 0], friction=0.3) for x in (0.7, 1.0, 1.3)],
        box([2.0, 0, -0.05], [0.5, 0.5, 0.05]),
        goal=(2.0, 0, 0),
    )
    config = PlannerConfig(drawn=False, search=AnaStarConfig(max_expansions=200))
    result = plan(robot, steep, config)
    assert not result.solutions
    assert "limit of 200 expansions" in result.reason and "too steep" in result.reason and "\n" not in result.reason
    x, y, z = (float(number) for number in re.search(r"feet at (\S+) (\S+) (\S+) m;", result.reason).groups())
    assert 0.2 < x < 1.5 and abs(y) < 0.5 and abs(z) < 0.3


def test_reason_of_failure_names_what_sequences_lack(robot):
    """Sequences reach the goal, and none has a motion: what rejected single candidates is beside the point."""

    def finish(sequence):
        failure = Failure("infeasible: ankle pitch beyond its limit", transition=1)
        return SimpleNamespace(motion=SimpleNamespace(feasible=False, failure=failure))

    world = make_world(FLOOR, goal=(0.8, 0, 0))
    planner = ContactPlanner(robot, world, KinematicEvaluator(robot), QUICK, finish)
    result = planner.search(np.random.default_rng(0), 600.0)
    assert not result.solutions and "\n" not in result.reason and "rejected" not in result.reason
    assert "the last is infeasible: ankle pitch beyond its limit, with the feet at 0." in result.reason


def test_search_exhausted(robot):
    """A floor barely larger than the stance: few states, the goal out of reach of any."""
    world = make_world(box([0, 0, -0.05], [0.14, 0.19, 0.05]), goal=(0.3, 0, 0), radius=0.1)
    config = PlannerConfig(heuristic="euclidean", drawn=False)
    result = plan(robot, world, config)
    assert result.exhausted and "every stance that can be reached" in result.reason


def test_same_seed_same_plan(robot):
    world = corridor(3)

    def costs(seed):
        result = plan(robot, world, seed=seed)
        return [solution.cost for solution in result.solutions], result.expanded

    first, second, other = costs(5), costs(5), costs(6)
    assert first[0] == second[0]
    np.testing.assert_array_equal(first[1], second[1])
    assert len(first[1]) != len(other[1]) or not np.array_equal(first[1], other[1])


def test_time_limit(robot):
    world = corridor(1)
    result = plan(robot, world, PlannerConfig(), limit=1.0)
    assert result.seconds > 0.0
    assert all(solution.seconds <= result.seconds for solution in result.solutions)


class Recorder(KinematicEvaluator):
    """Notes the category of every transition that it is asked about."""

    def evaluate(self, stance, com, com_velocity, transitions):
        self.seen = getattr(self, "seen", set()) | {category_of(stance, item) for item in transitions}
        return super().evaluate(stance, com, com_velocity, transitions)


def test_all_ten_categories_occur_and_palms_are_chosen_where_they_help(robot):
    world = corridor(2)
    evaluator = Recorder(robot, KinematicConfig(palm_relief=0.3, stride=300.0, spread=50.0))
    free = CostConfig(time=0.0)  # palms cost two transitions, which made-up objectives of steps do not outweigh
    config = PlannerConfig(cost=free, search=AnaStarConfig(epsilon=0.3, max_expansions=400))
    result = ContactPlanner(robot, world, evaluator, config).search(np.random.default_rng(0), 600.0)
    check(robot, world, result, price=0.0)
    assert evaluator.seen == set(Category)
    assert any(stance.palms for stance in result.solutions[-1].sequence.stances)
    for stance in result.solutions[-1].sequence.stances:
        feet = stance.mean_feet
        for palm in stance.palms:
            local = feet.inverse() @ stance[palm].pose.position
            assert local[1] * (1 if palm.is_left else -1) > 0.1
    feet_only = PlannerConfig(palms=False, search=AnaStarConfig(max_expansions=200))
    without = ContactPlanner(robot, world, evaluator, feet_only).search(np.random.default_rng(0), 600.0)
    assert not any(stance.palms for solution in without.solutions for stance in solution.sequence.stances)


def test_held_palms_stay_in_reach_while_the_body_is_over_the_standing_foot(robot, monkeypatch):
    def longest(sway):
        monkeypatch.setattr("toolkit.search.moves.reach_check._ARM_SWAY", sway)
        evaluator = KinematicEvaluator(robot, KinematicConfig(palm_relief=0.3, stride=300.0, spread=50.0))
        config = PlannerConfig(cost=CostConfig(time=0.0), search=AnaStarConfig(max_expansions=300))
        found = ContactPlanner(robot, corridor(2), evaluator, config).search(np.random.default_rng(0), 600.0).solutions
        stretch = []
        for solution in found:
            moves = zip(solution.sequence.transitions, solution.sequence.stances[1:], solution.com[1:], strict=True)
            for transition, stance, com in moves:
                if not transition.limb.is_foot:
                    continue
                over = [*stance[transition.limb.mirrored].pose.position[:2], com[2]]
                turn = rotation_about_z(stance.mean_feet.yaw)
                for palm in stance.palms:
                    arm = robot.arms[palm]
                    away = stance[palm].pose.position - over - turn @ arm.shoulder_in_com
                    stretch.append(np.linalg.norm(away) - arm.max_reach)
        assert stretch
        return max(stretch)

    assert longest(0.02) <= 0.02 + 1e-6 < longest(np.inf)


def test_timing_is_chosen(robot):
    class HurriesAreHard(KinematicEvaluator):
        def evaluate(self, stance, com, com_velocity, transitions):
            batch = super().evaluate(stance, com, com_velocity, transitions)
            fast = np.array([item.timing.swing < 0.6 for item in transitions])
            lands = np.array([item.contact is not None and item.contact.pose.position[0] > 0.8 for item in transitions])
            return type(batch)(batch.feasible & ~(fast & lands), batch.objective, batch.com, batch.com_velocity)

    timings = (Timing(0.3, 0.5), Timing(1.0, 1.0))
    config = PlannerConfig(timings=timings, cost=CostConfig(time=5.0), search=AnaStarConfig(max_expansions=150))
    planner = ContactPlanner(robot, make_world(FLOOR), HurriesAreHard(robot), config)
    last = planner.search(np.random.default_rng(0), 600.0).solutions[-1].sequence
    used = [transition.timing for transition in last.transitions]
    assert used[0] == timings[0] and used[-1] == timings[1]


def test_the_motion_of_the_whole_sequence_has_the_last_word(robot):
    world, base = make_world(FLOOR, goal=(0.6, 0, 0)), KinematicEvaluator(robot)
    plain = ContactPlanner(robot, world, base, QUICK).search(np.random.default_rng(0), 600.0)

    def searched(feasible):
        """With motions that are all the same; and the motion."""
        motion = SimpleNamespace(feasible=feasible, objective=500.0, failure=None if feasible else Failure("no"))
        plan = SimpleNamespace(motion=motion)
        planner = ContactPlanner(robot, world, base, QUICK, lambda sequence: plan)
        return planner.search(np.random.default_rng(0), 600.0).solutions, plan

    solutions, plan = searched(feasible=True)
    assert plain.solutions and not searched(feasible=False)[0]
    assert plain.solutions[0].plan is None and all(solution.plan is plan for solution in solutions)
    found = solutions[0]
    known = found.predicted - QUICK.cost.dynamics * found.objective.sum()
    assert found.cost == pytest.approx(known + 50.0) and known > 0.0


def test_bad_settings():
    for setting in ({"steps": 50}, {"heuristic": "none"}):
        name = next(iter(setting))
        with pytest.raises(InputError, match=name):
            PlannerConfig(**setting)


def test_a_start_at_the_goal_needs_no_transition(robot):
    result = plan(robot, make_world(FLOOR, goal=(0.05, 0, 0)))
    assert result.solutions[0].sequence.transitions == () and result.solutions[0].cost == 0.0


def test_a_plan_goes_round_ground_that_nearly_slides(robot):
    """The straight way leads over a tile that takes 87 % of its friction to rest on; beside it the ground is level."""
    ends = [box((x, 0.3, -0.05), (0.5, 1.2, 0.05), friction=0.35) for x in (0, 1.8)]
    tile = box((0.9, 0, -0.05), (0.4, 0.35, 0.05), euler=(17, 0, 0), friction=0.35)
    beside = box((0.9, 0.95, -0.05), (0.4, 0.5, 0.05), friction=0.35)
    world = make_world(*ends, tile, beside, goal=(1.8, 0, 0))
    steep = {}
    usual = CostConfig().steep
    for weight in (usual, 0.0):
        config = PlannerConfig(cost=CostConfig(steep=weight), search=AnaStarConfig(max_expansions=400))
        result = plan(robot, world, config, kinematic=KinematicConfig(friction=0.95))
        assert result.solutions, result.reason
        contacts = [item.contact for item in result.solutions[-1].sequence.transitions]
        steep[weight] = sum(contact.pose.normal[2] < np.cos(np.radians(15.0)) for contact in contacts)
    assert steep[usual] == 0 < steep[0.0]


@pytest.mark.parametrize("width", [0.25, 0.3, 0.35, 0.45, 0.6])
def test_gaps_of_every_width_are_crossed(robot, width):
    gap = [box([0, 0, -0.05], [0.5, 0.6, 0.05]), box([1.0 + width, 0, -0.05], [0.5, 0.6, 0.05])]
    world = make_world(*gap, goal=(1.0 + width, 0, 0))
    check(robot, world, plan(robot, world, PlannerConfig(search=AnaStarConfig(max_expansions=300))))


@pytest.mark.parametrize(("width", "turn"), [(0.16, 0.0), (0.2, 17.0), (0.3, 61.0)])
def test_beams_are_walked_whichever_way_they_point(robot, width, turn):
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    beam = box([0.9 * c, 0.9 * s, -0.05], [0.5, width / 2, 0.05], [0, 0, turn])
    ends = [box([x * c, x * s, -0.05], [0.4, 0.4, 0.05], [0, 0, turn]) for x in (0.0, 1.8)]
    world = make_world(*ends, beam, goal=(1.8 * c, 1.8 * s, 0))
    check(robot, world, plan(robot, world, PlannerConfig(search=AnaStarConfig(max_expansions=600))))


def test_stones_hardly_larger_than_a_sole_are_crossed(robot):
    stones = [box([0.55 + 0.34 * i, y, -0.05], [0.12, 0.11, 0.05]) for i in range(3) for y in (-0.16, 0.16)]
    world = make_world(
        box([0, 0, -0.05], [0.4, 0.4, 0.05]), *stones, box([1.8, 0, -0.05], [0.4, 0.4, 0.05]), goal=(1.8, 0, 0)
    )
    check(robot, world, plan(robot, world, PlannerConfig(search=AnaStarConfig(max_expansions=600))))
