"""WorldDistances: how near links are to the world, in the composed scene."""

from __future__ import annotations

import copy
from collections.abc import Collection

import mujoco
import numpy as np

from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.model import RobotModel
from toolkit.robot.near_pairs import NearPairs, near_boxes, reach_of, set_notice


class WorldDistances:
    """Distances between some links and the static world in a copy of a scene, within a notice.

    Attributes:
        notice: m.
        side: (ngeom,) int; palm of the side to whose arm a geom belongs, -1 for none.
    """

    def __init__(self, robot: RobotModel, scene: mujoco.MjModel, notice: float, links: np.ndarray):
        """Prepare for a robot's scene, the largest distance that counts in m, and the links (nbody,) bool that do."""
        self.notice, self.side = notice, robot.in_arms(scene)[scene.geom_bodyid]
        self._model = model = copy.copy(scene)
        self._data = mujoco.MjData(model)
        self._static = model.body_weldid[model.geom_bodyid] == 0
        of_link = links[model.geom_bodyid] & ~self._static
        neither = ~self._static & ~of_link
        model.geom_contype[neither] = model.geom_conaffinity[neither] = 0
        set_notice(model, np.where(of_link, notice, 0.0))
        self._box = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
        boxes = self._box & ((model.geom_contype | model.geom_conaffinity) != 0)
        grid = np.meshgrid(np.flatnonzero(boxes & self._static), np.flatnonzero(boxes & of_link))
        self._boxes = np.stack(grid, axis=-1).reshape(-1, 2)
        self._box_notice = np.full(len(self._boxes), notice)
        self._box_reach = reach_of(model, self._boxes, self._box_notice)

    def near(self, qpos: np.ndarray, reaching: Collection[Limb]) -> NearPairs:
        """The pairs within the notice at a state (7 + n,), without arms whose palms are `reaching`.

        The geom of the world is the first of a pair, of which several points may be among them.
        """
        model, data = self._model, self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        found = near_boxes(model, data, self._boxes, self._box_reach, self._box_notice)
        if data.ncon:
            found = self._in_contact().joined(found)
        if reaching and len(found.geoms):
            found = found.of(~np.isin(self.side[found.geoms[:, 1]], list(reaching)))
        if len(found.geoms):
            mujoco.mj_comPos(model, data)  # for the Jacobians
        return found

    def rate(self, geom: int, normal: np.ndarray, point: np.ndarray) -> np.ndarray:
        """(nv,) derivative, by MuJoCo's qvel, of the distance of a link's geom at a point (3,) along a normal (3,)."""
        jacobian = np.empty((3, self._model.nv))
        mujoco.mj_jac(self._model, self._data, jacobian, None, point, int(self._model.geom_bodyid[geom]))
        return normal @ jacobian

    def _in_contact(self) -> NearPairs:
        """The points that MuJoCo's collisions found, but between boxes."""
        contact, geoms = self._data.contact, self._data.contact.geom
        of_world = self._static[geoms]
        rows = np.flatnonzero((of_world[:, 0] != of_world[:, 1]) & (contact.dist < self.notice))
        rows = rows[~self._box[geoms[rows]].all(axis=1)]
        second = of_world[rows, 1]  # the normal leads from the first geom to the second
        pairs = np.where(second[:, None], geoms[rows][:, ::-1], geoms[rows])
        normal = np.where(second, -1.0, 1.0)[:, None] * contact.frame[rows, :3]
        return NearPairs(pairs, contact.dist[rows], normal, contact.pos[rows])


def above_ankles(robot: RobotModel, model: mujoco.MjModel) -> np.ndarray:
    """(nbody,) bool; links of the robot from the knees upward, arms included, in a model that holds the robot."""
    base, above = int(model.body(robot.base).id), np.zeros(model.nbody, bool)
    ankles = {int(model.jnt_bodyid[model.joint(robot.joint_names[robot.joints_to(foot)[4]]).id]) for foot in FEET}
    for body in range(base, model.nbody):
        above[body] = body == base or (above[model.body_parentid[body]] and body not in ankles)
    return above
