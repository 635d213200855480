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
        scuff: Largest impulse of the touches of a swing between lift-off and touchdown, over the robot's mass, m/s.
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
    scuff: float = 0.0


def replayed(scene: mujoco.MjModel, robot: RobotModel, controls: Controls, schedule: ContactSchedule) -> Replay:
    """Step through the controls and look at every state."""
    found, data = Replay(), mujoco.MjData(scene)
    data.qpos[:], data.qvel[:] = controls.qpos0, controls.qvel0
    base = scene.body(robot.base).id
    own = scene.body_rootid == scene.body_rootid[base]
    ends = {scene.body_weldid[scene.body(model.body).id]: limb for limb, model in robot.limbs.items()}
    standing, swinging = Standing(robot, schedule), Swinging(schedule)
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
        forces = dict.fromkeys(Limb, np.zeros(3))
        for number in np.flatnonzero(data.contact.efc_address >= 0) if data.ncon else ():
            first, second = data.contact.geom[number]
            bodies = scene.geom_bodyid[[first, second]]
            if own[bodies[0]] == own[bodies[1]]:
                continue
            body = int(bodies[0] if own[bodies[0]] else bodies[1])
            limb = ends.get(scene.body_weldid[body])
            if limb is None:
                found.touched.add(scene.body(body).name)
            else:
                forces[limb] = forces[limb] + (1.0 if own[bodies[1]] else -1.0) * force_on_second(scene, data, number)
        swinging.note(time, {limb: scene.opt.timestep * float(np.linalg.norm(forces[limb])) for limb in forces})
    found.scuff = swinging.largest / float(scene.body_subtreemass[base])
    mujoco.mj_kinematics(scene, data)
    found.final_qpos = data.qpos.copy()
    found.feet = np.mean([data.site(robot.limbs[foot].site).xpos[:2] for foot in FEET], axis=0)
    return found


def force_on_second(scene: mujoco.MjModel, data: mujoco.MjData, number: int) -> np.ndarray:
    """Force (3,) N of a contact on its second geom in the world, put together from the constraints' own forces."""
    contact = data.contact[number]
    rows, tangents = data.efc_force[contact.efc_address :], min(contact.dim - 1, 2)
    if scene.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC or contact.dim == 1:
        parts = rows[: 1 + tangents]
    else:
        edges = rows[: 2 * (contact.dim - 1)].reshape(-1, 2)
        parts = np.r_[edges.sum(), (contact.friction[:tangents] * (edges[:tangents, 0] - edges[:tangents, 1]))]
    return parts @ contact.frame.reshape(3, 3)[: len(parts)]


class Swinging:
    """The impulses on limbs in their planned swings."""

    PAUSE = 0.03 + 1e-9  # s; touches that are closer are one contact

    def __init__(self, schedule: ContactSchedule):
        self._swings = [(p.swing, p.start, p.end, []) for p in schedule.phases if p.swing is not None]

    def note(self, time: float, impulses: dict[Limb, float]) -> None:
        """Keep the impulses in N s of the step that begins at a time in s."""
        for limb, start, end, touches in self._swings:
            if start <= time < end and impulses[limb] > 0.0:
                touches.append((time, impulses[limb]))

    @property
    def largest(self) -> float:
        """Largest impulse on one limb in one swing after it left its contact and before it made the next, N s."""
        sums = [0.0]
        for _, start, end, touches in self._swings:
            left, met = start, end
            for time, _ in touches:
                left = time if time - left <= self.PAUSE else left
            for time, _ in reversed(touches):
                met = time if met - time <= self.PAUSE else met
            early, middle = start + 0.25 * (end - start), start + 0.5 * (end - start)
            leaving = [time <= left and left > start and time < early for time, _ in touches]
            landing = [time >= met and met < end and time >= middle for time, _ in touches]
            both = zip(touches, leaving, landing, strict=True)
            sums.append(sum(impulse for (_, impulse), leaves, lands in both if not leaves and not lands))
        return max(sums)


class Standing:
    """Which limbs stand and swing by the plan, and how far the patches of those that stand have moved."""

    def __init__(self, robot: RobotModel, schedule: ContactSchedule):
        self._robot = robot
        self._swings = [(p.swing, p.start, p.end) for p in schedule.phases if p.swing is not None]
        self._stands = [
            (contact.limb, phase.start, phase.end) for phase in schedule.phases for contact in phase.contacts
        ]
        self._settled: dict[Limb, np.ndarray] = {}

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
