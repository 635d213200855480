"""Screened moves of one limb out of a stance.

A search meets the same standing foot, and the same pair of feet, in many states. Their projections and screens are
computed once and looked up afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.arm_map import ArmMap
from toolkit.contacts.projected import Projected
from toolkit.contacts.projection import Projector
from toolkit.contacts.transition_model import TransitionModel
from toolkit.geometry.heading import mean_heading
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import rotation_about_z
from toolkit.robot.model import RobotModel
from toolkit.search.moves.drawn import DrawnSteps
from toolkit.search.moves.foot_collision import FootCollision
from toolkit.search.moves.legs import legs_of, stances_violated
from toolkit.search.moves.limits import climb, drops, margins, sole_room
from toolkit.search.moves.occupancy import BodyBox, Occupancy
from toolkit.search.moves.reasons import Reason
from toolkit.search.moves.screen import (
    Body,
    Sole,
    Soles,
    StepLimits,
    screen_midway,
    screen_palms,
    screen_passing,
    screen_steps,
    screen_swings,
)
from toolkit.search.moves.shanks import shanks_of
from toolkit.search.moves.shin_room import ShinRoom
from toolkit.search.states.contact_table import ContactTable

_KEPT = 20_000  # entries of each memory
# Lengths are those of a body of the usual size (`toolkit.robot.scale`).
_WALL = (0.4, 0.6)  # m above the soles; see `StepLimits`
_PALM_SIDE = 0.15  # m; least distance of a palm to the side of the body's middle
_PALM_ANGLE = np.radians(65.0)  # largest angle between the arm and the surface's normal
_PALM_MARGIN = 0.04  # m inside the arm's reach
_LIFT = 0.08  # m; see `StepLimits`
_STILL, _STILL_YAW = 0.04, np.radians(10.0)  # m, rad; a foot that would move less does not move


@dataclass(frozen=True)
class Moves:
    """Contacts that passed the screens, and how many fell for which reason.

    Attributes:
        numbers: (n,) int; numbers in the contact table.
        rejected: (len(Reason),) int; rejected contacts by reason.
    """

    numbers: np.ndarray
    rejected: np.ndarray


class MoveGenerator:
    """Screened moves for one robot in one world.

    Args:
        robot: The robot.
        projector: Projects its limbs onto the world's surfaces.
        model: Steps and rays to try.
        occupancy: Occupied cells of the world.
        box: The body.
        arms: The places where each arm can hold its palm.
        shins: The room of the shins.
        drawn: Landing places for where the steps lead no farther; None: there are none but those of the steps.
        feet: Finds feet that touch the world beside their soles; None: none do.

    Attributes:
        table: The table in which contacts are entered, empty at first.
        legs: Both legs with the least margins of a search.
        shanks: See `Body`.
        has_palm_surfaces: Whether the world has surfaces for palms.
    """

    def __init__(
        self,
        robot: RobotModel,
        projector: Projector,
        model: TransitionModel,
        occupancy: Occupancy,
        box: BodyBox,
        arms: Mapping[Limb, ArmMap],
        shins: ShinRoom,
        drawn: DrawnSteps | None = None,
        feet: FootCollision | None = None,
    ):
        self._shins, self._drawn, self._feet = shins, drawn, feet
        self._leans = np.empty(0)  # rad, by number of the contact; nan until it is asked for
        self.robot, self.arms = robot, arms
        self.table = ContactTable(projector.table.friction, robot.scale.length, projector.bearing)
        self._projector, self._model = projector, model
        self._climb, self._scale = climb(robot), robot.scale.length
        self.legs, self.shanks = legs_of(robot, margins(robot)), shanks_of(robot)
        self.has_palm_surfaces = bool(projector.table.palm.any())
        self._body = Body(self.legs, self.shanks, box, occupancy)
        self._limits = StepLimits(
            half=sole_room(robot),
            climb=self._climb,
            com_height=robot.com_height,
            drops=drops(robot),
            wall_bottom=self._scale * _WALL[0],
            wall_top=self._scale * _WALL[1],
            lift=self._scale * _LIFT,
        )
        self._steps: dict[tuple, Moves] = {}
        self._palms: dict[tuple, Moves] = {}

    def steps(self, limb: Limb, standing: int) -> Moves:
        """Steps of a foot beside the standing one."""
        return _remembered(self._steps, (limb, standing), self._make_steps)

    def _make_steps(self, limb: Limb, standing: int) -> Moves:
        table = self.table
        stand, stand_yaw = table.position[standing], float(table.yaw[standing])
        steps = self._model.steps_of(limb)
        pose = np.column_stack(
            [steps[:, :2] @ rotation_about_z(stand_yaw)[:2, :2].T + stand[:2], steps[:, 2] + stand_yaw]
        )
        soles = self._projector.project_soles(
            limb, pose, stand[2] - self._climb, stand[2] + self._climb, outward=limb.outward
        )
        codes = self.screen(limb, soles.surface, soles.position, soles.rotation, pose[:, 2], standing)
        passed = codes == 0
        numbers, rejected = table.add(limb, soles.select(passed)), _count(codes)
        drawn = self._drawn
        if drawn is not None and drawn.wanted(stand, stand_yaw, soles.position[passed], pose[passed, 2]):
            more, yaws = drawn.beside(limb, stand, stand_yaw)
            codes = self.screen(limb, more.surface, more.position, more.rotation, yaws, standing)
            numbers = np.concatenate([numbers, table.add(limb, more.select(codes == 0))])
            rejected += _count(codes)
        return Moves(np.unique(numbers), rejected)

    def screen(
        self,
        limb: Limb,
        surface: np.ndarray,
        position: np.ndarray,
        rotation: np.ndarray,
        yaw: np.ndarray,
        standing: int,
    ) -> np.ndarray:
        """Codes (n,) of soles (n, ...) beside a standing foot; see `screen_steps` and `FootCollision`."""
        arrays = (np.ascontiguousarray(array) for array in (position, rotation, yaw))
        soles = Soles(np.asarray(surface, np.int64), *arrays)
        codes = np.empty(len(surface), np.int64)
        screen_steps(soles, int(limb), self._sole(standing), self._limits, self._body, codes)
        if self._feet is not None:
            left = np.flatnonzero(codes == 0)
            codes[left[self._feet.hits(soles.position[left], soles.rotation[left])]] = Reason.FOOT
        return codes

    def _sole(self, number: int) -> Sole:
        table = self.table
        return Sole(table.position[number], table.rotation[number], float(table.yaw[number]))

    def swings(self, limb: Limb, numbers: np.ndarray, old: int, standing: int, longest: float) -> np.ndarray:
        """Codes (n,) of the ways of a foot from `old` to each new place; see `screen_swings`, `_midway`, `_passing`."""
        table, codes = self.table, np.empty(len(numbers), np.int64)
        places, feet = (table.position[numbers], table.yaw[numbers]), (self._sole(old), self._sole(standing))
        screen_swings(*places, *feet, self._limits.half, longest, self._scale * _STILL, _STILL_YAW, codes)
        screen_midway(*places, *feet, self._limits, self._body, codes)
        screen_passing(int(limb), *places, *feet, self._limits, self._body, codes)
        return codes

    def leans(self, numbers: np.ndarray) -> np.ndarray:
        """(n,) rad; how far the shins over contacts (n,) of feet may lean; see `ShinRoom`."""
        table, missing = self.table, len(self.table) - len(self._leans)
        if missing > 0:
            self._leans = np.append(self._leans, np.full(missing + len(self.table), np.nan))
        new = np.unique(numbers[np.isnan(self._leans[numbers])])  # many stances share a contact
        self._leans[new] = np.inf
        for foot in FEET:
            rows = new[table.limb[new] == foot]
            rows = rows[self._shins.beside(foot, table.position[rows], self._body.occupancy)]
            if len(rows):
                self._leans[rows] = self._shins.over(foot, table.position[rows], table.rotation[rows])
        return self._leans[numbers]

    def palms(self, limb: Limb, left: int, right: int) -> Moves:
        """Places for a palm with the feet at `left` and `right`."""
        return _remembered(self._palms, (limb, left, right), self._make_palms)

    def warm_up(self, standing: int) -> None:
        """Call once all that is compiled, loaded or indexed at its first use, so that it takes no time of a search."""
        self.steps(Limb.LEFT_FOOT, standing)
        one = np.array([standing])
        self.swings(Limb.LEFT_FOOT, one, standing, standing, 1.0)
        table = self.table
        place, turn = table.position[one], table.rotation[one]
        self._shins.over(Limb.LEFT_FOOT, place, turn)
        lean = np.column_stack([self.leans(one), self.leans(one)])
        soles = place, turn, place, turn
        stances_violated(self.legs, self.shanks, place, self._limits.drops, table.yaw[one], *soles, lean)
        if self.has_palm_surfaces and self.robot.arms:
            limb = next(iter(self.robot.arms))
            self._projector.project_palms(limb, place[0], np.array([[0.0, 1.0, 0.0]]), 0.0, 1e6)
            for arm in self.arms.values():
                arm.serves(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]))

    def _make_palms(self, limb: Limb, left: int, right: int) -> Moves:
        turn = rotation_about_z(self._stand(left, right)[1])
        palms, codes = self.aimed(limb, left, right, self._model.rays_of(limb) @ turn.T)
        numbers = self.table.add(limb, palms.select(codes == 0))
        return Moves(np.unique(numbers), _count(codes))

    def shoulder(self, limb: Limb, left: int, right: int) -> np.ndarray:
        """(3,) m; shoulder of a palm's arm when standing straight with the feet at `left` and `right`."""
        centre, yaw = self._stand(left, right)
        offset = rotation_about_z(yaw) @ self.robot.arms[limb].shoulder_in_com
        return centre + [0.0, 0.0, self.robot.com_height] + offset

    def aimed(self, limb: Limb, left: int, right: int, rays: np.ndarray) -> tuple[Projected, np.ndarray]:
        """Palms along rays (n, 3) from the shoulder, with the feet at `left` and `right`, and their codes (n,)."""
        arm, margin = self.robot.arms[limb], self._scale * _PALM_MARGIN
        centre, yaw = self._stand(left, right)
        shoulder, turn = self.shoulder(limb, left, right), rotation_about_z(yaw)
        palms = self._projector.project_palms(limb, shoulder, rays, yaw, arm.max_reach)
        codes = screen_palms(
            palms.surface,
            palms.position,
            palms.rotation[:, :, 2],
            shoulder,
            centre,
            yaw,
            limb.outward,
            (arm.min_reach + margin, arm.max_reach - margin),
            self._scale * _PALM_SIDE,
            float(np.cos(_PALM_ANGLE)),
        )
        relative, normals = (palms.position - shoulder) @ turn, palms.rotation[:, :, 2] @ turn
        open_palms = np.flatnonzero(codes == 0)
        served = self.arms[limb].serves(relative[open_palms], normals[open_palms])
        codes[open_palms[~served]] = Reason.POSTURE
        return palms, codes

    def _stand(self, left: int, right: int) -> tuple[np.ndarray, float]:
        """(3,) m; mean of two feet, and its heading in rad."""
        table = self.table
        yaw = float(mean_heading(table.yaw[left], table.yaw[right]))
        return (table.position[left] + table.position[right]) / 2, yaw


def _remembered(memory: dict[tuple, Moves], key: tuple, make: Callable[..., Moves]) -> Moves:
    """The moves that a memory has for a key, made where they are missing; a full memory is emptied first."""
    if key not in memory:
        if len(memory) >= _KEPT:
            memory.clear()
        memory[key] = make(*key)
    return memory[key]


def _count(codes: np.ndarray) -> np.ndarray:
    """(len(Reason),) int; number of candidates with each code but 0."""
    counts = np.bincount(codes, minlength=len(Reason))
    counts[0] = 0
    return counts
