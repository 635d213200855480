"""Standard: what a run is held against, apart from the scene that it runs in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.control.sampled_plan import Swing
from toolkit.execution.config import SCUFF_LIMIT, ExecutionConfig
from toolkit.geometry.limb import Limb
from toolkit.robot.model import LimbModel, RobotModel, half_sizes_of
from toolkit.wholebody.plan import WholeBodyPlan
from toolkit.world.world import Goal


@dataclass(frozen=True)
class Subject:
    """A robot as the measurements know it; every field is as in `RobotModel`."""

    name: str
    base: str
    joint_names: tuple[str, ...]
    limbs: dict[Limb, LimbModel]
    com_height: float
    lower: np.ndarray
    upper: np.ndarray
    velocity_limit: np.ndarray
    torque_limit: np.ndarray

    @classmethod
    def of(cls, robot: RobotModel) -> Subject:
        """What the measurements need of a robot."""
        return cls(
            robot.name,
            robot.base,
            robot.joint_names,
            robot.limbs,
            robot.com_height,
            robot.lower,
            robot.upper,
            robot.velocity_limit,
            robot.torque_limit,
        )

    @property
    def half_sizes(self) -> np.ndarray:
        """Half extents (4, 2) of the patches by limb, m; zeros for a limb that the robot does not have."""
        return half_sizes_of(self.limbs)


@dataclass(frozen=True)
class Move:
    """A limb's planned move in one transition.

    Attributes:
        limb: The limb that moves.
        start, end: Times in s.
        target: (3,) m; where the patch's centre lands. None where a palm's contact is broken.
    """

    limb: Limb
    start: float
    end: float
    target: np.ndarray | None


@dataclass(frozen=True)
class Standard:
    """What a run is held against.

    Attributes:
        robot: The robot, with its limits.
        goal: The goal.
        timestep: Step of the physics in s.
        decimation: Physics steps per control tick.
        ticks: Control ticks of a run that is completed.
        slip_limit, com_rms_limit: Limits of the verdict in m.
        moves: The planned move of each transition.
        scuff_limit: Limit of the verdict in m/s.
    """

    robot: Subject
    goal: Goal
    timestep: float
    decimation: int
    ticks: int
    slip_limit: float
    com_rms_limit: float
    moves: tuple[Move, ...]
    scuff_limit: float = SCUFF_LIMIT

    @classmethod
    def of(cls, plan: WholeBodyPlan, config: ExecutionConfig, swings: tuple[Swing, ...], ticks: int) -> Standard:
        """What the run of a plan over `ticks` control ticks is held against."""
        scale = plan.robot.scale
        moves = tuple(
            Move(each.limb, each.start, each.end, None if each.contact is None else each.contact.pose.position)
            for each in swings
        )
        return cls(
            Subject.of(plan.robot),
            plan.world.goal,
            config.timestep,
            config.control_decimation,
            ticks,
            config.slip_limit,
            scale.length * config.com_rms_limit,
            moves,
            scale.speed * config.scuff_limit,
        )

    @property
    def period(self) -> float:
        """Seconds between control ticks."""
        return self.timestep * self.decimation

    @property
    def times(self) -> np.ndarray:
        """(ticks,) s of the control ticks."""
        return self.period * np.arange(self.ticks)

    def transition_at(self, time: float) -> int:
        """Index of the transition at a time in s; the number of transitions in the final rest."""
        return next((index for index, move in enumerate(self.moves) if time < move.end), len(self.moves))
