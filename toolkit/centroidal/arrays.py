"""A centroidal problem and its motion for compiled functions: named tuples of arrays of exact types."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from toolkit.centroidal.problem import CentroidalMotion, CentroidalProblem, Weights

_WEIGHTS = [field.name for field in fields(Weights)]


class ProblemArrays(NamedTuple):
    """A `CentroidalProblem`, field by field, with its margins applied where that is possible.

    Attributes:
        reduced_half_size: (N, 4, 2) m; half extents with the CoP margin taken off.
        weights: (8,) in the order of `Weights`.
        friction_margin: Factor on the friction.
        yaw_margin: Factor of the yaw margin.
        landing_position, landing_rotation: Zero and the identity where no limb lands.
    """

    mass: float
    dt: np.ndarray
    active: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    friction: np.ndarray
    half_size: np.ndarray
    reduced_half_size: np.ndarray
    max_normal_force: np.ndarray
    yaw: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    angular_momentum: np.ndarray
    root_in_com: np.ndarray
    tip_in_contact: np.ndarray
    max_reach: np.ndarray
    min_height: float
    final_center: np.ndarray
    final_half_size: np.ndarray
    final_at_rest: bool
    weights: np.ndarray
    friction_margin: float
    yaw_margin: float
    landing_limb: int
    landing_position: np.ndarray
    landing_rotation: np.ndarray

    @classmethod
    def of(cls, problem: CentroidalProblem) -> ProblemArrays:
        """The arrays of a problem."""
        p = problem
        landing = p.landing_limb >= 0
        values: dict[str, Any] = {
            "mass": float(p.mass),
            "active": _plain(p.active, bool),
            "min_height": float(p.min_height),
            "final_at_rest": bool(p.final_at_rest),
            "weights": np.array([getattr(p.weights, name) for name in _WEIGHTS]),
            "friction_margin": float(p.margins.friction),
            "yaw_margin": float(p.margins.yaw),
            "landing_limb": int(p.landing_limb),
            "landing_position": _plain(p.landing_position) if landing else np.zeros(3),
            "landing_rotation": _plain(p.landing_rotation) if landing else np.eye(3),
        }
        values |= {name: _plain(getattr(p, name)) for name in cls._fields if name not in values}
        return cls(**values)

    def copy(self) -> ProblemArrays:
        """The same with arrays of its own."""
        return ProblemArrays._make(item.copy() if isinstance(item, np.ndarray) else item for item in self)


class MotionArrays(NamedTuple):
    """A motion of N steps at its N + 1 knots; fields as in `CentroidalMotion`."""

    com: np.ndarray
    linear_momentum: np.ndarray
    angular_momentum: np.ndarray
    force: np.ndarray
    cop: np.ndarray
    yaw_torque: np.ndarray

    @classmethod
    def of(cls, motion: CentroidalMotion) -> MotionArrays:
        """The arrays of a motion."""
        return cls(*(_plain(getattr(motion, name)) for name in cls._fields))


def _plain(array: np.ndarray | None, dtype: type = float) -> np.ndarray:
    """The array, contiguous and writable; for any other kind the kernels would be compiled anew."""
    array = np.ascontiguousarray(array, dtype)
    return array if array.flags.writeable else array.copy()
