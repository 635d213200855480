"""Simulation: a robot in its scene, one control tick after another, measured; runs and replays step alike."""

from __future__ import annotations

import mujoco
import numpy as np

from toolkit.execution.recorder import Recorder


class Simulation:
    """A scene that runs under given controls, and what is measured in it.

    Attributes:
        recorder: The measurements.
        qpos, qvel: The present state (nq,) and (nv,), changed in place.
    """

    def __init__(self, recorder: Recorder, qpos: np.ndarray, qvel: np.ndarray):
        self.recorder = recorder
        self.qpos, self.qvel = qpos.copy(), qvel.copy()
        self._data = mujoco.MjData(recorder.scene)
        self._data.qpos[:], self._data.qvel[:] = qpos, qvel

    @property
    def steps(self) -> int:
        """Number of physics steps that were taken."""
        return self.recorder.steps

    def run_tick(self, ctrl: np.ndarray, push: np.ndarray | None) -> None:
        """Take the physics steps of one control tick; the first of them is sampled.

        Args:
            ctrl: (n, nu) controls, one row per physics step.
            push: (n, 3) N at the base, in the world; None where nothing pushes.
        """
        data, recorder = self._data, self.recorder
        for part, row in enumerate(ctrl):
            data.ctrl[:] = row  # in every step, since MuJoCo clears it where a state diverges
            if push is not None:
                data.xfrc_applied[recorder.index.base, :3] = push[part]
            mujoco.mj_step(recorder.scene, data)
            recorder.read(data)
            if part == 0:
                recorder.record(data, self.qpos, self.qvel)
            self.qpos[:], self.qvel[:] = data.qpos, data.qvel
