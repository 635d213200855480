"""The contact planner of a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Protocol

import numpy as np

from toolkit.centroidal.plan import plan_motion
from toolkit.errors import PlanningError
from toolkit.mjcf import warnings_refused
from toolkit.pipeline.config import PipelineConfig
from toolkit.prediction.evaluator import TransitionEvaluator
from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.prediction.networks import NetworkEvaluator, load_networks
from toolkit.prediction.optimiser import OptimiserEvaluator
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import Progress
from toolkit.search.moves.body_room import BodyRoom
from toolkit.search.moves.exclusion import Exclusion
from toolkit.search.planner import ContactPlanner, PlannerConfig
from toolkit.search.result import SearchResult
from toolkit.world.world import World


class Planner(Protocol):
    """Searches for contact sequences; see `toolkit.search.planner.ContactPlanner.search`."""

    def search(
        self,
        rng: np.random.Generator,
        time_limit: float,
        observer: Callable[[Progress], None] | None = None,
        exclusions: Sequence[Exclusion] = (),
        palms: bool = True,
        calmer: int = 0,
        care: int = 0,
    ) -> SearchResult:
        """Search for as long as `time_limit` s."""
        ...


def planner_kind(robot: RobotModel, kind: str) -> str:
    """The kind of planner; "auto" stands for "learned" where the robot has networks, else for "kinematic"."""
    if kind != "auto":
        return kind
    return "learned" if (robot.folder / "networks").is_dir() else "kinematic"


def judge_of(robot: RobotModel, world: World, kind: str) -> TransitionEvaluator:
    """The judge of transitions in the search of a planner whose kind is "learned", "optimiser" or "kinematic".

    Raises:
        NetworkError: `kind` is "learned" and the networks are missing or do not fit.
    """
    if kind == "learned":
        return NetworkEvaluator(load_networks(robot), world.goal)
    return OptimiserEvaluator(robot) if kind == "optimiser" else KinematicEvaluator(robot)


@warnings_refused("the planner", PlanningError)
def make_planner(
    robot: RobotModel, world: World, kind: str = "auto", config: PlannerConfig | None = None
) -> ContactPlanner:
    """The contact planner whose transitions are judged by `kind`.

    The kinds are "learned" for networks, "optimiser", "kinematic" without dynamics, "quasi-static" for the baseline,
    and "auto" (see `planner_kind`).

    Raises:
        NetworkError: `kind` is "learned" and the networks are missing or do not fit.
    """
    kind, config = planner_kind(robot, kind), config or PlannerConfig()
    if kind == "quasi-static":
        from toolkit.search.quasi_static import quasi_static_planner

        return quasi_static_planner(robot, world, config)
    judge = judge_of(robot, world, kind)
    if kind == "kinematic":
        config = replace(config, one_timing=True, cost=replace(config.cost, time=0.0, pace=0.0))
        return ContactPlanner(robot, world, judge, config)
    motions, room = PipelineConfig().motions(robot.scale), BodyRoom(robot, world)  # as a run plans them by default
    finish = partial(plan_motion, robot, world, config=motions, surroundings=room)
    return ContactPlanner(robot, world, judge, config, finish)
