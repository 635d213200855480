"""The world as a robot can walk it: places for its limbs, the start stance and the way to the goal."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.program import LEAST
from toolkit.contacts.arm_map import ArmMap
from toolkit.contacts.footholds import Footholds
from toolkit.contacts.projected import Projected
from toolkit.contacts.projection import Projector
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_model import TransitionModel, running_steps, steps_38, steps_60
from toolkit.errors import InputError, PlanningError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose
from toolkit.robot.model import RobotModel
from toolkit.search.costs.heuristic import Distance, EuclideanDistance, GridDistance
from toolkit.search.costs.terrain_distance import TerrainDistance, resting_surfaces
from toolkit.search.moves.drawn import DrawnSteps, longest_step
from toolkit.search.moves.foot_collision import FootCollision
from toolkit.search.moves.moves import MoveGenerator
from toolkit.search.moves.reasons import Reason
from toolkit.search.moves.shin_room import ShinRoom
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
        longest: The farthest, in m, that the mean of the feet moves in one transition.
        slides: Whether no way leads over resting ground alone.
        forced: The most, in m/s^2, that the ground forces the robot to accelerate on the way.
    """

    distance: Distance
    length: float
    longest: float
    slides: bool
    forced: float


class Ground:
    """The ground for one robot in one world."""

    def __init__(self, robot: RobotModel, world: World, config: PlannerConfig):
        self._robot, self._world, self._config = robot, world, config
        self._projector = self._projected(config.rest_friction)
        half = robot.half_sizes[Limb.LEFT_FOOT]
        self._footholds = Footholds(world.surfaces, half, self._projector.room - half)
        self._feet, self._shins = FootCollision.of(robot, world), ShinRoom(robot, world)
        self._terrain = self._distances(self._projector)
        walls = config.palms and bool(self._projector.table.palm.any())
        self._arms = {limb: ArmMap.of(robot, limb) for limb in robot.arms if walls}
        self._models = {slides: self._model(slides) for slides in (False, True)}
        self._longest = max(longest_step(robot), self._stride(slides=False))
        self._warm_up()

    def _warm_up(self) -> None:
        """Compile or load all kernels."""
        moves, ground, surface = self.moves(), self._projector.table, np.zeros(1, int)
        sole = Projected(surface, ground.origin[surface], ground.rotation[surface])
        moves.warm_up(int(moves.table.add(Limb.RIGHT_FOOT, sole)[0]))

    def moves(self, way: Way | None = None) -> MoveGenerator:
        """Screened moves on the way to the goal; None: the steps of the table, wherever they lead."""
        terrain, drawn = self._terrain, None
        model = self._models[way is not None and way.slides]
        if way is not None and self._config.drawn and not way.slides:
            drawn = DrawnSteps(self._robot, self._projector.table, self._footholds, way.distance, self._longest)
        places = terrain.occupancy, terrain.box, self._arms, self._shins, drawn, self._feet
        return MoveGenerator(self._robot, self._projector, model, *places)

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
        moves = self.moves()
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
        feet, forced = start.mean_feet, self._terrain.forced_acceleration()
        strides, slides = self._strides, False
        if forced > 0.0:
            projector = self._projected(LEAST.friction)
            rests: list[float] = []
            if projector.table.foot.any():
                resting = self._distances(projector)
                rests = [stride for stride in strides if resting.distance(feet, stride) is not None]
                if not rests and resting.distance(feet, strides[-1], narrow=True) is not None:
                    rests = strides
            slides, strides = not rests, rests or [self._stride(slides=True), *strides[1:]]
        distance, stride = self._distance(feet, strides)
        length = float(distance(feet.position[None], np.array([feet.yaw]))[0])
        return Way(distance, length, stride + self._projector.config.shift, slides, forced)

    @property
    def _strides(self) -> list[float]:
        """Lengths in m of the longest steps, the usual ones first."""
        usual = self._stride(slides=False)
        return [usual, self._longest] if self._config.drawn else [usual]

    def obstacle(self, start: Stance) -> str | None:
        """One line on what keeps the robot from the goal; None where no proof says that something does.

        `way` asks for it only where its grid finds no way.
        """
        return self._obstacle(start.mean_feet, self._strides)

    def _obstacle(self, feet: Pose, strides: list[float]) -> str | None:
        """See `obstacle`, for these lengths of steps."""
        surfaces = resting_surfaces(self._world.surfaces, self._config.rest_friction)
        longest = max(strides[0] + self._projector.config.shift, *strides)
        return self._terrain.obstacle(feet, longest, strides[0], surfaces)

    def _distance(self, feet: Pose, strides: list[float]) -> tuple[Distance, float]:
        """Distance to the goal with the first of the longest steps in m that leads there, and that step."""
        config = self._config
        if config.heuristic == "euclidean":
            return EuclideanDistance(self._world.goal), strides[-1]
        distance, stride = self._first(feet, strides, narrow=False)
        sound = distance is not None and distance.sound(feet.position)
        if distance is not None and sound and distance.forward(feet.position):
            return distance, stride
        obstacle = None if sound else self._obstacle(feet, strides)
        if obstacle is None:  # the finer grid also knows how far before a narrow place to turn
            finer, longest = self._first(feet, strides, narrow=True)
            if finer is not None and (distance is None or finer.sound(feet.position)):
                return finer, longest
            return distance or EuclideanDistance(self._world.goal), stride
        if config.rest_friction is not None:
            if self._distances(self._projected(None)).distance(feet, strides[-1]) is not None:
                raise PlanningError(self._terrain.too_steep(config.rest_friction))
        raise PlanningError(obstacle)

    def _first(self, feet: Pose, strides: list[float], *, narrow: bool) -> tuple[GridDistance | None, float]:
        """Distance with the first of the longest steps in m with which a way leads to the goal, else None; the step."""
        for stride in strides:
            distance = self._terrain.distance(feet, stride, narrow=narrow)
            if distance is not None:
                return distance, stride
        return None, strides[-1]

    def _model(self, slides: bool) -> TransitionModel:
        steps = steps_60() if self._config.steps == 60 else steps_38()
        return TransitionModel.of(self._robot, np.concatenate([steps, running_steps()]) if slides else steps)

    def _stride(self, *, slides: bool) -> float:
        """The longest step of the table in m."""
        return self._models[slides].longest_step

    def _projected(self, friction: float | None) -> Projector:
        """Projector onto the ground on which a foot rests with this part of its friction; None: onto all ground."""
        surfaces = resting_surfaces(self._world.surfaces, friction)
        return Projector(self._robot, surfaces, self._world.mujoco_model)

    def _distances(self, projector: Projector) -> TerrainDistance:
        return TerrainDistance(self._robot, self._world, projector, self._footholds)
