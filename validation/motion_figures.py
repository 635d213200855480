"""The paper's figures of a centroidal motion (its table of planners, columns 4 to 12)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from toolkit.centroidal.problem import GRAVITY, CentroidalMotion
from toolkit.geometry.limb import FEET

LOADED = 1e-3  # of the weight; a contact that bears less has no centre of pressure to speak of


@dataclass(frozen=True)
class MotionFigures:
    """Means over the time of one motion, or of several.

    Attributes:
        duration: s.
        linear_momentum: kg m/s, of the norm; linear_momentum_rate: N.
        angular_momentum: kg m^2/s; angular_momentum_rate: N m.
        force: RMS norm of the contact forces at one time, over the weight.
        torque: N m; |moment about the normal| of a contact.
        lateral_force: norm of a contact's force along its surface, over the weight.
        cop_distance: m; from a contact's centre of pressure to the edge of its patch.
        foot_cop_distance: m; the same of the feet alone: in a palm's patch no point is as far from the edge.
    """

    duration: float
    linear_momentum: float
    linear_momentum_rate: float
    angular_momentum: float
    angular_momentum_rate: float
    force: float
    torque: float
    lateral_force: float
    cop_distance: float
    foot_cop_distance: float


def motion_figures(motion: CentroidalMotion) -> MotionFigures:
    """Figures of a motion; steps count by their length, contacts of a step alike."""
    p = motion.problem
    dt, weight = p.dt, p.mass * -GRAVITY[2]
    duration = float(dt.sum())

    def over_time(step_values: np.ndarray) -> float:
        return float((step_values * dt).sum() / duration)

    def over_contacts(contact_values: np.ndarray, counted: np.ndarray) -> float:
        counts = counted.sum(1)
        seen = counts > 0
        means = np.where(counted, contact_values, 0.0).sum(1)[seen] / counts[seen]
        return float((means * dt[seen]).sum() / dt[seen].sum()) if seen.any() else 0.0

    norm = np.linalg.norm(motion.force, axis=-1) / weight  # (N, 4)
    normal = np.einsum("tlji,tlj->tli", p.rotation, motion.force)[..., 2] / weight
    lateral = np.sqrt(np.maximum(norm**2 - normal**2, 0.0))
    contacts = np.maximum(p.active.sum(1), 1)
    pressed = p.active & (normal > LOADED)
    edge = (p.half_size - np.abs(motion.cop)).min(-1)
    return MotionFigures(
        duration=duration,
        linear_momentum=over_time(np.linalg.norm(motion.linear_momentum[1:], axis=1)),
        linear_momentum_rate=over_time(np.linalg.norm(np.diff(motion.linear_momentum, axis=0), axis=1) / dt),
        angular_momentum=over_time(np.linalg.norm(motion.angular_momentum[1:], axis=1)),
        angular_momentum_rate=over_time(np.linalg.norm(np.diff(motion.angular_momentum, axis=0), axis=1) / dt),
        force=over_time(np.sqrt((norm**2).sum(1) / contacts)),
        torque=over_contacts(np.abs(motion.yaw_torque), p.active),
        lateral_force=over_contacts(lateral, p.active),
        cop_distance=over_contacts(edge, pressed),
        foot_cop_distance=over_contacts(edge, pressed & (np.arange(4) < len(FEET))),
    )


def pooled(figures: Sequence[MotionFigures]) -> MotionFigures | None:
    """Means over all time steps of several motions; None of nothing."""
    if not figures:
        return None
    rows = [asdict(each) for each in figures]
    durations = np.array([row["duration"] for row in rows])
    means = {name: float(np.average([row[name] for row in rows], weights=durations)) for name in rows[0]}
    return MotionFigures(**(means | {"duration": float(durations.sum())}))
