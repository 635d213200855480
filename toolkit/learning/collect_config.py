"""What to collect: sizes, shares and ranges of a data set."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CollectConfig:
    """What to collect.

    Attributes:
        robot: name of the robot.
        robots: folder that holds it, None for the default one.
        seed: seed of every random draw.
        samples_per_category: fewest samples of each category.
        per_shard: fewest samples of each category in a shard.
        slope_share: share of `per_shard` that is collected on slopes besides.
        default_share: share of terrains with the paper's timing (1 s + 1 s), friction (0.5) and tiles; the others draw
            all three.
        shift, swing: s, ranges that timings are drawn from (uniformly in their logarithm), one for each transition;
        slope_shift, slope_swing: the same on slopes.
        friction: range of the coefficient, drawn for each state.
        tilt: deg, and
        rise: m; ranges from which the largest tilt and height of the tiles of a terrain are drawn.
        two_walls: share of terrains with walls on both sides.
        considered: number of transitions of a state that are labelled, and
        children: number of those from which the search goes on.
        expansions: number of states expanded on a terrain; slope_expansions: the same on a slope.
        infeasible: wanted share of the label "infeasible" in every category and kind of ground.
        com_spread: (3,) m; velocity_spread: (3,) m/s; standard deviations of a disturbance of the initial state in the
            frame of the feet, before it is scaled.
        far: range of the scale of large disturbances, of which there are as many as give the share `infeasible`.
        near: share of small disturbances, scaled by a number drawn from [0, 1], among the other states.
        run_share: share of the states on slopes that are replaced by a running one.
        run_speed: m/s, range of its speed; run_spread: (3,) m; how far the CoM may lie from over the mean of the feet.
        objective_limit: feasible transitions with a larger objective are left out, as in the original, whose limit of
            50,000 is 35 to 1,000 times its mean objectives;
        default_limit: the same with the paper's timing, where objectives are a tenth of the original's;
        disturbed_limit: the same where a resting robot's state was disturbed by much: what can just be recovered, at
            any price, is of no use to a planner.
    """

    robot: str
    robots: str | None = None
    seed: int = 0
    samples_per_category: int = 100_000
    per_shard: int = 500
    slope_share: float = 0.5
    default_share: float = 0.45
    shift: tuple[float, float] = (0.04, 1.0)
    swing: tuple[float, float] = (0.25, 1.0)
    slope_shift: tuple[float, float] = (0.04, 0.2)
    slope_swing: tuple[float, float] = (0.25, 0.5)
    friction: tuple[float, float] = (0.3, 0.9)
    tilt: tuple[float, float] = (10.0, 32.0)
    rise: tuple[float, float] = (0.02, 0.15)
    two_walls: float = 0.8
    considered: int = 24
    children: int = 4
    expansions: int = 40
    slope_expansions: int = 12
    infeasible: float = 0.33
    com_spread: tuple[float, float, float] = (0.03, 0.03, 0.015)
    velocity_spread: tuple[float, float, float] = (0.12, 0.1, 0.05)
    far: tuple[float, float] = (5.0, 15.0)
    near: float = 0.35
    run_share: float = 0.3
    run_speed: tuple[float, float] = (0.0, 2.5)
    run_spread: tuple[float, float, float] = (0.3, 0.06, 0.08)
    objective_limit: float = 2e4
    default_limit: float = 5e3
    disturbed_limit: float = 1e3

    @property
    def shards(self) -> int:
        """Number of shards."""
        return -(-self.samples_per_category // self.per_shard)

    @property
    def per_slope(self) -> int:
        """Steps on slopes in a shard, at least."""
        return round(self.slope_share * self.per_shard)
