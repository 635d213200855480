"""From a world to a verdict: the package that joins all stages.

    world -> surfaces -> contact sequence -> centroidal motion -> whole-body trajectory -> execution -> verdict

The search proposes contact sequences, and the centroidal optimiser makes a motion for each. From the truly cheapest on
(`toolkit.search.costs.plan_cost`) they are tested by inverse kinematics and by the simulation. The first that passes
everything is the plan. Where all fail, the search starts again without the transitions at which they failed.
"""

from toolkit.pipeline.candidate import Candidate, Source
from toolkit.pipeline.config import PipelineConfig
from toolkit.pipeline.loop import PipelineResult, run
from toolkit.pipeline.observer import Observer
from toolkit.pipeline.planner import Planner, make_planner, planner_kind
from toolkit.pipeline.trial import Trial

__all__ = [
    "Candidate",
    "Observer",
    "PipelineConfig",
    "PipelineResult",
    "Planner",
    "Source",
    "Trial",
    "make_planner",
    "planner_kind",
    "run",
]
