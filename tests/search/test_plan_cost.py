"""The true cost of a plan is the sum of the search's own terms and of its motion's objective."""

from dataclasses import replace

import numpy as np
import pytest

from tests.search.worlds import FLOOR, corridor, make_world
from toolkit.centroidal.plan import MotionConfig, plan_motion
from toolkit.centroidal.problem import Weights
from toolkit.centroidal.residual import check, objective
from toolkit.centroidal.sequence import CALM
from toolkit.contacts.sequence import ContactSequence
from toolkit.pipeline.planner import make_planner
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.costs.plan_cost import known_costs, plan_cost
from toolkit.search.planner import ContactPlanner
from toolkit.search.planner_config import PlannerConfig
from toolkit.search.quasi_static import quasi_static_planner
from toolkit.world.timing import Timing

QUICK = AnaStarConfig(max_expansions=150)
FAST, SLOW = Timing(0.4, 0.6), Timing(1.0, 1.0)


def searched(robot, world, config):
    """All solutions of a search."""
    planner = ContactPlanner(robot, world, KinematicEvaluator(robot), config)
    return planner.search(np.random.default_rng(0), 600.0).solutions


@pytest.fixture(scope="module")
def world():
    return make_world(FLOOR, goal=(0.6, 0, 0), timing="0.4 0.6")


@pytest.fixture(scope="module")
def plan(robot, world):
    """A short walk with its optimised motion."""
    solution = searched(robot, world, PlannerConfig(search=QUICK))[-1]
    config = MotionConfig(initial_rest=0.4, final_rest=1.0)
    return plan_motion(robot, world, solution.sequence, config)


@pytest.mark.parametrize("timings", [(), (FAST, SLOW)])
def test_what_is_known_costs_what_it_cost_in_the_search(robot, timings):
    tilted = corridor(1)
    # A reserve close to 1 gives every tilted tile its price.
    config = PlannerConfig(timings=timings, cost=CostConfig(steep=50.0, reserve=0.95), search=QUICK)
    solutions = searched(robot, tilted, config)
    assert solutions
    for solution in solutions:
        known = known_costs(solution.sequence, tilted.goal, config.cost).sum()
        assert known + config.cost.dynamics * solution.objective.sum() == pytest.approx(solution.cost, rel=1e-12)
    last, level = solutions[-1].sequence, replace(config.cost, steep=0.0)
    assert known_costs(last, tilted.goal, level).sum() < known_costs(last, tilted.goal, config.cost).sum()


def test_the_true_cost_is_the_sum_of_its_terms(plan):
    config = CostConfig()
    cost = plan_cost(plan, config)
    assert plan.motion.feasible and check(plan.motion).within()
    assert cost.total == pytest.approx(sum(cost.terms.values())) and all(term >= 0.0 for term in cost.terms.values())
    rests = plan.schedule.duration - plan.sequence.duration
    assert rests == pytest.approx(1.4) and cost.seconds == pytest.approx(plan.schedule.duration)
    known = known_costs(plan.sequence, plan.world.goal, config).sum()
    assert cost.total == pytest.approx(known + config.time * rests + config.dynamics * plan.motion.objective)
    assert cost.step == config.step * len(plan.sequence.transitions)
    assert cost.time == pytest.approx(20.0 * plan.schedule.duration)
    assert cost.objective == plan.motion.objective


def test_an_infeasible_motion_costs_without_end_whatever_dynamics_cost(plan):
    failed = replace(plan, motion=replace(plan.motion, feasible=False))
    for weight in (0.0, 0.1):
        cost = plan_cost(failed, CostConfig(dynamics=weight))
        assert cost.total == cost.objective == np.inf and np.isfinite(cost.time)


def test_a_plan_without_transitions_costs_its_rests_and_its_motion(plan):
    standing = replace(plan, sequence=ContactSequence(plan.sequence.start, ()))
    cost = plan_cost(standing, CostConfig())
    assert cost.way == cost.step == cost.steep == cost.stagger == cost.heading == 0.0
    assert cost.time == pytest.approx(20.0 * plan.schedule.duration)


def test_the_objective_with_other_weights_is_that_of_the_same_motion(plan):
    assert objective(plan.motion, CALM) == pytest.approx(plan.motion.objective)
    paper = objective(plan.motion, Weights())
    assert 0.0 < paper < plan.motion.objective  # the paper's weights of the angular momentum are smaller


def test_steep_ground_and_heading_cost_nothing_where_no_way_leads_over_resting_ground():
    config = CostConfig()
    assert config.where(slides=False, paced=False) == config
    assert config.where(slides=True, paced=False) == replace(config, steep=0.0, heading=0.0)


def test_a_second_costs_more_where_the_pace_is_the_planners_to_choose():
    config = CostConfig()
    assert config.where(slides=False, paced=True) == replace(config, time=config.pace)
    assert config.pace > config.time


def test_rivals_search_by_steps_and_not_by_seconds(robot, world):
    one, two = PlannerConfig(search=QUICK), PlannerConfig(search=QUICK, timings=(FAST, SLOW))
    for config in (one, two):
        assert make_planner(robot, world, "kinematic", config).config.cost == replace(config.cost, time=0.0, pace=0.0)
    assert quasi_static_planner(robot, world, one).config.cost == replace(
        one.cost, time=0.0, pace=0.0, steep=0.0, dynamics=0.0, heading=0.0
    )
