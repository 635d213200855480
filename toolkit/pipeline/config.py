"""Settings of a run of the pipeline."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolkit.centroidal.plan import MotionConfig
from toolkit.centroidal.sequence import SequenceConfig
from toolkit.contacts.room import RoomConfig
from toolkit.execution.config import ExecutionConfig
from toolkit.refine.local_search import RefineConfig
from toolkit.robot.scale import Scale
from toolkit.search.costs.edge_cost import CostConfig


@dataclass(frozen=True)
class PipelineConfig:
    """Settings of one run.

    Attributes:
        seed: Seed of every random draw.
        time_limit: s; for the contact search. The search also ends after a number of expansions, so that the same seed
            gives the same plan on any machine that is fast enough.
        optimisations: Most contact sequences to optimise. Each search gets half of what is left; where it finds more,
            its newest ones count, which it believes to be the cheapest.
        candidates: Most contact sequences to test after the optimiser before giving up. At most half of them use palms;
            after those, only sequences for the feet alone are searched.
        until: Last stage that tests a sequence: "dynamics" for the plan alone, "wholebody", or "execution".
        initial_rest: s for a body of the usual size (`toolkit.robot.scale`); at rest before the first transition.
        final_rest: s for the same; at rest after the last transition.
        landing: How far feet may land from where the search put them, where margins are short; None for not at all.
        refine: Settings of the local search on the true cost; None for none.
        cost: Weights of the true cost, by which plans are judged; see `toolkit.search.costs.plan_cost`.
        sequence: Settings of the centroidal optimiser.
        execution: Settings of the simulated run.
    """

    seed: int = 0
    time_limit: float = 30.0
    optimisations: int = 64
    candidates: int = 16
    until: str = "execution"
    initial_rest: float = 0.4
    final_rest: float = 1.0
    landing: RoomConfig | None = field(default_factory=RoomConfig)
    refine: RefineConfig | None = field(default_factory=RefineConfig)
    cost: CostConfig = field(default_factory=CostConfig)
    sequence: SequenceConfig = field(default_factory=SequenceConfig)
    execution: ExecutionConfig = field(default_factory=ExecutionConfig)

    def rests(self, scale: Scale) -> dict[str, float]:
        """Seconds of a robot of some size at rest: `initial_rest` and `final_rest` by name."""
        return {"initial_rest": scale.time * self.initial_rest, "final_rest": scale.time * self.final_rest}

    def motions(self, scale: Scale) -> MotionConfig:
        """Settings of the motions of a robot of some size."""
        return MotionConfig(**self.rests(scale), landing=self.landing, optimiser=self.sequence)
