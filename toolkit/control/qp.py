"""ContactQP: the quadratic program of one contact state, with fixed arrays and a warm-started solver."""

from __future__ import annotations

import daqp
import numpy as np

from toolkit.control.dynamics import RobotDynamics
from toolkit.geometry.limb import Limb
from toolkit.physics.wrench import foot_rows, friction_rows

UNBOUNDED = 1e30
FORCE_UNIT = 100.0  # N or N m per unit of the solver's variables, for a body of the usual size
TOLERANCE = 1e-4  # units; largest violation of a constraint, far below what matters in the simulation


class ContactQP:
    """Inverse dynamics over x = [qdd (nv), 6D wrench per foot in contact, 3D force per palm in contact].

        min  1/2 |tasks @ qdd - wanted|^2 + 1/2 sum_k d_k (x_k - x_ref,k)^2
        s.t. floating base:  M_b qdd - J_b.T w = -bias_b
             torque limits:  -tau_max <= M_j qdd - J_j.T w + bias_j <= tau_max
             wrench cones:   rows @ w <= 0, in the contact frames
             clearance:      rows @ qdd >= b, where there are any
             boxes:          joint accelerations, normal forces.

    Wrenches stand in the contact frames, so that cone rows are constant. The Hessian is that of the stacked, weighted
    task rows plus a diagonal.

    Attributes:
        limbs: The limbs in contact, in order.
        size: Number of variables.
        slots: By limb, the slice of x with its wrench in the force unit.
    """

    def __init__(self, limbs: tuple[Limb, ...], nv: int, force_unit: float = FORCE_UNIT, pairs: int = 0):
        """Prepare the arrays; the force unit in N or N m keeps the Hessian's entries alike.

        There are rows for the clearance of so many pairs of links.
        """
        self.limbs, self.nv, self._unit = limbs, nv, force_unit
        self.slots: dict[Limb, slice] = {}
        start = nv
        for limb in limbs:
            self.slots[limb] = slice(start, start + (6 if limb.is_foot else 3))
            start = self.slots[limb].stop
        self.size = start
        foot, palm = len(foot_rows(1.0, np.ones(2))), len(friction_rows(1.0))
        cones = {limb: foot if limb.is_foot else palm for limb in limbs}
        rows = nv + sum(cones.values()) + pairs
        self._cone_rows: dict[Limb, slice] = {}
        start = nv
        for limb in limbs:
            self._cone_rows[limb] = slice(start, start + cones[limb])
            start += cones[limb]
        self.hessian = np.zeros((self.size, self.size))
        self.gradient = np.zeros(self.size)
        self.rows = np.zeros((rows, self.size))
        self.upper = np.full(self.size + rows, UNBOUNDED)
        self.lower = np.full(self.size + rows, -UNBOUNDED)
        self.upper[self.size + nv : len(self.upper) - pairs] = 0.0
        self._clearance = slice(rows - pairs, rows)
        self.rows[self._clearance, 0] = 1.0
        self._sense = np.zeros(self.size + rows, np.int32)
        self._sense[self.size : self.size + 6] = 5
        self._cones: dict[Limb, tuple[float, ...]] = {}
        self._model: daqp.Model | None = None
        self._diagonal = np.diag_indices(self.size)

    def set_cone(self, limb: Limb, friction: float, half_size: np.ndarray, yaw: float) -> None:
        """Set a limb's cone, unless it is the one set before.

        Args:
            limb: in contact.
            friction: coefficient, margins applied.
            half_size: (2,) m, margins applied.
            yaw: factor on the friction that may be used for the yaw moment.
        """
        key = (friction, yaw, *half_size)
        if self._cones.get(limb) == key:
            return
        self._cones[limb] = key
        cone = foot_rows(friction, half_size, yaw) if limb.is_foot else friction_rows(friction)
        self.rows[self._cone_rows[limb], self.slots[limb]] = cone

    def set_dynamics(self, dynamics: RobotDynamics, torque_limit: np.ndarray) -> None:
        """Set the equation of motion; the torque limits (n,) are in N m."""
        nv, size, bias, jacobian = self.nv, self.size, dynamics.bias, dynamics.jacobian
        self.rows[:nv, :nv] = dynamics.mass_matrix
        for limb, slot in self.slots.items():
            to_contact = -self._unit * dynamics.limb_rotation[limb]
            columns = self.rows[:nv, slot]
            columns[:, :3] = jacobian[limb, :3].T @ to_contact
            if limb.is_foot:
                columns[:, 3:] = jacobian[limb, 3:].T @ to_contact
        upper, lower = self.upper[size : size + nv], self.lower[size : size + nv]
        upper[:6] = lower[:6] = -bias[:6]
        np.subtract(torque_limit, bias[6:], out=upper[6:])
        np.subtract(-torque_limit, bias[6:], out=lower[6:])

    def set_normal_force(self, limb: Limb, low: float, high: float) -> None:
        """Bound the normal force of a limb in contact, in N."""
        index = self.slots[limb].start + 2
        self.lower[index], self.upper[index] = low / self._unit, high / self._unit

    def set_acceleration(self, low: np.ndarray, high: np.ndarray) -> None:
        """Bound the joint accelerations; each bound is (n,) rad/s^2."""
        self.lower[6 : self.nv] = low
        self.upper[6 : self.nv] = high

    def set_clearance(self, rows: np.ndarray, low: np.ndarray) -> None:
        """Bound `rows @ qdd` from below, with rows (k, nv) and bounds (k,) for at most as many pairs as there are."""
        first, count = self._clearance.start, len(rows)
        self.rows[first : first + count, : self.nv] = rows
        bound = self.lower[self.size + first :]
        bound[:count], bound[count:] = low, -UNBOUNDED

    def set_objective(self, tasks: np.ndarray, wanted: np.ndarray, diagonal: np.ndarray, target: np.ndarray) -> None:
        """Set the objective.

        Args:
            tasks: Weighted task rows (r, nv).
            wanted: Weighted accelerations (r,).
            diagonal: Weights (size,) of x itself.
            target: Wanted x (size,).
        """
        nv = self.nv
        self.hessian[:nv, :nv] = tasks.T @ tasks
        self.hessian[nv:, nv:] = 0.0
        self.hessian[self._diagonal] += diagonal
        np.multiply(diagonal, target, out=self.gradient)
        self.gradient[:nv] += wanted @ tasks
        np.negative(self.gradient, out=self.gradient)

    def solve(self) -> np.ndarray | None:
        """The best x (size,), from the last tick's active set on; None where no x within the constraints was found."""
        model = self._model
        if model is None:
            model = self._model = daqp.Model()
            flag, _ = model.setup(self.hessian, self.gradient, self.rows, self.upper, self.lower, self._sense.copy())
        else:
            flag = model.update(self.hessian, self.gradient, self.rows, self.upper, self.lower)
        if flag >= 0:
            x, _, flag, _ = model.solve()
            if flag > 0 and self._holds(x, self.lower, self.upper):
                return x
        self._model = None  # a workspace that failed is not used again
        return None

    def solve_relaxed(self) -> np.ndarray | None:
        """The same from scratch, without bounds on joint accelerations and clearance and without least normal forces.

        The robot in free fall with zero torque satisfies what remains, up to passive joint forces.
        """
        upper, lower = self.upper.copy(), self.lower.copy()
        upper[: self.nv], lower[: self.nv] = UNBOUNDED, -UNBOUNDED
        lower[self.size + self._clearance.start :] = -UNBOUNDED
        for slot in self.slots.values():
            lower[slot.start + 2] = 0.0
        x, _, flag, _ = daqp.solve(
            self.hessian, self.gradient, self.rows, upper, lower, self._sense.copy(), primal_tol=1e-5
        )
        return x if flag > 0 and self._holds(x, lower, upper) else None

    def _holds(self, x: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> bool:
        """Whether x satisfies the constraints, by its residuals: the solver's flags are not enough."""
        values = self.rows @ x
        tolerance, size = TOLERANCE * self._unit, self.size
        return bool(
            np.isfinite(values).all()
            and (x <= upper[:size] + tolerance).all()
            and (x >= lower[:size] - tolerance).all()
            and (values <= upper[size:] + tolerance).all()
            and (values >= lower[size:] - tolerance).all()
        )
