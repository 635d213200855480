"""Collision tests of boxes against a world."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.geometry.triangles import field_heights, mesh_vertices
from toolkit.world.world import World

_FAR = (0.0, 0.0, 1e4)  # m; unused boxes are put there


class BoxCollider:
    """Tests oriented boxes against a world with MuJoCo's own collision detection.

    Holds a model of the world's colliding geoms and a batch of free boxes that see the world but not each other. A box
    deep inside a mesh that is not convex, or below a height field's base, touches nothing and counts as free.
    """

    def __init__(self, world: World, *, batch: int = 32):
        """Build the model for a world; `batch` boxes are tested at once."""
        self._batch = batch
        self._model = free_boxes(world.mujoco_model, batch).compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)
        self._first = self._model.ngeom - batch

    def collide(self, poses: np.ndarray, half_sizes: np.ndarray) -> np.ndarray:
        """Whether boxes penetrate the world.

        Args:
            poses: World_from_box matrices (n, 4, 4) float, m; the origin is the centre of the box.
            half_sizes: Half extents (3,) or (n, 3) float along the axes of the box, m.

        Returns:
            (n,) bool.
        """
        model, data = self._model, self._data
        poses = np.asarray(poses, float)
        half_sizes = np.broadcast_to(np.asarray(half_sizes, float), (len(poses), 3))
        result = np.zeros(len(poses), bool)
        boxes = slice(self._first, model.ngeom)
        for begin in range(0, len(poses), self._batch):
            pose, size = poses[begin : begin + self._batch], half_sizes[begin : begin + self._batch]
            count = len(pose)
            model.geom_size[boxes] = 1e-4
            model.geom_size[self._first : self._first + count] = size
            model.geom_rbound[boxes] = np.linalg.norm(model.geom_size[boxes], axis=1)
            model.geom_aabb[boxes, 3:] = model.geom_size[boxes]
            data.geom_xpos[boxes] = _FAR
            data.geom_xpos[self._first : self._first + count] = pose[:, :3, 3]
            data.geom_xmat[self._first : self._first + count] = pose[:, :3, :3].reshape(-1, 9)
            # The frames that kinematics would compute are written directly.
            bodies = model.geom_bodyid[boxes]
            data.xpos[bodies] = data.xipos[bodies] = data.geom_xpos[boxes]
            data.xmat[bodies] = data.ximat[bodies] = data.geom_xmat[boxes]
            model.bvh_aabb[model.body_bvhadr[bodies], 3:] = model.geom_size[boxes]
            mujoco.mj_collision(model, data)
            if data.ncon:
                touching = data.contact.geom.max(axis=1) - self._first  # the boxes are the last geoms
                result[begin + touching[data.contact.dist < 0]] = True
        return result


def free_boxes(world: mujoco.MjModel, batch: int) -> mujoco.MjSpec:
    """The colliding geoms of a world, all in the world body, followed by `batch` free boxes that see only them."""
    data = mujoco.MjData(world)
    mujoco.mj_kinematics(world, data)
    spec = mujoco.MjSpec()
    for index in np.flatnonzero((world.geom_contype | world.geom_conaffinity) != 0).tolist():
        geom = spec.worldbody.add_geom(type=mujoco.mjtGeom(int(world.geom_type[index])), contype=1, conaffinity=0)
        geom.pos = data.geom_xpos[index]
        geom.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, data.geom_xmat[index])
        geom.quat = quat
        source = int(world.geom_dataid[index])
        if world.geom_type[index] == mujoco.mjtGeom.mjGEOM_MESH:
            if spec.mesh(f"mesh{source}") is None:
                spec.add_mesh(name=f"mesh{source}", uservert=mesh_vertices(world, source).ravel())
            geom.meshname = f"mesh{source}"
        elif world.geom_type[index] == mujoco.mjtGeom.mjGEOM_HFIELD:
            heights = field_heights(world, source)
            if spec.hfield(f"field{source}") is None:
                spec.add_hfield(
                    name=f"field{source}",
                    nrow=heights.shape[0],
                    ncol=heights.shape[1],
                    size=world.hfield_size[source],
                    userdata=heights.ravel(),
                )
            geom.hfieldname = f"field{source}"
        else:
            geom.size = world.geom_size[index]
    for _ in range(batch):
        body = spec.worldbody.add_body()
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1], contype=2, conaffinity=1)
    return spec
