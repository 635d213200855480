"""The contact planner of a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from toolkit.prediction.kinematic import KinematicEvaluator
from toolkit.prediction.networks import NetworkEvaluator, load_networks
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import Progress
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
    ) -> SearchResult:
        """Search for as long as `time_limit` s."""
        ...


def planner_kind(robot: RobotModel, kind: str) -> str:
    """The kind of planner; "auto" stands for "learned" where the robot has networks, else for "kinematic"."""
    if kind != "auto":
        return kind
    return "learned" if (robot.folder / "networks").is_dir() else "kinematic"


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
    if kind == "kinematic":
        if len(config.timings) < 2:  # this planner counts steps; each of them takes as long as any other
            config = replace(config, cost=replace(config.cost, time=0.0))
        return ContactPlanner(robot, world, KinematicEvaluator(robot), config)
    # Imported here: without a cache the solver takes seconds to compile, and only these kinds need it.
    from toolkit.prediction.optimiser import OptimiserEvaluator

    optimiser = OptimiserEvaluator(robot)
    at_rest = OptimiserEvaluator(robot, final_at_rest=True)
    if kind == "learned":
        return ContactPlanner(robot, world, NetworkEvaluator(load_networks(robot), optimiser), config, at_rest)
    return ContactPlanner(robot, world, optimiser, config, at_rest)
