"""What plain MuJoCo says of a run, from its scene and its controls alone, for comparison with the verdict."""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from toolkit.contacts.schedule import ContactSchedule
from toolkit.execution.result import Controls
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.model import RobotModel

SETTLE = 0.1  # s; after a swing, before slip is counted


@dataclass
class Replay:
    """What a replay shows.

    Attributes:
        final_qpos: (nq,) after the last step.
        feet: (2,) m; mean of the feet's xy after the last step.
        tilt: Largest angle between the base's z axis and up, rad.
        sink: Least height of the CoM above the lower foot, m.
        torque, velocity: Largest torque and joint velocity as a part of its limit.
        excess: Largest angle beyond a joint's range, rad.
        slip: Largest tangential displacement of a patch's corner while its limb is planned to stand, m.
        touched: Names of bodies other than the limbs' ends that touched the world.
        brushed: Feet whose patches touched it in the middle of a swing, which a verdict allows.
    """

    final_qpos: np.ndarray = field(default_factory=lambda: np.zeros(0))
    feet: np.ndarray = field(default_factory=lambda: np.zeros(2))
    tilt: float = 0.0
    sink: float = np.inf
    torque: float = 0.0
    velocity: float = 0.0
    excess: float = 0.0
    slip: float = 0.0
    touched: set[str] = field(default_factory=set)
    brushed: set[Limb] = field(default_factory=set)


def replayed(scene: mujoco.MjModel, robot: RobotModel, controls: Controls, schedule: ContactSchedule) -> Replay:
    """Step through the controls and look at every state."""
    found, data = Replay(), mujoco.MjData(scene)
    data.qpos[:], data.qvel[:] = controls.qpos0, controls.qvel0
    base = scene.body(robot.base).id
    own = scene.body_rootid == scene.body_rootid[base]
    ends = {scene.body_weldid[scene.body(model.body).id]: limb for limb, model in robot.limbs.items()}
    standing = Standing(robot, schedule)
    bound, lower, upper = robot.torque_limit, robot.lower, robot.upper
    for ctrl in controls.ctrl:
        found.velocity = max(found.velocity, float((np.abs(data.qvel[6:]) / robot.velocity_limit).max()))
        found.excess = max(found.excess, float(np.maximum(data.qpos[7:] - upper, lower - data.qpos[7:]).max()))
        data.ctrl[:] = ctrl
        mujoco.mj_step(scene, data)  # leaves the kinematics of the state before the step
        time = data.time - scene.opt.timestep
        found.torque = max(found.torque, float((np.abs(data.qfrc_actuator[6:]) / bound).max()))
        found.tilt = max(found.tilt, float(np.arccos(np.clip(data.xmat[base, 8], -1.0, 1.0))))
        soles = [data.site(robot.limbs[foot].site).xpos[2] for foot in FEET]
        found.sink = min(found.sink, float(data.subtree_com[base, 2] - min(soles)))
        found.slip = max(found.slip, standing.slip(data, time))
        for first, second in data.contact.geom[data.contact.efc_address >= 0] if data.ncon else ():
            bodies = scene.geom_bodyid[[first, second]]
            if own[bodies[0]] == own[bodies[1]]:
                continue
            body = int(bodies[0] if own[bodies[0]] else bodies[1])
            limb = ends.get(scene.body_weldid[body])
            if limb is None:
                found.touched.add(scene.body(body).name)
            elif limb.is_foot and limb in standing.lifted(time):
                found.brushed.add(limb)
    mujoco.mj_kinematics(scene, data)
    found.final_qpos = data.qpos.copy()
    found.feet = np.mean([data.site(robot.limbs[foot].site).xpos[:2] for foot in FEET], axis=0)
    return found


class Standing:
    """Which limbs stand and swing by the plan, and how far the patches of those that stand have moved."""

    def __init__(self, robot: RobotModel, schedule: ContactSchedule):
        self._robot = robot
        self._swings = [(p.swing, p.start, p.end) for p in schedule.phases if p.swing is not None]
        self._stands = [
            (contact.limb, phase.start, phase.end) for phase in schedule.phases for contact in phase.contacts
        ]
        self._settled: dict[Limb, np.ndarray] = {}

    def lifted(self, time: float) -> set[Limb]:
        """Limbs in the middle half of their swing."""
        return {limb for limb, start, end in self._swings if 0.25 < (time - start) / (end - start) < 0.75}

    def slip(self, data: mujoco.MjData, time: float) -> float:
        """Largest displacement of a corner along its patch since it settled, m."""
        fresh = {limb for limb, start, end in self._swings if start <= time < end + SETTLE} if time > SETTLE else None
        last = max((end for _, _, end in self._stands), default=0.0)
        stands = {limb for limb, start, end in self._stands if start <= min(time, last - 1e-9) < end}
        largest = 0.0
        for limb in list(self._settled):
            if limb not in stands or (fresh is not None and limb in fresh):
                del self._settled[limb]
        for limb in stands - fresh if fresh is not None else set():
            model = self._robot.limbs[limb]
            turn = data.site(model.site).xmat.reshape(3, 3)
            x, y = model.half_size
            corners = data.site(model.site).xpos + np.array([[x, y, 0], [x, -y, 0], [-x, y, 0], [-x, -y, 0]]) @ turn.T
            moved = corners - self._settled.setdefault(limb, corners)
            largest = max(largest, float(np.linalg.norm(moved @ turn[:, :2], axis=1).max()))
        return largest
