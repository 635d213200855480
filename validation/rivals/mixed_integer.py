"""Mixed-integer contact planning with convex momentum dynamics, after Ponton et al. (Humanoids 2016), simplified.

A fixed number of footsteps, each in one of the terrain's convex regions (a binary choice); a contact is a point with a
force inside its region's friction cone, and its heading is given. CoM and momenta follow implicit Euler steps. The
lever arm times the force is not convex: each product has a McCormick envelope over the boxes of both, cut into `parts`
along the lever arm, with a binary choice each where there is more than one. The sums of squares of the paper's
objective are sums of absolute values, so that the program is linear.

`full` adds what the paper's second baseline has and the first has not: a centre of pressure that moves on the sole, a
yaw torque, the paper's time step of 0.2 s and envelopes in parts.

Reference:
    Ponton, Herzog, Schaal, Righetti: A convex model of humanoid momentum dynamics for multi-contact motion generation,
    Humanoids 2016; McCormick: Computability of global solutions to factorable nonconvex programs, 1976.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from toolkit.centroidal.problem import STANDARD_GRAVITY
from toolkit.contacts.sequence import ContactSequence
from toolkit.physics.wrench import friction_rows
from validation.rivals.envelopes import products
from validation.rivals.footsteps import Footsteps, add_choice, add_places
from validation.rivals.linear import Builder, LinearProgram

_CONE = 4  # sides of the friction pyramid, inside the circular cone
_LOAD = 2.0  # weights; largest normal force of a foot
_SPEED, _SPIN = 2.0, 0.3  # m/s and weights times m s; largest velocity and angular momentum over the weight
_BENT, _STRETCHED = 0.8, 1.03  # parts of its height at home between which the CoM is above a standing foot
_LEAN = 0.4  # of that height; the CoM is at most so far beside a standing foot, along each axis
_CROSS = ((0, 1, 2), (1, 2, 0), (2, 0, 1))  # axis of a torque, and of the two factors of its positive product


@dataclass(frozen=True)
class Model:
    """Settings of the program.

    Attributes:
        step: s; longest time step, about: shifts and swings are cut into equal ones.
        parts: Pieces into which the envelopes of products are cut along the lever arm.
        half_size: (2,) m; half extents of a sole on which the CoP moves; None: a contact is a point.
        step_cost: Objective per m of a foot's way.
        speed, acceleration, spin, lateral: Objective per s of |v| in m/s, |dv/dt| in g, |k| in weights times m s, and
            lateral force in weights.
    """

    step: float = 0.4
    parts: int = 1
    half_size: tuple[float, float] | None = None
    step_cost: float = 1.0
    speed: float = 1.0
    acceleration: float = 1.0
    spin: float = 2.0
    lateral: float = 1.0

    @classmethod
    def full(cls, half_size: np.ndarray) -> Model:
        """The model with full dynamics, for soles with half extents (2,) m."""
        return cls(step=0.2, parts=2, half_size=(float(half_size[0]), float(half_size[1])))


class MixedProgram(NamedTuple):
    """A program and where its variables are.

    Attributes:
        program: The program.
        places: (count + 2, 3) indices of the places.
        chosen: (count, regions) indices of the choices.
    """

    program: LinearProgram
    places: np.ndarray
    chosen: np.ndarray


class _Held(NamedTuple):
    """A contact that holds in a time step: number of its place, and whether it is of the start."""

    place: int
    given: bool


def mixed_program(task: Footsteps, model: Model = Model()) -> MixedProgram:
    """The program of a task."""
    builder = Builder()
    places = add_places(builder, task)
    chosen = add_choice(builder, task, places)
    for index in range(2, task.count + 2):
        for along in task.axes[:2]:
            builder.absolute(model.step_cost, 5.0, (along, places[index]), (-along, places[index - 2]))
    _Dynamics(builder, task, model, places, chosen).add()
    return MixedProgram(builder.finished(), places, chosen)


def planned(task: Footsteps, mixed: MixedProgram, x: np.ndarray) -> ContactSequence:
    """The contact sequence of a solution."""
    return task.sequence(x[mixed.places[2:]], x[mixed.chosen].argmax(1))


class _Dynamics:
    """Adds the dynamics of a task to a program."""

    def __init__(self, builder: Builder, task: Footsteps, model: Model, places: np.ndarray, chosen: np.ndarray):
        self._builder, self._task, self._model, self._places, self._chosen = builder, task, model, places, chosen
        height = task.com_height
        self._reach = height * np.array([_LEAN, _LEAN, _STRETCHED])
        self._arm = -self._reach, np.array([*self._reach[:2], -_BENT * height])  # place - CoM, in the task's axes
        self._force = (
            np.array([-_LOAD, -_LOAD, 0.0]),
            np.array([_LOAD, _LOAD, _LOAD]),
        )

    def add(self) -> None:
        """Add variables and rows of all time steps."""
        builder, task = self._builder, self._task
        timeline = list(self._timeline())
        low, high = task.box
        count = len(timeline) + 1
        com = builder.variables((count, 3), low - self._reach, high + self._reach)
        velocity = builder.variables((count, 3), -_SPEED, _SPEED)
        spin = builder.variables((count, 3), -_SPIN, _SPIN)
        start = task.start.mean_feet.position + [0.0, 0.0, task.com_height]
        for axis in range(3):
            builder.row((1.0, com[0, axis]), low=float(start[axis]), high=float(start[axis]))
            for at in (velocity[0, axis], velocity[-1, axis], spin[0, axis], spin[-1, axis]):
                builder.row((1.0, at), low=0.0, high=0.0)
        for step, (dt, held) in enumerate(timeline):
            self._step(dt, held, com[step : step + 2], velocity[step : step + 2], spin[step : step + 2])

    def _timeline(self) -> Iterator[tuple[float, list[_Held]]]:
        """Length in s of each time step and the contacts that hold in it."""
        task = self._task
        for number in range(task.count):
            both = [_Held(index, index < 2) for index in (number, number + 1)]
            yield from self._cut(task.timing.shift, both)
            yield from self._cut(task.timing.swing, both[1:])
        yield from self._cut(task.timing.shift, [_Held(index, False) for index in (task.count, task.count + 1)])

    def _cut(self, duration: float, held: list[_Held]) -> Iterator[tuple[float, list[_Held]]]:
        """The time steps of a phase."""
        count = max(round(duration / self._model.step), 1)
        yield from [(duration / count, held)] * count

    def _step(self, dt: float, held: list[_Held], com: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> None:
        """One time step; forces are in weights, angular momentum in weights times m s."""
        builder, model = self._builder, self._model
        forces = [builder.variables((3,), *self._force) for _ in held]
        torques = [self._torque(one, force, com[1]) for one, force in zip(held, forces, strict=True)]
        gravity = dt * STANDARD_GRAVITY
        for axis in range(3):
            along = [(-gravity, force[axis]) for force in forces]
            fall = -gravity if axis == 2 else 0.0
            builder.row((1.0, velocity[1, axis]), (-1.0, velocity[0, axis]), *along, low=fall, high=fall)
            builder.row((1.0, com[1, axis]), (-1.0, com[0, axis]), (-dt, velocity[1, axis]), low=0.0, high=0.0)
            turning = [(np.multiply(-dt, factors), at) for torque in torques for factors, at in [torque[axis]]]
            builder.row((1.0, spin[1, axis]), (-1.0, spin[0, axis]), *turning, low=0.0, high=0.0)
            builder.absolute(model.speed * dt, _SPEED, (1.0, velocity[1, axis]))
            change = (1.0 / gravity, velocity[1, axis]), (-1.0 / gravity, velocity[0, axis])
            builder.absolute(model.acceleration * dt, 4.0, *change)
            builder.absolute(model.spin * dt, _SPIN, (1.0, spin[1, axis]))
        for one, force in zip(held, forces, strict=True):
            self._reachable(one, com[1])
            self._cone(one, force)
            for along in self._task.axes[:2]:
                builder.absolute(model.lateral * dt, 2.0 * _LOAD, (along, force))

    def _reachable(self, held: _Held, com: np.ndarray) -> None:
        """The lever arm is inside its box."""
        place = self._places[held.place]
        for axis, along in enumerate(self._task.axes):
            low, high = float(self._arm[0][axis]), float(self._arm[1][axis])
            self._builder.row((along, place), (-along, com), low=low, high=high)

    def _cone(self, held: _Held, force: np.ndarray) -> None:
        """The force is inside the friction cone of the region, whichever it is."""
        builder, task = self._builder, self._task
        if held.given:
            contact = task.start.feet[held.place]
            for row in friction_rows(contact.friction, _CONE) @ contact.pose.rotation.T:
                builder.row((row, force), high=0.0)
            return
        for region, switch in zip(task.regions, self._chosen[held.place - 2], strict=True):
            turn = np.column_stack(_tangents(region.normal))
            for row in friction_rows(region.friction, _CONE) @ turn.T:
                most = float(np.maximum(row * self._force[0], row * self._force[1]).sum())
                builder.row((row, force), (most, switch), high=most)

    def _torque(self, held: _Held, force: np.ndarray, com: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Torque about the CoM along each world axis, as (factors, variables)."""
        place, task = self._places[held.place], self._task
        along_axes = [self._along(force, row) for row in task.axes]
        crossed: dict[tuple[int, int], np.ndarray] = {}
        for lever in range(3):
            row = task.axes[lever]
            arm = self._builder.variables((1,), self._arm[0][lever], self._arm[1][lever])
            self._builder.row((1.0, arm), (-row, place), (row, com), low=0.0, high=0.0)
            others = [other for other in range(3) if other != lever]
            found = products(self._builder, arm, [along_axes[other] for other in others], self._model.parts)
            crossed.update({(lever, other): at for other, at in zip(others, found, strict=True)})
        local = [
            (np.array([1.0, -1.0]), np.concatenate([crossed[first, second], crossed[second, first]]))
            for _, first, second in _CROSS
        ]
        own = self._own_torque(force)
        world = []
        for axis in range(3):
            factors = [task.axes[index, axis] * local[index][0] for index in range(3)]
            columns = [local[index][1] for index in range(3)]
            factors, columns = [*factors, *own[axis][0]], [*columns, *own[axis][1]]
            world.append((np.concatenate(factors), np.concatenate(columns)))
        return world

    def _own_torque(self, force: np.ndarray) -> list[tuple[list[np.ndarray], list[np.ndarray]]]:
        """Torque along each world axis of a CoP that moves on a sole and of turning; nothing for a point.

        A sole of any tilt is counted as a level one here, which keeps the bounds linear in the force.
        """
        if self._model.half_size is None:
            return [([], []) for _ in range(3)]
        x, y = self._model.half_size
        builder = self._builder
        torque = builder.variables((3,), -_LOAD, _LOAD)
        for at, most in zip(torque, (y, x, 0.5 * (x + y)), strict=True):
            builder.row((1.0, at), (-most, force[2]), high=0.0)
            builder.row((1.0, at), (most, force[2]), low=0.0)
        return [([self._task.axes[:, axis]], [torque]) for axis in range(3)]

    def _along(self, force: np.ndarray, row: np.ndarray) -> np.ndarray:
        """A variable for the force along an axis."""
        low = float(np.minimum(row * self._force[0], row * self._force[1]).sum())
        high = float(np.maximum(row * self._force[0], row * self._force[1]).sum())
        at = self._builder.variables((1,), low, high)
        self._builder.row((1.0, at), (-row, force), low=0.0, high=0.0)
        return at


def _tangents(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two unit vectors along a plane and its normal."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = np.cross(np.cross(normal, helper), normal)
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first), normal
