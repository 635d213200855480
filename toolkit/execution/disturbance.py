"""Differences between the simulation and what the controller knows of it."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from toolkit.errors import InputError


@dataclass(frozen=True)
class Disturbance:
    """Differences between the simulated world and the plan; all zero by default.

    Attributes:
        push, push_duration: Horizontal force at the base in N, and for how many s it acts.
        push_time: Time of the push in s; NaN draws a time uniformly over the plan.
        push_direction: Heading of the push in the world in rad; NaN draws one uniformly.
        mass_error: Relative error of all masses and inertias of the robot.
        friction_error: Relative error of every contact between robot and world.
        terrain_offset: Each static geom of the world is moved by up to this much along its own z axis, in m...
        terrain_tilt: ... and turned by up to this much about a random horizontal axis, in rad.
        state_noise: Standard deviation of the state that the controller receives: in m and rad for positions, and ten
            times the number in m/s and rad/s for velocities.
        delay: Age in s of the state that the controller receives.
    """

    push: float = 0.0
    push_duration: float = 0.2
    push_time: float = float("nan")
    push_direction: float = float("nan")
    mass_error: float = 0.0
    friction_error: float = 0.0
    terrain_offset: float = 0.0
    terrain_tilt: float = 0.0
    state_noise: float = 0.0
    delay: float = 0.0

    def __post_init__(self):
        for name in ("push_duration", "terrain_offset", "terrain_tilt", "state_noise", "delay"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise InputError(f"disturbance {name} must be a finite number of at least 0, got {value}")
        for name in ("mass_error", "friction_error"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > -1.0):
                raise InputError(f"disturbance {name} must be a fraction above -1, got {value}")
        if not np.isfinite(self.push):
            raise InputError(f"disturbance push must be a finite force in N, got {self.push}")

    @property
    def replayable(self) -> bool:
        """Whether the controls alone reproduce the run. A push acts beside them."""
        return self.push == 0.0

    def disturb_model(
        self, scene: mujoco.MjModel, robot_geom: np.ndarray, kept: np.ndarray, rng: np.random.Generator
    ) -> None:
        """Change a compiled scene in place.

        Args:
            scene: Robot and world.
            robot_geom: Which geoms (ngeom,) belong to the robot.
            kept: Which static geoms (ngeom,) stay where they are because the robot starts on them.
            rng: Random generator for the displacements of the terrain.
        """
        if self.mass_error:
            bodies = np.unique(scene.geom_bodyid[robot_geom])
            bodies = np.flatnonzero(scene.body_rootid == scene.body_rootid[bodies[0]])
            scene.body_mass[bodies] *= 1.0 + self.mass_error
            scene.body_inertia[bodies] *= 1.0 + self.mass_error
            mujoco.mj_setConst(scene, mujoco.MjData(scene))
        if self.friction_error:
            scene.geom_friction[~robot_geom, 0] *= 1.0 + self.friction_error
        if self.terrain_offset or self.terrain_tilt:
            # The compiled tree of bounding boxes holds the old places of the static geoms.
            scene.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
            for geom in np.flatnonzero(~robot_geom & ~kept):
                self._displace(scene, int(geom), rng)

    def _displace(self, scene: mujoco.MjModel, geom: int, rng: np.random.Generator) -> None:
        """Move one static geom along its own z axis and tilt it about its centre."""
        quaternion = scene.geom_quat[geom].copy()
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, quaternion)
        scene.geom_pos[geom] += rng.uniform(-1.0, 1.0) * self.terrain_offset * matrix[2::3]
        heading, angle = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-1.0, 1.0) * self.terrain_tilt
        turn = np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, np.array([np.cos(heading), np.sin(heading), 0.0]), angle)
        mujoco.mju_mulQuat(scene.geom_quat[geom], turn, quaternion)

    def draw_push(self, duration: float, rng: np.random.Generator) -> tuple[float, np.ndarray]:
        """Begin of the push in s, within the plan's duration in s, and its force (3,) in N."""
        time, heading = rng.uniform(0.0, duration), rng.uniform(0.0, 2.0 * np.pi)
        time = time if np.isnan(self.push_time) else self.push_time
        heading = heading if np.isnan(self.push_direction) else self.push_direction
        return time, self.push * np.array([np.cos(heading), np.sin(heading), 0.0])


class StateFilter:
    """Delays states and adds noise to them, as a controller with a tick every `period` s receives them."""

    def __init__(self, disturbance: Disturbance, period: float, rng: np.random.Generator):
        self._noise, self._rng = disturbance.state_noise, rng
        self._delay = round(disturbance.delay / period)
        self._past: list[tuple[np.ndarray, np.ndarray]] = []

    def __call__(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The delayed and noisy state for a true one; (7 + n,) and (6 + n,)."""
        if not self._delay and not self._noise:
            return qpos, qvel
        self._past.append((qpos.copy(), qvel.copy()))
        if len(self._past) > self._delay + 1:
            self._past.pop(0)
        qpos, qvel = self._past[0]
        if self._noise:
            qpos = qpos + self._noise * self._rng.standard_normal(len(qpos))
            qpos[3:7] /= np.linalg.norm(qpos[3:7])
            qvel = qvel + 10.0 * self._noise * self._rng.standard_normal(len(qvel))
        return qpos, qvel
