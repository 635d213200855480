"""From a world to a verdict: the package that joins all stages.

    world -> surfaces -> contact sequence -> centroidal motion -> whole-body trajectory -> execution -> verdict

The search proposes contact sequences. They are tested from the newest (cheapest) to the oldest by the centroidal
optimiser, by inverse kinematics and by the simulation. The first that passes everything is the plan. Where all fail,
the search starts again without the transitions at which they failed.
"""

from toolkit.pipeline.carry_out import carry_out
from toolkit.pipeline.config import PipelineConfig
from toolkit.pipeline.loop import PipelineResult, run
from toolkit.pipeline.observer import Observer
from toolkit.pipeline.planner import Planner, make_planner, planner_kind
from toolkit.pipeline.trial import Trial

__all__ = [
    "Observer",
    "PipelineConfig",
    "PipelineResult",
    "Planner",
    "Trial",
    "carry_out",
    "make_planner",
    "planner_kind",
    "run",
]
