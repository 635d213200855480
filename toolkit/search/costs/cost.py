"""What edges of the contact search cost."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CostConfig:
    """Edge cost d + step + dynamics * objective (+ time * duration), and the limits that hold on edges.

    Attributes:
        step: w_s of the paper.
        dynamics: w_dyn of the paper.
        time: per s; counts only where the planner may choose between timings, lest slower always look better.
        steep: of a foot's new contact, times (`reserve` over the part of its friction that resting leaves) - 1: what
            nearly slides is feasible, but leaves the whole motion no room, so the search goes round it where it can.
            Not where no way leads over resting ground.
        reserve: part of its friction that resting leaves where a contact costs nothing.
        stagger: per m that one foot is ahead of the other in the final stance.
        swing_speed: m/s; a foot may not have to fly faster on average.
        arrival: m; a plan ends so far inside the goal, as robots land a little beside their plans (at most half of the
            goal's radius).
        miss: per m by which a transition not yet judged would have to bend the motion; only for the order in which
            transitions are judged.
        doubt: of a transition that the evaluator rejects and the second one has not judged yet; likewise.
    """

    step: float = 3.0
    dynamics: float = 0.1
    time: float = 5.0
    steep: float = 200.0
    reserve: float = 0.5
    stagger: float = 5.0
    swing_speed: float = 4.0
    arrival: float = 0.01
    miss: float = 30.0
    doubt: float = 3.0
