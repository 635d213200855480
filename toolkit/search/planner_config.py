"""Settings of the contact planner."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolkit.contacts.projection import ProjectionConfig
from toolkit.errors import InputError
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.delay import HasteConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.search.moves.moves import MoveConfig
from toolkit.search.moves.reach_check import ReachConfig
from toolkit.world.timing import Timing


@dataclass(frozen=True)
class PlannerConfig:
    """Settings of the planner.

    Attributes:
        steps: 60 or 38; rows of the foot transition model.
        wide_steps: "on", "off", or "auto": where normal steps do not lead to the goal, or where some ground holds no
            resting foot and has to be crossed fast.
        palms: whether palms may be used.
        heuristic: "grid" or "euclidean".
        timings: of a transition, to choose from; empty: the world's.
        rest_friction: ground steeper than this part of its friction angle's tangent holds no foot at all; None: the
            evaluator decides.
        cost: edge costs.
        haste: what delays states on the way over ground that holds no resting foot.
        reach: what legs and arms may reach.
        moves: kinematic limits.
        projection: how patches find their place.
        acceptable_cost: per m of way; order of magnitude of the first solution's cost, where `search.initial_cost`
            leaves it open: the lower, the more the cost so far counts before there is a solution; inf: the search goes
            straight for the goal.
        search: of ANA*. Time decides when a search stops, so the same seed gives the same plan only as long as the
            machine gets through the same expansions; `search.max_expansions` makes it exact.
    """

    steps: int = 60
    wide_steps: str = "auto"
    palms: bool = True
    heuristic: str = "grid"
    timings: tuple[Timing, ...] = ()
    rest_friction: float | None = None
    cost: CostConfig = field(default_factory=CostConfig)
    haste: HasteConfig = field(default_factory=HasteConfig)
    reach: ReachConfig = field(default_factory=ReachConfig)
    moves: MoveConfig = field(default_factory=MoveConfig)
    projection: ProjectionConfig = field(default_factory=ProjectionConfig)
    acceptable_cost: float = 2500.0
    search: AnaStarConfig = field(default_factory=lambda: AnaStarConfig(max_expansions=20_000))

    def __post_init__(self):
        for name, allowed in (("steps", (60, 38)), ("wide_steps", ("auto", "on", "off"))):
            if getattr(self, name) not in allowed:
                raise InputError(f"planner setting {name} is {getattr(self, name)!r}; it must be one of {allowed}")
        if self.heuristic not in ("grid", "euclidean"):
            raise InputError(f"planner setting heuristic is {self.heuristic!r}; it must be 'grid' or 'euclidean'")
