"""Multi-contact planning for humanoids, validated in simulation.

The names below are what a program needs; each is imported when it is first used, so that `import toolkit` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from toolkit.execution.config import ExecutionConfig
    from toolkit.execution.disturbance import Disturbance
    from toolkit.execution.replay import replay_run
    from toolkit.pipeline import PipelineConfig, PipelineResult, carry_out, make_planner, run
    from toolkit.report.files import RunFolder
    from toolkit.report.plan_file import read_plan
    from toolkit.report.run import RunOptions, write_run
    from toolkit.report.saved_run import read_run
    from toolkit.robot.loader import find_robots, load_robot
    from toolkit.search.planner import PlannerConfig
    from toolkit.world.loader import load_world

__version__ = "0.1.0"
__all__ = [
    "Disturbance",
    "ExecutionConfig",
    "PipelineConfig",
    "PipelineResult",
    "PlannerConfig",
    "RunFolder",
    "RunOptions",
    "carry_out",
    "find_robots",
    "load_robot",
    "load_world",
    "make_planner",
    "read_plan",
    "read_run",
    "replay_run",
    "run",
    "write_run",
]
_HOMES = {
    "Disturbance": "toolkit.execution.disturbance",
    "ExecutionConfig": "toolkit.execution.config",
    "PipelineConfig": "toolkit.pipeline",
    "PipelineResult": "toolkit.pipeline",
    "PlannerConfig": "toolkit.search.planner",
    "RunFolder": "toolkit.report.files",
    "RunOptions": "toolkit.report.run",
    "carry_out": "toolkit.pipeline",
    "find_robots": "toolkit.robot.loader",
    "load_robot": "toolkit.robot.loader",
    "load_world": "toolkit.world.loader",
    "make_planner": "toolkit.pipeline",
    "read_plan": "toolkit.report.plan_file",
    "read_run": "toolkit.report.saved_run",
    "replay_run": "toolkit.execution.replay",
    "run": "toolkit.pipeline",
    "write_run": "toolkit.report.run",
}


def __getattr__(name: str) -> Any:
    """Import a public name from the module that it lives in."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """The public names, imported or not."""
    return sorted([*globals(), *__all__])
