"""The world as a robot can walk it: places for its limbs, the start stance and the way to the goal."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.arm_map import ArmMap
from toolkit.contacts.projection import Projected, Projector
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_model import TransitionModel, steps_38, steps_60, wide_steps
from toolkit.errors import InputError, PlanningError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.model import RobotModel
from toolkit.search.costs.heuristic import Distance, EuclideanDistance
from toolkit.search.costs.terrain_distance import TerrainDistance, resting_surfaces
from toolkit.search.moves.moves import MoveGenerator
from toolkit.search.moves.reasons import Reason
from toolkit.search.moves.start_palms import with_palms
from toolkit.search.planner_config import PlannerConfig
from toolkit.search.states.start import place_feet
from toolkit.world.world import PALM_SITES, World


@dataclass(frozen=True)
class Way:
    """The way from a start to the goal.

    Attributes:
        distance: Distance to the goal.
        length: Length of the whole way in m.
        wide: Whether wide steps are to be used.
        longest: The farthest, in m, that the mean of the feet moves in one transition.
        slides: Whether no way leads over resting ground alone.
        forced: The most, in m/s^2, that the ground forces the robot to accelerate on the way.
    """

    distance: Distance
    length: float
    wide: bool
    longest: float
    slides: bool
    forced: float


class Ground:
    """The ground for one robot in one world."""

    def __init__(self, robot: RobotModel, world: World, config: PlannerConfig):
        self._robot, self._world, self._config = robot, world, config
        self._projector = self._projected(config.rest_friction)
        self._terrain = self._distances(self._projector)
        walls = config.palms and bool(self._projector.table.palm.any())
        self._arms = {limb: ArmMap.of(robot, limb) for limb in robot.arms if walls}
        self._models = {wide: self._model(wide) for wide in (False, True)}
        self._warm_up()

    def _warm_up(self) -> None:
        """Compile or load all kernels."""
        moves, ground, surface = self.moves(wide=False), self._projector.table, np.zeros(1, int)
        sole = Projected(surface, ground.origin[surface], ground.rotation[surface])
        moves.warm_up(int(moves.table.add(Limb.RIGHT_FOOT, sole)[0]))

    def moves(self, wide: bool) -> MoveGenerator:
        """Screened moves, with wide steps or without."""
        terrain = self._terrain
        return MoveGenerator(
            self._robot, self._projector, self._models[wide], terrain.occupancy, terrain.box, self._arms
        )

    def start_stance(self) -> Stance:
        """Both feet on the ground below the start, at their distance in the home posture, and palms at their sites.

        Raises:
            PlanningError: They find no room, or the robot cannot stand there.
            InputError: The world asks for a palm that no arm can hold there, or that the settings forbid.
        """
        robot, world = self._robot, self._world
        names = [PALM_SITES[limb] for limb in world.start_palms]
        if names and not self._config.palms:
            raise InputError(
                f"{world.path}: palms are switched off, but the world asks for palms in contact at the "
                f"start; leave out --no-palms, or remove the site{'s' * (len(names) > 1)} {' and '.join(names)}"
            )
        moves = self.moves(wide=False)
        reasons: Counter[str] = Counter()
        for stance in place_feet(robot, world, self._projector):
            left, right = (stance[limb] for limb in FEET)
            pose, surface = left.pose, np.array([left.surface])
            place = pose.position[None], pose.rotation[None], np.array([pose.yaw])
            code = int(moves.screen(Limb.LEFT_FOOT, surface, *place, moves.table.add_contact(right))[0])
            if code == 0:
                return with_palms(world, stance, moves)
            reasons[Reason(code).words] += 1
        raise PlanningError(
            f"{world.path}: the robot cannot stand at the start ({reasons.most_common(1)[0][0]}); move the site "
            "'start' to more even or more open ground"
        )

    def way(self, start: Stance) -> Way:
        """The way from a stance to the goal.

        Raises:
            PlanningError: Nothing leads to the goal.
        """
        config, feet, forced = self._config, start.mean_feet, self._terrain.forced_acceleration()
        choices = {"on": [True], "off": [False], "auto": [False, True]}[config.wide_steps]
        slides, rests = False, []
        if forced > 0.0:
            projector = self._projected(1.0)
            if projector.table.foot.any():
                resting = self._distances(projector)
                rests = [wide for wide in choices if resting.distance(feet, self._stride(wide)) is not None]
            slides, choices = not rests, rests or choices[-1:]
        distance, wide = self._distance(feet, choices)
        length = float(distance(feet.position[None], np.array([feet.yaw]))[0])
        return Way(distance, length, wide, self._stride(wide) + self._projector.config.shift, slides, forced)

    def _distance(self, feet: Pose, choices: list[bool]) -> tuple[Distance, bool]:
        """Distance to the goal with the first choice of steps, wide or not, that leads there."""
        config = self._config
        if config.heuristic == "euclidean":
            return EuclideanDistance(self._world.goal), config.wide_steps != "off"
        for wide in choices:
            distance = self._terrain.distance(feet, self._stride(wide))
            if distance is not None:
                return distance, wide
        stride = self._stride(choices[-1])
        if config.rest_friction is not None:
            if self._distances(self._projected(None)).distance(feet, stride) is not None:
                raise PlanningError(self._terrain.too_steep(config.rest_friction))
        raise PlanningError(self._terrain.obstacle(feet, stride))

    def _model(self, wide: bool) -> TransitionModel:
        steps = steps_60() if self._config.steps == 60 else steps_38()
        return TransitionModel.of(self._robot, np.concatenate([steps, wide_steps()]) if wide else steps)

    def _stride(self, wide: bool) -> float:
        """The longest step in m."""
        return self._models[wide].longest_step

    def _projected(self, friction: float | None) -> Projector:
        """Projector onto the ground on which a foot rests with this part of its friction; None: onto all ground."""
        surfaces = resting_surfaces(self._world.surfaces, friction)
        return Projector(self._robot, surfaces, self._world.mujoco_model)

    def _distances(self, projector: Projector) -> TerrainDistance:
        return TerrainDistance(self._robot, self._world, projector)
