"""Recorder: the measurements at each control tick, read from the simulation."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from toolkit.execution.contact_meter import ContactMeter
from toolkit.execution.scene_index import SceneIndex
from toolkit.execution.slip import bearing_force
from toolkit.execution.standard import Standard
from toolkit.geometry.pose import quaternion_from_rotation

MAX_TILT = np.radians(60.0)  # rad; tilt of the base beyond which the robot has fallen
MIN_HEIGHT = 0.5  # part of the home CoM height above the lowest foot below which the robot has fallen


class Recorder:
    """Samples of a run at its control ticks; rows beyond `count` are not filled.

    A physics step leaves positions of bodies, contacts and forces of the state before it in the data, beside the new
    state. So nothing has to be computed again, and reading changes nothing.

    Attributes:
        scene, index, meter: The scene that runs, the robot in it, and its contacts.
        mass: The robot's in the scene, kg.
        count: Number of rows that are filled.
        fall: One line once the robot has fallen; "" before.
        tick_seconds, qpos, qvel, com, momentum, wrench, cop_margin, torque: See `Samples`.
        com_aim, may_touch: See `Samples`; `expect` fills them.
        normal_force, limb_position, limb_rotation: (C, 4) N, (C, 4, 3) m and (C, 4, 3, 3) world_from_limb.
        steps: Number of physics steps that were read.
        force: (S, 4) N; magnitude of the contact force on each limb in each physics step.
    """

    def __init__(self, standard: Standard, ticks: int, scene: mujoco.MjModel, index: SceneIndex):
        robot = standard.robot
        self.scene, self.index, self._robot = scene, index, robot
        self.meter = ContactMeter(index)
        self.count, self.steps, self.fall = 0, 0, ""
        self.force = np.zeros((ticks * standard.decimation, 4))
        self.tick_seconds, self.com_aim = np.zeros(ticks), np.zeros((ticks, 3))
        self.may_touch = np.zeros((ticks, 4), bool)
        self.qpos, self.qvel = np.zeros((ticks, scene.nq)), np.zeros((ticks, scene.nv))
        self.com, self.momentum = np.zeros((ticks, 3)), np.zeros((ticks, 6))
        self.wrench, self.normal_force = np.zeros((ticks, 4, 6)), np.zeros((ticks, 4))
        self.cop_margin = np.full((ticks, 4), np.nan)
        self.limb_position = np.full((ticks, 4, 3), np.nan)
        self.limb_rotation = np.full((ticks, 4, 3, 3), np.nan)
        self.torque = np.zeros((ticks, scene.nu))
        self.mass = float(scene.body_subtreemass[index.base])
        self._bearing = bearing_force(self.mass)

    def read(self, data: mujoco.MjData) -> None:
        """Read the contacts of the physics step just made."""
        self.meter.read(data)
        self.force[self.steps] = np.linalg.norm(self.meter.wrench[:, :3], axis=1)
        self.steps += 1

    def expect(self, com_aim: np.ndarray, may_touch: np.ndarray) -> None:
        """Note, before a tick, where its CoM (3,) in m is to be, and which limbs (4,) may touch in it."""
        self.com_aim[self.count] = com_aim
        self.may_touch[self.count] = self.meter.expected[:] = may_touch

    def record(self, data: mujoco.MjData, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Take a sample after the physics step that began in the state (qpos, qvel) and whose contacts were read."""
        k, index, meter = self.count, self.index, self.meter
        self.count += 1
        self.qpos[k], self.qvel[k] = qpos, qvel
        mujoco.mj_subtreeVel(self.scene, data)
        self.com[k] = data.subtree_com[index.base]
        self.momentum[k, :3] = self.mass * data.subtree_linvel[index.base]
        self.momentum[k, 3:] = data.subtree_angmom[index.base]
        self.wrench[k], self.normal_force[k] = meter.wrench, meter.normal_force
        self.torque[k] = data.qfrc_actuator[6:]
        for limb, site in index.sites.items():
            rotation = data.site_xmat[site].reshape(3, 3)
            self.limb_position[k, limb], self.limb_rotation[k, limb] = data.site_xpos[site], rotation
            if meter.normal_force[limb] > self._bearing:
                moment = meter.wrench[limb, 3:] @ rotation
                half = self._robot.limbs[limb].bearing
                x, y = -moment[1] / meter.normal_force[limb], moment[0] / meter.normal_force[limb]
                self.cop_margin[k, limb] = min(half[0] - abs(x), half[1] - abs(y))
        self._judge(data)

    def note_warnings(self, warnings: Sequence[str]) -> None:
        """Note at the end of a tick that the simulation diverged, if MuJoCo warned during the run.

        MuJoCo may have put such a state back to where it began.
        """
        if warnings:
            self.fall = f"the simulation diverged: {warnings[0]}"

    def _judge(self, data: mujoco.MjData) -> None:
        """Note whether the robot has fallen."""
        index, k = self.index, self.count - 1
        upright = data.xmat[index.base, 8]
        height = self.com[k, 2] - np.nanmin(self.limb_position[k, :2, 2])
        least = MIN_HEIGHT * self._robot.com_height
        if self.meter.trunk_touched:
            self.fall = f"{self.meter.trunk_touched} touched the world"
        elif upright < np.cos(MAX_TILT):
            self.fall = f"the base tilted by {np.degrees(np.arccos(np.clip(upright, -1.0, 1.0))):.0f} degrees"
        elif height < least:
            self.fall = f"the CoM sank to {height:.2f} m above the lower foot, below {least:.2f} m"

    @property
    def limb_pose(self) -> np.ndarray:
        """Positions and quaternions wxyz (count, 4, 7); NaN for limbs that the robot does not have."""
        pose = np.full((self.count, 4, 7), np.nan)
        for limb in self.index.sites:
            pose[:, limb, :3] = self.limb_position[: self.count, limb]
            pose[:, limb, 3:] = quaternion_from_rotation(self.limb_rotation[: self.count, limb])
        return pose
