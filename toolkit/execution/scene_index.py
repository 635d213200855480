"""SceneIndex: the addresses of a robot's parts in a compiled scene."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.errors import ExecutionError
from toolkit.execution.standard import Subject
from toolkit.geometry.triangles import mesh_vertices
from toolkit.robot.model import RobotModel

PATCH_TOLERANCE = 5e-3  # m; a geom belongs to the patch if its lowest point is that near to the patch's plane


class SceneIndex:
    """Addresses of a robot in a compiled scene, whose conventions are checked.

    Attributes:
        base: Body id.
        sites: Site id by limb, in the limbs' order.
        robot_geom: (ngeom,) bool; geoms of the robot. All others belong to the static world.
        patch_limb: (ngeom,) int; the limb whose patch the geom forms, or -1.
        trunk_geom: (ngeom,) bool; geoms on no arm or leg of the robot. To touch the world with one is a fall.
    """

    def __init__(self, scene: mujoco.MjModel, robot: RobotModel | Subject):
        """Find the robot.

        Raises:
            ExecutionError: the scene's degrees of freedom are not the robot's, in the robot's order.
        """
        self.scene = scene
        joints = len(robot.joint_names)
        if (scene.nq, scene.nv, scene.nu) != (7 + joints, 6 + joints, joints):
            raise ExecutionError(
                f"the scene has nq, nv, nu = {scene.nq}, {scene.nv}, {scene.nu} where robot {robot.name} alone has "
                f"{7 + joints}, {6 + joints}, {joints}; compose it from a static world and this robot"
            )
        for index, name in enumerate(robot.joint_names):
            joint = _find(scene, mujoco.mjtObj.mjOBJ_JOINT, name, "joint")
            driven = int(scene.actuator_trnid[index, 0])
            if scene.jnt_qposadr[joint] != 7 + index or scene.jnt_dofadr[joint] != 6 + index or driven != joint:
                raise ExecutionError(f"joint {name} of robot {robot.name} changed its place in the scene; recompose it")
        self.base = _find(scene, mujoco.mjtObj.mjOBJ_BODY, robot.base, "body")
        self.sites = {
            limb: _find(scene, mujoco.mjtObj.mjOBJ_SITE, model.site, "site")
            for limb, model in sorted(robot.limbs.items())
        }
        body_of_robot = scene.body_rootid == scene.body_rootid[self.base]
        self.robot_geom = body_of_robot[scene.geom_bodyid]
        self.patch_limb = np.full(scene.ngeom, -1)
        data = mujoco.MjData(scene)
        mujoco.mj_kinematics(scene, data)
        count = np.zeros(scene.nbody, int)
        for limb, site in self.sites.items():
            body = int(scene.site_bodyid[site])
            for geom in np.flatnonzero(scene.body_weldid[scene.geom_bodyid] == scene.body_weldid[body]):
                if abs(_lowest(scene, data, int(geom), site)) < PATCH_TOLERANCE:
                    self.patch_limb[geom] = limb
            while body != self.base:
                count[body] += 1
                body = int(scene.body_parentid[body])
        limb_body = count > 0
        # Wrists, fingers and toes hang on an arm or a leg.
        for body in range(1, scene.nbody):
            limb_body[body] |= limb_body[scene.body_parentid[body]]
        # Bodies between the base and a limb are trunk where two limbs share them.
        self.trunk_geom = self.robot_geom & ~(limb_body & (count < 2))[scene.geom_bodyid]

    def geom_name(self, geom: int) -> str:
        """Name of a geom, or its body and number where it has none."""
        name = mujoco.mj_id2name(self.scene, mujoco.mjtObj.mjOBJ_GEOM, geom)
        if name:
            return name
        body = mujoco.mj_id2name(self.scene, mujoco.mjtObj.mjOBJ_BODY, int(self.scene.geom_bodyid[geom]))
        return f"{body}#{geom}"


def _find(scene: mujoco.MjModel, kind: mujoco.mjtObj, name: str, word: str) -> int:
    """Id of a named element of the robot."""
    found = mujoco.mj_name2id(scene, kind, name)
    if found < 0:
        raise ExecutionError(f"the scene has no {word} `{name}`; compose it from the world and the robot to be run")
    return found


def _lowest(scene: mujoco.MjModel, data: mujoco.MjData, geom: int, site: int) -> float:
    """Height in m of a geom's lowest point above the plane of a site, along the site's z axis."""
    down = -data.site_xmat[site].reshape(3, 3)[:, 2]
    rotation = data.geom_xmat[geom].reshape(3, 3)
    local, size = rotation.T @ down, scene.geom_size[geom]
    kind = scene.geom_type[geom]
    types = mujoco.mjtGeom
    if kind == types.mjGEOM_BOX:
        reach = np.abs(local) @ size
    elif kind == types.mjGEOM_SPHERE:
        reach = size[0]
    elif kind == types.mjGEOM_CAPSULE:
        reach = size[0] + abs(local[2]) * size[1]
    elif kind == types.mjGEOM_CYLINDER:
        reach = np.hypot(local[0], local[1]) * size[0] + abs(local[2]) * size[1]
    elif kind == types.mjGEOM_ELLIPSOID:
        reach = np.linalg.norm(local * size)
    elif kind == types.mjGEOM_MESH:
        reach = (mesh_vertices(scene, scene.geom_dataid[geom]) @ local).max()
    else:
        return np.inf
    return float((data.site_xpos[site] - data.geom_xpos[geom]) @ down - reach)
