"""Execution: the records and measurements of a simulated run."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import mujoco
import numpy as np

from toolkit.contacts.failure import Failure
from toolkit.execution.check import Check
from toolkit.execution.scuff import Scuff
from toolkit.execution.standard import Standard
from toolkit.replanning.replanner import ReplanCounts


@dataclass(frozen=True)
class Controls:
    """What replays a run of S physics steps in plain MuJoCo, and where it ends.

    Attributes:
        timestep: Step of the physics in s.
        qpos0, qvel0: Initial state (nq,), (nv,).
        ctrl: (S, nu) applied controls, one row per physics step.
        final_qpos: (nq,) after the last step.
        push: (S, 3) N at the base, in the world, beside the controls; None where the run was not pushed.
    """

    timestep: float
    qpos0: np.ndarray
    qvel0: np.ndarray
    ctrl: np.ndarray
    final_qpos: np.ndarray
    push: np.ndarray | None = None


@dataclass(frozen=True)
class Samples:
    """What was measured at the C control ticks of a run, beside what was planned.

    Attributes:
        tick_times, tick_seconds: Each (C,) s; when the samples were taken, and the wall-clock time of each tick.
        qpos, qvel: (C, nq) and (C, nv).
        com, com_planned, com_aim: Each (C, 3) m; the last is what the controller tracked, the plan as replanned.
        momentum, momentum_planned: Each (C, 6); linear, and angular about the CoM.
        may_touch: (C, 4) bool; limbs whose patch may touch the world.
        wrench, wrench_planned: Each (C, 4, 6); contact force and moment about the patch centre, world frame.
        cop_margin: (C, 4) m; distance of the measured CoP to the patch's edge, NaN without contact.
        limb_pose: (C, 4, 7) measured patch poses, positions and quaternions wxyz.
        torque, torque_ratio: Applied torques (C, nu) in N m, and the largest |torque| / limit (C,).
    """

    tick_times: np.ndarray
    tick_seconds: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    com: np.ndarray
    com_planned: np.ndarray
    com_aim: np.ndarray
    momentum: np.ndarray
    momentum_planned: np.ndarray
    may_touch: np.ndarray
    wrench: np.ndarray
    wrench_planned: np.ndarray
    cop_margin: np.ndarray
    limb_pose: np.ndarray
    torque: np.ndarray
    torque_ratio: np.ndarray


@dataclass(frozen=True)
class Execution:
    """A simulated run, measured in MuJoCo by code that shares nothing with the controller.

    Attributes:
        scene: The compiled scene that ran (robot and world), as saved in scene.mjb.
        standard: What the run is held against.
        touchdowns: One dict per transition: `transition`, `limb`, `time`, `planned_time`, `position_error` in m.
        slip: For each stance, the largest tangential displacement of any patch while it was in contact, in m.
        scuffs: The swings in which a limb touched between lift-off and touchdown.
        completed: Whether the plan was run to its end.
        fall: How the robot fell: base too low, tilted, or body contact with the world. None where it did not.
        solver_failures: Number of control ticks whose QP was not solved.
        com_rms_error: Distance in m from the plan as replanned, so that a push does not count for ever.
        unplanned_contacts: Distinct (robot geom, world geom) names that touched outside the patches.
        max_scuff: Largest change of the CoM's velocity by the touches of one swing, m/s.
        simulated_seconds, real_time_factor: Of the whole loop.
        checks: Every check of the verdict that execution decides.
        failure: The first check that did not pass, or the fall; its time is that of the fall, the first unplanned
            contact, the worst scuff or the stance that slipped too far. None where every check passed.
        replayable: Whether the controls alone reproduce the run; False where it was pushed.
    """

    scene: mujoco.MjModel = field(repr=False)
    standard: Standard = field(repr=False)
    controls: Controls
    samples: Samples
    touchdowns: tuple[dict, ...]
    slip: tuple[float, ...]
    scuffs: tuple[Scuff, ...]
    completed: bool
    fall: Failure | None
    goal_reached: bool
    final_goal_distance: float
    max_slip: float
    max_scuff: float
    max_touchdown_error: float
    max_torque_ratio: float
    max_velocity_ratio: float
    com_rms_error: float
    solver_failures: int
    unplanned_contacts: tuple[tuple[str, str], ...]
    simulated_seconds: float
    real_time_factor: float
    checks: tuple[Check, ...]
    replayable: bool = True
    failure: Failure | None = None
    replanning: ReplanCounts = ReplanCounts()

    def named(self) -> dict[str, Any]:
        """By name, as report.json and execution.npz have it; groups are unpacked, scene and standard left out."""
        fall = "" if self.fall is None else self.fall.reason
        when = None if self.failure is None else self.failure.time
        values: dict[str, Any] = {"fell": self.fell, "fall_reason": fall, "failure_time": when}
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, (Controls, Samples, ReplanCounts)):
                values |= {part.name: getattr(value, part.name) for part in fields(value)}
            elif item.name not in ("scene", "standard", "fall", "failure"):
                values[item.name] = value
        return values

    @property
    def max_scuff_impulse(self) -> float:
        """Largest impulse of the touches of one swing between lift-off and touchdown, N s."""
        return max((each.impulse for each in self.scuffs), default=0.0)

    @property
    def max_scuff_force(self) -> float:
        """Largest force of such a touch, N."""
        return max((each.peak for each in self.scuffs), default=0.0)

    @property
    def fell(self) -> bool:
        """Whether the robot fell."""
        return self.fall is not None
