"""SceneIndex: where a robot's parts are in a compiled scene."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.errors import ExecutionError
from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel

PATCH_TOLERANCE = 5e-3  # m; a geom whose lowest point is that near to the patch's plane belongs to the patch


class SceneIndex:
    """Addresses of a robot in a compiled scene, with the scene's conventions asserted.

    Attributes:
        base: body id. sites: limb -> site id.
        robot_geom: (ngeom,) bool; belongs to the robot. Every other geom belongs to the static world.
        patch_limb: (ngeom,) int; limb whose patch the geom forms, -1 otherwise.
        trunk_geom: (ngeom,) bool; on no arm or leg of the robot: touching the world with it is a fall.
    """

    def __init__(self, scene: mujoco.MjModel, robot: RobotModel):
        """Find the robot.

        Raises:
            ExecutionError: the scene's degrees of freedom are not the robot's, in the robot's order.
        """
        self.scene = scene
        count = len(robot.joint_names)
        if (scene.nq, scene.nv, scene.nu) != (7 + count, 6 + count, count):
            raise ExecutionError(
                f"the scene has nq, nv, nu = {scene.nq}, {scene.nv}, {scene.nu} where robot {robot.name} alone has "
                f"{7 + count}, {6 + count}, {count}; compose it from a static world and this robot"
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
        limb_body = np.zeros(scene.nbody, bool)
        for limb, site in self.sites.items():
            body = int(scene.site_bodyid[site])
            for geom in np.flatnonzero(scene.body_weldid[scene.geom_bodyid] == scene.body_weldid[body]):
                if abs(_lowest(scene, data, int(geom), site)) < PATCH_TOLERANCE:
                    self.patch_limb[geom] = limb
            while body != self.base:
                limb_body[body] = True
                body = int(scene.body_parentid[body])
        # Wrists, fingers and toes: whatever hangs on an arm or a leg.
        for body in range(1, scene.nbody):
            limb_body[body] |= limb_body[scene.body_parentid[body]]
        # Of the bodies between the base and a limb those that two limbs share are trunk.
        self.trunk_geom = self.robot_geom & ~(limb_body & ~_shared(scene, self.sites, self.base))[scene.geom_bodyid]

    def limbs(self) -> tuple[Limb, ...]:
        """The robot's limbs, in order."""
        return tuple(self.sites)

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


def _shared(scene: mujoco.MjModel, sites: dict[Limb, int], base: int) -> np.ndarray:
    """(nbody,) bool; bodies that lie on the way to more than one limb."""
    count = np.zeros(scene.nbody, int)
    for site in sites.values():
        body = int(scene.site_bodyid[site])
        while body != base:
            count[body] += 1
            body = int(scene.body_parentid[body])
    return count > 1


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
        mesh = scene.geom_dataid[geom]
        first = scene.mesh_vertadr[mesh]
        reach = (scene.mesh_vert[first : first + scene.mesh_vertnum[mesh]] @ local).max()
    else:
        return np.inf
    return float((data.site_xpos[site] - data.geom_xpos[geom]) @ down - reach)
