"""ContactMeter: the contact forces between a robot and the world, its unplanned contacts, and links that press."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from toolkit.execution.scene_index import SceneIndex

_PRESSING = 0.05  # of the robot's weight; links that touch each other with more push it off its plan


class Press(NamedTuple):
    """Two links of a robot that press on each other.

    Attributes:
        first, second: Names of their bodies.
        time: When they were seen to, s.
        force: Normal force between them then, N.
    """

    first: str
    second: str
    time: float
    force: float


class Touch(NamedTuple):
    """A touch that no plan wanted.

    Attributes:
        robot, world: Names of the geoms.
        time: s.
    """

    robot: str
    world: str
    time: float


class ContactMeter:
    """Reads contact forces after a physics step; they belong to the state before it.

    Attributes:
        wrench: (4, 6) N and N m; force and moment about each patch's centre in the last step, world frame.
        normal_force: (4,) N; the part of the force along the patch's z axis.
        expected: (4,) bool; limbs whose patch may touch now. All may at first; the run sets it from the plan.
        unplanned: The (robot geom, world geom) pairs that have touched outside the expected patches, the first one
            first, and when in s.
        trunk_touched: Name of a trunk geom that touched the world; "" if none did.
        friction_mismatches: Number of contacts so far whose friction was not the world geom's.
        press: The first links of the robot that pressed on each other, by more than a part of its weight. None: none
            did, but for those that touch from the start.
    """

    def __init__(self, index: SceneIndex):
        self._index = index
        self.wrench, self.normal_force = np.zeros((4, 6)), np.zeros(4)
        self.expected = np.ones(4, bool)
        self.unplanned: dict[tuple[int, int], float] = {}
        self.trunk_touched = ""
        self.friction_mismatches = 0
        self.press: Press | None = None
        self._resting: set[tuple[int, int]] | None = None
        scene = index.scene
        weight = scene.body_subtreemass[index.base] * float(np.linalg.norm(scene.opt.gravity))
        self._pressing = _PRESSING * float(weight)
        self._limbs, self._sites = (np.array(each, int) for each in zip(*index.sites.items(), strict=True))

    def read(self, data: mujoco.MjData) -> None:
        """Read the contacts of the physics step just made."""
        scene, index = self._index.scene, self._index
        self.wrench[:] = 0.0
        self.normal_force[:] = 0.0
        count = data.ncon
        if not count:
            self._resting = self._resting or set()
            return
        contact = data.contact
        geoms = contact.geom[:count]
        of_robot = index.robot_geom[geoms]
        pressed = contact.efc_address[:count] >= 0
        if self.press is None:
            self._note_press(data, geoms, of_robot.all(1) & pressed)
        touching = np.flatnonzero((of_robot[:, 0] != of_robot[:, 1]) & pressed)
        if not len(touching):
            return
        second = of_robot[touching, 1]
        robot_geom = np.where(second, geoms[touching, 1], geoms[touching, 0])
        world_geom = np.where(second, geoms[touching, 0], geoms[touching, 1])
        wrong = contact.friction[touching, 0] != scene.geom_friction[world_geom, 0]
        self.friction_mismatches += int(np.count_nonzero(wrong))
        limbs = index.patch_limb[robot_geom]
        for k in np.flatnonzero((limbs < 0) | ~self.expected[limbs]).tolist():
            self._note(int(robot_geom[k]), int(world_geom[k]), data.time)
        of_patch = limbs >= 0
        touching, limbs, second = touching[of_patch], limbs[of_patch], second[of_patch]
        # The force acts on the second geom, in rows of the contact's frame (normal first).
        local = np.where(second, 1.0, -1.0)[:, None, None] * self._local_forces(data, touching)
        frame = contact.frame[touching].reshape(-1, 3, 3)
        force, moment = np.swapaxes(local @ frame, 0, 1)
        centres = np.zeros((4, 3))
        centres[self._limbs] = data.site_xpos[self._sites]
        lever = contact.pos[touching] - centres[limbs]
        moment += lever[:, [1, 2, 0]] * force[:, [2, 0, 1]] - lever[:, [2, 0, 1]] * force[:, [1, 2, 0]]
        np.add.at(self.wrench, limbs, np.hstack([force, moment]))
        normals = data.site_xmat[self._sites, 2::3]
        self.normal_force[self._limbs] = (self.wrench[self._limbs, :3] * normals).sum(1)

    @staticmethod
    def _local_forces(data: mujoco.MjData, contacts: np.ndarray) -> np.ndarray:
        """Forces and moments (n, 2, 3) in N and N m of some contacts, in their frames; the cone is elliptic."""
        columns = np.arange(6)
        exerted = columns < data.contact.dim[contacts][:, None]
        rows = data.contact.efc_address[contacts][:, None] + columns
        force = np.zeros(exerted.shape)
        force[exerted] = data.efc_force[rows[exerted]]
        return force.reshape(-1, 2, 3)

    def _note_press(self, data: mujoco.MjData, geoms: np.ndarray, own: np.ndarray) -> None:
        """Keep two links that press on each other, given all pairs of geoms (n, 2) and which of them (n,) are links."""
        rows = np.flatnonzero(own)
        if not len(rows) and self._resting is not None:
            return
        bodies = np.sort(self._index.scene.geom_bodyid[geoms[rows]], axis=1)
        if self._resting is None:
            self._resting = set(map(tuple, bodies.tolist()))
        force = data.efc_force[data.contact.efc_address[rows]]
        for pair in set(map(tuple, bodies.tolist())) - self._resting:
            total = float(force[(bodies == pair).all(1)].sum())
            if total > self._pressing:
                first, second = (self._index.scene.body(body).name for body in pair)
                self.press = Press(first, second, float(data.time), total)

    def _note(self, robot_geom: int, world_geom: int, time: float) -> None:
        """Keep an unplanned contact."""
        self.unplanned.setdefault((robot_geom, world_geom), time)
        if self._index.trunk_geom[robot_geom] and not self.trunk_touched:
            self.trunk_touched = self._index.geom_name(robot_geom)

    @property
    def first_touch(self) -> Touch | None:
        """The first unplanned contact; None where there is none."""
        for (robot_geom, world_geom), time in self.unplanned.items():
            return Touch(self._index.geom_name(robot_geom), self._index.geom_name(world_geom), time)
        return None

    @property
    def unplanned_names(self) -> tuple[tuple[str, str], ...]:
        """Unplanned contacts by name, sorted."""
        return tuple(sorted({(self._index.geom_name(a), self._index.geom_name(b)) for a, b in self.unplanned}))
