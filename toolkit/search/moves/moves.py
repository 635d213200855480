"""Moves of one limb out of a stance, screened; those of a foot depend on where the other one stands, so they are kept.

A search meets the same standing foot, and the same pair of feet, in many states: their projections and screens are
computed once and looked up afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.arm_map import ArmMap
from toolkit.contacts.projection import Projected, Projector
from toolkit.contacts.transition_model import TransitionModel
from toolkit.geometry.heading import mean_heading
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import rotation_about_z
from toolkit.physics.leg import ReachMargins
from toolkit.robot.model import RobotModel
from toolkit.search.moves.legs import legs_of, stances_violated
from toolkit.search.moves.occupancy import BodyBox, Occupancy
from toolkit.search.moves.reasons import Reason
from toolkit.search.moves.screen import Body, Sole, Soles, StepLimits, screen_palms, screen_steps, screen_swings
from toolkit.search.moves.shanks import shanks_of
from toolkit.search.states.contact_table import ContactTable

_KEPT = 20_000  # entries of each memory


@dataclass(frozen=True)
class MoveConfig:
    """Kinematic limits of moves.

    Attributes:
        apart: m; least distance between two soles.
        climb: m; largest difference of height between the soles, as part of thigh and shin together.
        margins: inside the leg's limits; hips may be helped by the base, which the closed form keeps upright.
        drop: how much lower than at home the CoM may be, as part of its height.
        palm_side: m; least distance of a palm to the side of the body's middle.
        palm_angle: rad; largest angle between the arm and the surface's normal.
        palm_margin: m; inside the arm's reach.
        still: m; still_yaw: rad; a foot that would move less does not move.
    """

    apart: float = 0.02
    climb: float = 0.55
    margins: ReachMargins = ReachMargins(length=0.005, ankle=0.05, hip=-0.1)
    drop: float = 0.25
    palm_side: float = 0.15
    palm_angle: float = np.radians(65.0)
    palm_margin: float = 0.04
    still: float = 0.04
    still_yaw: float = np.radians(10.0)


@dataclass(frozen=True)
class Moves:
    """Contacts that passed the screens, and how many fell by which reason.

    Attributes:
        numbers: (n,) int; in the contact table.
        rejected: (len(Reason),) int.
    """

    numbers: np.ndarray
    rejected: np.ndarray


class MoveGenerator:
    """Screened moves for one robot in one world.

    Args:
        robot: the robot.
        projector: its projector.
        table: where contacts are entered.
        model: its steps and rays.
        occupancy: of the world.
        box: the body.
        config: limits.
        arms: where each arm can hold its palm.

    Attributes:
        legs: both legs with the margins of the search.
        shanks: capsules inside them.
        has_palm_surfaces: whether the world offers any.
    """

    def __init__(
        self,
        robot: RobotModel,
        projector: Projector,
        table: ContactTable,
        model: TransitionModel,
        occupancy: Occupancy,
        box: BodyBox,
        config: MoveConfig,
        arms: Mapping[Limb, ArmMap],
    ):
        self._robot, self._projector, self._table, self._model = robot, projector, table, model
        self._config, self.arms = config, arms
        leg = robot.legs[Limb.LEFT_FOOT]
        self._climb = config.climb * (leg.thigh + leg.shin)
        self.legs, self.shanks = legs_of(robot, config.margins), shanks_of(robot)
        self.has_palm_surfaces = bool(projector.table.palm.any())
        self._body = Body(self.legs, self.shanks, box, occupancy)
        self._limits = StepLimits(
            half=robot.half_sizes[Limb.LEFT_FOOT] + config.apart / 2,
            climb=self._climb,
            com_height=robot.com_height,
            drops=np.linspace(0.0, config.drop, 7) * robot.com_height,
            shifts=np.array([0.0, -0.25, 0.25]),
        )
        self._steps: dict[tuple[int, int], Moves] = {}
        self._palms: dict[tuple[int, int, int], Moves] = {}

    def steps(self, limb: Limb, standing: int) -> Moves:
        """Steps of a foot beside the standing one."""
        key = (int(limb), standing)
        if key not in self._steps:
            if len(self._steps) >= _KEPT:
                self._steps.clear()
            self._steps[key] = self._make_steps(limb, standing)
        return self._steps[key]

    def _make_steps(self, limb: Limb, standing: int) -> Moves:
        table = self._table
        stand, stand_yaw = table.position[standing], float(table.yaw[standing])
        steps = self._model.steps_of(limb)
        pose = np.column_stack(
            [steps[:, :2] @ rotation_about_z(stand_yaw)[:2, :2].T + stand[:2], steps[:, 2] + stand_yaw]
        )
        outward = 1.0 if limb.is_left else -1.0
        soles = self._projector.project_soles(
            limb, pose, stand[2] - self._climb, stand[2] + self._climb, outward=outward
        )
        codes = self.screen(limb, soles.surface, soles.position, soles.rotation, pose[:, 2], standing)
        passed = codes == 0
        numbers = table.add(limb, soles.select(passed))
        return Moves(np.unique(numbers), _count(codes))

    def screen(
        self,
        limb: Limb,
        surface: np.ndarray,
        position: np.ndarray,
        rotation: np.ndarray,
        yaw: np.ndarray,
        standing: int,
    ) -> np.ndarray:
        """Codes (n,) of soles beside a standing foot; see `screen_steps`."""
        arrays = (np.ascontiguousarray(array) for array in (position, rotation, yaw))
        soles = Soles(np.asarray(surface, np.int64), *arrays)
        codes = np.empty(len(surface), np.int64)
        screen_steps(soles, int(limb), self._sole(standing), self._limits, self._body, codes)
        return codes

    def _sole(self, number: int) -> Sole:
        table = self._table
        return Sole(table.position[number], table.rotation[number], float(table.yaw[number]))

    def swings(self, limb: Limb, numbers: np.ndarray, old: int, standing: int, longest: float) -> np.ndarray:
        """Codes (n,) of the ways of a foot from `old` to each new place; see `screen_swings`."""
        table, config, half = self._table, self._config, self._limits.half
        codes = np.empty(len(numbers), np.int64)
        places, feet = (table.position[numbers], table.yaw[numbers]), (self._sole(old), self._sole(standing))
        screen_swings(*places, *feet, half, longest, config.still, config.still_yaw, codes)
        return codes

    def palms(self, limb: Limb, left: int, right: int) -> Moves:
        """Places for a palm with the feet at `left` and `right`."""
        key = (int(limb), left, right)
        if key not in self._palms:
            if len(self._palms) >= _KEPT:
                self._palms.clear()
            self._palms[key] = self._make_palms(limb, left, right)
        return self._palms[key]

    def warm_up(self, standing: int) -> None:
        """Use once whatever is compiled, loaded or indexed at its first use, so that it takes no time from a search."""
        self.steps(Limb.LEFT_FOOT, standing)
        one = np.array([standing])
        self.swings(Limb.LEFT_FOOT, one, standing, standing, 1.0)
        table = self._table
        place, turn = table.position[one], table.rotation[one]
        stances_violated(self.legs, self.shanks, place, self._limits.drops, table.yaw[one], place, turn, place, turn)
        if self.has_palm_surfaces and self._robot.arms:
            limb = next(iter(self._robot.arms))
            self._projector.project_palms(limb, place[0], np.array([[0.0, 1.0, 0.0]]), 0.0, 1e6)
            for arm in self.arms.values():
                arm.serves(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]))

    def _make_palms(self, limb: Limb, left: int, right: int) -> Moves:
        turn = rotation_about_z(self._stand(left, right)[1])
        palms, codes = self.aimed(limb, left, right, self._model.rays_of(limb) @ turn.T)
        numbers = self._table.add(limb, palms.select(codes == 0))
        return Moves(np.unique(numbers), _count(codes))

    def shoulder(self, limb: Limb, left: int, right: int) -> np.ndarray:
        """(3,) m; shoulder of a palm's arm, standing straight with the feet at `left` and `right`."""
        centre, yaw = self._stand(left, right)
        offset = rotation_about_z(yaw) @ self._robot.arms[limb].shoulder_in_com
        return centre + [0.0, 0.0, self._robot.com_height] + offset

    def aimed(self, limb: Limb, left: int, right: int, rays: np.ndarray) -> tuple[Projected, np.ndarray]:
        """Palms along rays (n, 3) from the shoulder, with the feet at `left` and `right`, and their codes (n,)."""
        config, arm = self._config, self._robot.arms[limb]
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
            1.0 if limb.is_left else -1.0,
            (arm.min_reach + config.palm_margin, arm.max_reach - config.palm_margin),
            config.palm_side,
            float(np.cos(config.palm_angle)),
        )
        relative, normals = (palms.position - shoulder) @ turn, palms.rotation[:, :, 2] @ turn
        open_palms = np.flatnonzero(codes == 0)
        served = self.arms[limb].serves(relative[open_palms], normals[open_palms])
        codes[open_palms[~served]] = Reason.POSTURE
        return palms, codes

    def _stand(self, left: int, right: int) -> tuple[np.ndarray, float]:
        """(3,) m; mean of two feet, and its heading in rad."""
        table = self._table
        yaw = float(mean_heading(table.yaw[left], table.yaw[right]))
        return (table.position[left] + table.position[right]) / 2, yaw


def _count(codes: np.ndarray) -> np.ndarray:
    """(len(Reason),) int; how often each code occurs, passed ones left out."""
    counts = np.bincount(codes, minlength=len(Reason))
    counts[0] = 0
    return counts
