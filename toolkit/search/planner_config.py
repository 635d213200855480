"""Settings of the contact planner."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolkit.errors import InputError
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.costs.edge_cost import CostConfig
from toolkit.world.timing import Timings


@dataclass(frozen=True)
class PlannerConfig:
    """Settings of the planner.

    Attributes:
        steps: Number of rows of the foot transition model, 60 or 38.
        drawn: Whether landing places are drawn from the surfaces where the table's steps lead no farther.
        palms: Whether palms may be used.
        heuristic: "grid" or "euclidean".
        timings: Timings of a transition to choose from; see `toolkit.world.timing.Timings`.
        one_timing: Whether the calmest of them serves all transitions, as judges need that know no dynamics.
        rest_friction: Part of the friction that a resting foot may need; steeper ground holds no foot at all. None: the
            evaluator decides.
        cost: Weights of the edge costs.
        acceptable_cost: Rough cost of the first solution per m of way, where `search.initial_cost` leaves it open. The
            lower it is, the more the cost so far counts before there is a solution; inf: only h counts.
        search: Settings of ANA*. Time decides when a search stops, so the same seed gives the same plan only where the
            machine makes the same number of expansions; `search.max_expansions` makes it exact.
    """

    steps: int = 60
    drawn: bool = True
    palms: bool = True
    heuristic: str = "grid"
    timings: Timings = ()
    one_timing: bool = False
    rest_friction: float | None = None
    cost: CostConfig = field(default_factory=CostConfig)
    acceptable_cost: float = 500.0
    search: AnaStarConfig = field(default_factory=lambda: AnaStarConfig(max_expansions=20_000))

    def __post_init__(self):
        choices = {"steps": (60, 38), "heuristic": ("grid", "euclidean")}
        for name, allowed in choices.items():
            if getattr(self, name) not in allowed:
                raise InputError(f"planner setting {name} is {getattr(self, name)!r}; it must be one of {allowed}")
