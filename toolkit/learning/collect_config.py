"""What to collect: sizes, shares and ranges of a data set."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CollectConfig:
    """What to collect.

    Attributes:
        robot: Name of the robot.
        robots: Folder that holds the robot, None for the default one.
        seed: Seed of every random draw.
        samples_per_category: Least number of samples of each category.
        per_shard: Least number of samples of each category in a shard.
        slope_share: Number of samples that are added on slopes, as a share of `per_shard`.
        default_share: Share of terrains with the paper's timing (1 s + 1 s), friction (0.5) and tiles. The other
            terrains draw all three.
        shift, swing: Ranges of the times of each transition, in s, drawn uniformly in their logarithm.
        slope_shift, slope_swing: The same on slopes.
        friction: Range of the coefficient, which is drawn for each state.
        tilt: Range of the largest tilt of a terrain's tiles, in deg.
        rise: Range of the largest height of a terrain's tiles, in m.
        two_walls: Share of terrains with walls on both sides.
        considered: Number of transitions of a state that are labelled.
        children: Number of labelled transitions from which the search continues.
        expansions: Number of states that are expanded on a terrain.
        slope_expansions: The same on a slope.
        infeasible: Wanted share of infeasible transitions in every category and on every kind of ground.
        com_spread: (3,) Standard deviation of a disturbance of the initial CoM in the frame of the feet, in m. Each
            disturbance is scaled by a random factor.
        velocity_spread: (3,) The same of the CoM velocity, in m/s.
        far: Range of the factor of large disturbances. Their number is controlled to reach the share `infeasible`.
        near: Share of small disturbances, with a factor from [0, 1], among the other states.
        run_share: Share of the states on slopes that are replaced by a running state.
        run_speed: Range of the speed of a running state, in m/s.
        run_spread: (3,) Largest distance of a running CoM from its place above the mean of the feet, in m.
        objective_limit: Feasible transitions with a larger objective are left out. The limit of the original, 50,000,
            is 35 to 1,000 times its mean objectives.
        default_limit: The same with the paper's timing, where objectives are a tenth of the original's.
        disturbed_limit: The same after a large disturbance. A planner has no use for states that can just be recovered.
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
