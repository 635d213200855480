"""The verdict on an optimised sequence: which margins it keeps, or which limit it breaks most, and where.

Everything here is recomputed from forces and CoM; the solver's own flag is not used.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit.centroidal.body import POSTURES, SWING_LEG, BodyResiduals, body_residuals
from toolkit.centroidal.problem import GRAVITY, CentroidalMotion, Margins
from toolkit.centroidal.residual import TOLERANCE, check, confirmed
from toolkit.contacts.failure import Failure
from toolkit.geometry.limb import Limb
from toolkit.robot.model import RobotModel

BODY_TOLERANCE = 1e-5  # m, rad, part of a torque limit
CHEATED = 1e-5  # weights; a larger excess beyond a contact's physical limits is no rounding error


def judged(motion: CentroidalMotion, robot: RobotModel, slack: np.ndarray) -> CentroidalMotion:
    """The motion with the margins that it keeps, and the verdict of the independent checks.

    Args:
        motion: The motion as the solver left it; its problem has the wanted margins.
        robot: The robot, for the limits of its body.
        slack: (N + 1, 2); the excess beyond the contacts' physical limits in weights, and the body's slack, by knot.
            They only tell where an infeasible sequence is worst.
    """
    verdict = confirmed(motion)
    if not verdict.feasible:
        verdict = confirmed(replace(motion, kept=Margins()))
        offers = _wider(motion) if verdict.feasible else []
        verdict = next(
            (item for item in (confirmed(replace(motion, kept=m)) for m in offers) if item.feasible), verdict
        )
    body = body_residuals(verdict, robot)
    if verdict.feasible and body.largest <= BODY_TOLERANCE:
        return verdict
    failure = _failure(verdict, body, slack, robot.scale.length)
    return replace(verdict, feasible=False, status=motion.status, failure=failure)


def _wider(motion: CentroidalMotion) -> list[Margins]:
    """Margins that a motion may keep where it does not keep the wanted ones, the physical limits last.

    Friction and CoP factors follow from the forces. The yaw moment also depends on them and has no such simple answer:
    ever wider margins are offered.
    """
    p, wanted = motion.problem, motion.problem.margins
    accepted = TOLERANCE / 2  # of a weight
    local = np.einsum("tlji,tlj->tli", p.rotation, motion.force) / (p.mass * -GRAVITY[2])
    normal = np.maximum(local[..., 2], 1e-9)
    lateral = np.hypot(local[..., 0], local[..., 1]) - accepted
    friction = np.max(lateral / (np.maximum(p.friction, 1e-9) * normal), where=p.active, initial=wanted.friction)
    from_edge = p.half_size - np.abs(motion.cop) + accepted / normal[..., None]
    less = p.active[..., None] & (from_edge < p.half_size - p.reduced_half_size)
    cop = np.min(from_edge, axis=(0, 1), where=less, initial=np.inf)
    friction, (cop_x, cop_y) = min(float(friction), 1.0), np.clip(cop, 0.0, wanted.cop).tolist()
    offers = []
    for part in np.linspace(0.0, 1.0, 6).tolist():
        wider = friction + part * (1.0 - friction), ((1 - part) * cop_x, (1 - part) * cop_y)
        offers += [Margins(*wider, wanted.yaw + part * (1.0 - wanted.yaw)), Margins(*wider, 1.0)]
    return offers


def _failure(motion: CentroidalMotion, body: BodyResiduals, slack: np.ndarray, scale: float) -> Failure:
    """The constraint that is violated most, by how much, and where; `scale` is the factor on lengths."""
    times = motion.problem.times
    step = int(np.argmax(slack[:-1, 0]))
    excess = slack[step, 0]
    if body.largest > BODY_TOLERANCE and (slack[:, 1].max() - 1.0 >= excess or excess < CHEATED):
        name, knot, limb = body.worst
        reason = f"infeasible: {name} of {limb.label} beyond its limit by {body.largest:.3g}"
        stretched = name in (*POSTURES, SWING_LEG)
        return Failure(reason, float(times[knot]), limb=limb, knot=int(knot), stretched=stretched)
    residuals = check(motion)
    if excess < CHEATED and residuals.largest < 1e-3:
        return Failure(f"unsolved: {residuals.worst.replace('_', ' ')} is violated by {residuals.largest:.2g}")
    p = motion.problem
    local = np.einsum("lji,lj->li", p.rotation[step], motion.force[step]) / (p.mass * -GRAVITY[2])
    friction = np.hypot(local[:, 0], local[:, 1]) - p.friction[step] * local[:, 2]
    edge = (np.abs(motion.cop[step]) - p.half_size[step]).max(-1) * local[:, 2]
    beyond = np.stack([friction, 5 / scale * edge])  # a sole is a fifth of a metre
    beyond = np.where(p.active[step], beyond, -np.inf)
    kind, worst = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    what = ("friction", "centre of pressure")[kind] if beyond[kind, worst] > 0.0 else "yaw moment"
    limb = Limb(int(worst))
    reason = f"infeasible: {what} of {limb.label} beyond the physical limit"
    return Failure(reason, float(times[step]), limb=limb, knot=step)
