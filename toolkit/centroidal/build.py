"""Centroidal problems of one contact transition and of whole schedules.

Data collection builds millions of transition problems, so plain floats and preallocated arrays do the work here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from toolkit.centroidal.problem import STANDARD_GRAVITY, SWING_LIFT, CentroidalProblem, Margins, Weights
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.errors import InputError
from toolkit.geometry.heading import joint_heading, wrapped
from toolkit.geometry.limb import FEET, Limb
from toolkit.physics.leg import PLANNED, ReachMargins, ankle_at, drop_to, hip_at, leg_clearances
from toolkit.robot.model import RobotModel

MAX_SPEED = 20.0  # m/s; of the initial CoM, as a guard against wrong units
_AT_REST = ReachMargins(length=0.015, ankle=0.03)  # what legs spare at first, where they can
_ASIDE = (0.0, *(sign * 0.05 * k for k in range(1, 6) for sign in (1.0, -1.0)))  # parts of the way between the feet
_DOWN = (0.0, 0.02, 0.04, 0.08, 0.12)  # parts of the home height


@dataclass(frozen=True)
class ProblemConfig:
    """What a problem assumes beyond robot, contacts and timing, for a body of the usual size.

    Attributes:
        steps: Number of steps per phase (the paper: 1 s in steps of 0.2 s).
        max_dt: s; long phases of a schedule get more steps than `steps` to stay below this.
        min_dt: s; short phases of a schedule get fewer steps than `steps` to stay above this.
        final_half_size: (3,) m; half sizes of the box for the last CoM, around the home height above the mean feet,
            where the motion ends at rest.
        moving_half_size: (3,) m; the same after a transition that others follow: long strides leave the CoM before or
            behind the middle of the feet, and lower.
        min_height: Least height of the CoM above the lowest foot in contact, as a part of the home height.
        max_normal_force: Bound on the normal force of each limb in multiples of the robot's weight, beside the limb's
            own limit: legs do not push with arbitrary force, however short the step.
        weights: Weights of the objective.
        margins: Margins of the constraints.
    """

    steps: int = 5
    max_dt: float = 0.2
    min_dt: float = 0.0
    final_half_size: tuple[float, float, float] = (0.15, 0.10, 0.10)
    moving_half_size: tuple[float, float, float] = (0.25, 0.12, 0.15)
    min_height: float = 0.7
    max_normal_force: float = 3.0
    weights: Weights = field(default_factory=Weights)
    margins: Margins = field(default_factory=Margins)

    def steps_of(self, duration: float) -> int:
        """Number of steps of a phase that lasts so many s."""
        most = int(duration / self.min_dt + 1e-9) if self.min_dt > 0.0 else self.steps
        return max(min(self.steps, most), math.ceil(duration / self.max_dt - 1e-9), 1)


def initial_com(robot: RobotModel, stance: Stance) -> np.ndarray:
    """(3,) m; the CoM of a robot standing at rest: home height above the mean of the feet where the legs allow it.

    On feet that are not level, as on a slope across, it is lower, and nearer to one of the feet, by as little as both
    legs need to keep their limits.
    """
    feet, legs = stance.mean_feet, [(robot.legs[limb], stance[limb].pose) for limb in FEET]
    (_, left), (_, right) = legs
    aside = np.outer(_ASIDE, [*(left.position - right.position)[:2], 0.0])
    down = np.outer(_DOWN, [0.0, 0.0, -robot.com_height])
    com = feet.position + np.array([0.0, 0.0, robot.com_height]) + (aside[:, None] + down).reshape(-1, 3)
    heading, margins = (math.cos(feet.yaw), math.sin(feet.yaw)), _AT_REST.scaled(robot.scale.length)
    for leg, sole in legs:
        ankle = ankle_at(sole.position, sole.rotation, leg.ankle_in_sole)
        drop = drop_to(hip_at(com.T, heading, leg.hip_in_com), ankle, leg.max_length - margins.length)
        com[:, 2] -= np.maximum(drop, 0.0)
    count, short = len(com), np.zeros(len(com))
    for leg, sole in legs:
        posed = np.full(count, feet.yaw), np.tile(sole.position, (count, 1)), np.tile(sole.rotation, (count, 1, 1))
        clearances = leg_clearances(leg, com, *posed, margins)
        short = np.maximum(short, np.max([-clearances[limit.name] for limit in PLANNED], axis=0))
    away = np.linalg.norm(com - com[0], axis=1)
    return com[np.lexsort((away, short))[0]]


def transition_problem(
    robot: RobotModel,
    stance: Stance,
    com: np.ndarray,
    com_velocity: np.ndarray,
    transition: ContactTransition,
    *,
    config: ProblemConfig | None = None,
    final_at_rest: bool = False,
) -> CentroidalProblem:
    """Problem of one contact transition: equal steps of shift, then equal steps of swing.

    The last knot must be within reach of the new contact too.

    Args:
        robot: The robot, with its mass, patches and reach.
        stance: The contacts before the transition.
        com: (3,) m; initial CoM in the world.
        com_velocity: (3,) m/s.
        transition: The limb that moves, its new contact and the timing.
        config: Settings; the defaults where None.
        final_at_rest: Whether the CoM must be at rest at the end.

    Raises:
        InputError: CoM or velocity are not finite, a duration is not positive, or the robot has no such limb.
    """
    config = config or ProblemConfig()
    timing = transition.timing
    if not (timing.shift > 0.0 and timing.swing > 0.0):
        raise InputError(f"transition timing must be positive, got shift {timing.shift} s and swing {timing.swing} s")
    before, after = stance.contacts, transition.apply(stance).contacts
    lift, swing = (config.steps_of(time / robot.scale.time) for time in (timing.shift, timing.swing))
    n = lift + swing
    dt = np.empty(n)
    dt[:lift], dt[lift:] = timing.shift / lift, timing.swing / swing
    # A moving foot turns the heading from the mean of the old feet to the mean of the new ones.
    start, end = _heading(before), _heading(after)
    yaw = np.empty(n + 1)
    yaw[: lift + 1] = start
    yaw[lift + 1 :] = start + wrapped(end - start) / swing * np.arange(1, swing + 1)
    arrays = _contact_arrays(n)
    for contact in before:
        _put(arrays, contact, 0, lift if contact.limb == transition.limb else n)
    return _problem(robot, config, arrays, dt, yaw, com, com_velocity, after, final_at_rest, landing=transition.contact)


def sequence_problem(
    robot: RobotModel,
    schedule: ContactSchedule,
    com: np.ndarray,
    com_velocity: np.ndarray,
    *,
    config: ProblemConfig | None = None,
    final_at_rest: bool = True,
) -> CentroidalProblem:
    """Problem of a whole schedule; the steps of a phase are equally long.

    Args:
        robot: The robot.
        schedule: The phases; the last one has both feet in contact.
        com: (3,) m; initial CoM in the world.
        com_velocity: (3,) m/s.
        config: Settings; the defaults where None.
        final_at_rest: Whether the CoM must be at rest at the end.

    Raises:
        InputError: The schedule ends with a foot in the air, or as in `transition_problem`.
    """
    config = config or ProblemConfig()
    phases = schedule.phases
    last = phases[-1].contacts
    if [contact.limb for contact in last[:2]] != list(FEET):
        raise InputError("a schedule must end with both feet in contact: give it a final rest longer than 0 s")
    counts = [config.steps_of(phase.duration / robot.scale.time) for phase in phases]
    total = sum(counts)
    dt, yaw = np.empty(total), np.empty(total + 1)
    arrays = _contact_arrays(total)
    yaw[0] = heading = _heading(phases[0].contacts)
    begin = 0
    for index, (phase, count) in enumerate(zip(phases, counts, strict=True)):
        if not phase.duration > 0.0:
            raise InputError(f"phase {index} of the schedule lasts {phase.duration} s; it must be positive")
        end = begin + count
        dt[begin:end] = phase.duration / count
        feet_stay = phase.swing is None or not phase.swing.is_foot
        target = heading if feet_stay else _heading(phases[index + 1].contacts)
        yaw[begin + 1 : end + 1] = heading + wrapped(target - heading) / count * np.arange(1, count + 1)
        heading = float(yaw[end])
        for contact in phase.contacts:
            _put(arrays, contact, begin, end)
        begin = end
    return _problem(robot, config, arrays, dt, yaw, com, com_velocity, last, final_at_rest, landing=None)


def _contact_arrays(steps: int) -> tuple[np.ndarray, ...]:
    """Empty `active`, `position`, `rotation` and `friction` of a problem, and how far patches bear."""
    rotation = np.zeros((steps, 4, 3, 3))
    rotation[:, :, (0, 1, 2), (0, 1, 2)] = 1.0
    bearing = np.full((steps, 4), np.inf)
    return np.zeros((steps, 4), bool), np.zeros((steps, 4, 3)), rotation, np.zeros((steps, 4)), bearing


def _put(arrays: tuple[np.ndarray, ...], contact: Contact, begin: int, end: int) -> None:
    """Enter a contact that holds in steps [begin, end); its place stays known afterwards."""
    active, position, rotation, friction, bearing = arrays
    active[begin:end, contact.limb] = True
    position[begin:, contact.limb] = contact.pose.position
    rotation[begin:, contact.limb] = contact.pose.rotation
    friction[begin:, contact.limb] = contact.friction
    bearing[begin:, contact.limb] = contact.bearing


def _problem(
    robot: RobotModel,
    config: ProblemConfig,
    arrays: tuple[np.ndarray, ...],
    dt: np.ndarray,
    yaw: np.ndarray,
    com: np.ndarray,
    com_velocity: np.ndarray,
    last: Sequence[Contact],
    final_at_rest: bool,
    landing: Contact | None,
) -> CentroidalProblem:
    """The problem of filled arrays that ends on the contacts `last`."""
    com, com_velocity = np.array(com, float), np.array(com_velocity, float)
    x, y, z = com.tolist()
    vx, vy, vz = com_velocity.tolist()
    if not (math.isfinite(x + y + z) and math.hypot(vx, vy, vz) <= MAX_SPEED):
        raise InputError(
            f"CoM {com} m and velocity {com_velocity} m/s must be finite, the speed at most {MAX_SPEED} m/s"
        )
    active = arrays[0]
    root, tip, reach = np.zeros((4, 3)), np.zeros((4, 3)), np.zeros(4)
    half_size, force = np.zeros((4, 2)), np.zeros(4)
    bound = config.max_normal_force * robot.mass * STANDARD_GRAVITY
    for limb, model in robot.limbs.items():
        half_size[limb] = model.bearing
        force[limb] = min(model.max_normal_force, bound)
        if limb.is_foot:
            leg = robot.legs[limb]
            root[limb], tip[limb], reach[limb] = leg.hip_in_com, leg.ankle_in_sole, leg.max_length
        elif limb in robot.arms:
            arm = robot.arms[limb]
            root[limb], reach[limb] = arm.shoulder_in_com, arm.max_reach
    used = np.asarray(active.any(0))
    if landing is not None:
        used[landing.limb] = True
    for limb in range(4):
        if used[limb] and not reach[limb] > 0.0:
            raise InputError(f"the robot has no {Limb(limb).label} with a reach; it cannot make this contact")
    scale = robot.scale.length
    box = config.final_half_size if final_at_rest else config.moving_half_size
    a, b = last[0].pose.position.tolist(), last[1].pose.position.tolist()
    return CentroidalProblem(
        mass=robot.mass,
        dt=dt,
        active=active,
        position=arrays[1],
        rotation=arrays[2],
        friction=arrays[3],
        half_size=np.minimum(arrays[4][..., None], half_size),
        max_normal_force=force,
        yaw=yaw,
        com=com,
        com_velocity=com_velocity,
        angular_momentum=np.zeros(3),
        root_in_com=root,
        tip_in_contact=tip,
        max_reach=reach,
        min_height=config.min_height * robot.com_height,
        final_center=np.array([(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2 + robot.com_height]),
        final_half_size=scale * np.array(box, float),
        final_at_rest=final_at_rest,
        weights=config.weights.scaled(robot.scale),
        margins=config.margins.scaled(scale),
        landing_limb=-1 if landing is None else int(landing.limb),
        landing_position=None if landing is None else landing.pose.position,
        landing_rotation=None if landing is None else landing.pose.rotation,
        swing_lift=scale * SWING_LIFT,
    )


def _heading(contacts: Sequence[Contact]) -> float:
    """Mean heading in rad of the feet among the contacts (the first two where both are there)."""
    feet = [contact.pose.rotation for contact in contacts if contact.limb.is_foot]
    x, y = joint_heading(feet[0], feet[-1])
    return math.atan2(y, x)
