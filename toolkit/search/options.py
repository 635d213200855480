"""PlannerConfig from the options of a command line."""

from __future__ import annotations

from argparse import Namespace

from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner import PlannerConfig


def planner_config(args: Namespace) -> PlannerConfig:
    """Settings of the planner from parsed options (see `toolkit.cli.add_planning_options`)."""
    return PlannerConfig(
        steps=args.steps,
        palms=not args.no_palms,
        heuristic=args.heuristic,
        timings=args.timing or (),
        search=AnaStarConfig(max_expansions=args.expansions),
    )
