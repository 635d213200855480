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
        samples_per_category: Least number of labels of each category.
        per_shard: Least number of labels of each category in a shard.
        most_worlds: Most worlds of a shard, which has fewer labels where these do not give enough.
        most_idle: Most worlds in a row that give a shard none of the labels it still wants; it then ends as well.
        networks: Folder of networks that take part in the search; None for none.
        networks_digest: Digest of their files, so that a collection goes on with the same ones.
        paper_share: Share of worlds with the paper's timing (1 s + 1 s) and friction (0.5).
        planned_share: Share of worlds with the timing at which planners are compared (0.6 s + 0.8 s).
        own_share: Share of worlds in which searches choose the timing as planners do. The other worlds draw timings.
        shift, swing: Ranges of times in s, drawn uniformly in their logarithm, for a body whose CoM is 1 m high; the
            times of others scale as a pendulum of their height does.
        quick_shift, quick_swing: The same on steep slopes.
        choices: Most timings between which a search may choose.
        friction: Range of the coefficient.
        tilt: Range of the largest tilt of a world's tiles, in deg; no more than the ankles of the robot roll.
        rise: Range of the largest height of a world's tiles, in m. Worlds are to the scale of the robot's legs.
        walled: Share of worlds with walls, while labels of transitions with palms are lacking.
        searches: Number of searches in a world, each with weights of its own.
        expansions: Range of the number of states that a search expands.
        kept: Most sequences of a search that are labelled.
        variants: Number of sequences that are made of those of a search, by palms, cuts and other timings.
        infeasible: Wanted share of infeasible transitions of every category.
    """

    robot: str
    robots: str | None = None
    seed: int = 0
    samples_per_category: int = 5000
    per_shard: int = 10
    most_worlds: int = 200
    most_idle: int = 25
    networks: str | None = None
    networks_digest: str = ""
    paper_share: float = 0.15
    planned_share: float = 0.3
    own_share: float = 0.35
    shift: tuple[float, float] = (0.04, 1.5)
    swing: tuple[float, float] = (0.25, 1.5)
    quick_shift: tuple[float, float] = (0.04, 0.2)
    quick_swing: tuple[float, float] = (0.25, 0.5)
    choices: int = 3
    friction: tuple[float, float] = (0.3, 0.9)
    tilt: tuple[float, float] = (5.0, 25.0)
    rise: tuple[float, float] = (0.02, 0.1)
    walled: float = 0.75
    searches: int = 1
    expansions: tuple[int, int] = (60, 400)
    kept: int = 4
    variants: int = 10
    infeasible: float = 0.33

    @property
    def shards(self) -> int:
        """Number of shards."""
        return -(-self.samples_per_category // self.per_shard)
