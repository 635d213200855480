"""RunRecord: what a run wrote into its folder, read back."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import InputError
from toolkit.report.files import EXECUTION, MOTION, PLAN, REPORT, SCENE, read_json
from toolkit.report.plan_file import read_plan
from toolkit.report.saved_run import read_arrays, read_scene
from toolkit.robot.model import RobotModel

_EXECUTED = ("scene_digest", "tick_times", "qpos", "qvel", "torque", "wrench", "wrench_planned", "limb_pose")
_TRAJECTORY = ("times", "qpos", "qvel", "torque")
_MOTION = (
    *(f"wholebody_{name}" for name in _TRAJECTORY),
    *(f"centroidal_{name}" for name in ("times", "com", "linear_momentum", "angular_momentum", "problem_mass")),
    "centroidal_problem_half_size",
)


@dataclass(frozen=True)
class RunRecord:
    """A run as its folder holds it.

    Attributes:
        folder: The folder.
        report: Content of report.json.
        sequence: The contacts of plan.json.
        schedule: When they hold, from 0 to the end of the planned motion.
        scene: The model that ran: the robot and, with the prefix `world/`, the world.
        execution: Arrays of execution.npz: `tick_times` (C,) s, and a row for each of them in the others.
        motion: Arrays of motion.npz.
    """

    folder: Path
    report: dict[str, Any]
    sequence: ContactSequence
    schedule: ContactSchedule
    scene: mujoco.MjModel = field(repr=False)
    execution: dict[str, np.ndarray] = field(repr=False)
    motion: dict[str, np.ndarray] = field(repr=False)

    @property
    def robot_option(self) -> str:
        """The robot that the run was told to use, a name or a path; the name of the one that it used where not told."""
        return str(self.report["options"].get("robot", self.report["robot"]))


def read_run(folder: Path) -> RunRecord:
    """Read a folder that `python -m toolkit.validate` wrote.

    Raises:
        InputError: It is no such folder, the run never came to its execution, or a file is broken.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; name one that python -m toolkit.validate wrote")
    for name in (REPORT, PLAN, MOTION, EXECUTION, SCENE):
        if not (folder / name).is_file():
            raise InputError(f"{folder}: has no {name}; only a run that came to its execution can be exported")
    report = _report(folder / REPORT)
    sequence, motion = read_plan(folder / PLAN), _arrays(folder / MOTION, _MOTION)
    execution = _arrays(folder / EXECUTION, _EXECUTED)
    scene = read_scene(folder / SCENE, str(execution.pop("scene_digest")))
    execution["qpos"] = execution["qpos"][: len(execution["tick_times"])]  # the last row is the state after the run
    _check_arrays(folder, scene, execution, motion)
    return RunRecord(folder, report, sequence, _schedule(folder, sequence, motion), scene, execution, motion)


def check_robot(record: RunRecord, robot: RobotModel) -> None:
    """Raise unless the robot is the one that ran.

    Raises:
        InputError: Its joints, bodies or limbs are others.
    """
    scene, alone = record.scene, robot.mujoco_model
    joints = tuple(scene.joint(j).name for j in range(1, scene.njnt))
    bodies = [scene.body(b).name for b in robot_bodies(scene)]
    sites = {scene.site(s).name for s in range(scene.nsite)}
    used = {contact.limb for stance in record.sequence.stances for contact in stance.contacts}
    same = joints == robot.joint_names and bodies == [alone.body(b).name for b in range(1, alone.nbody)]
    if not same or used - robot.limbs.keys() or {model.site for model in robot.limbs.values()} - sites:
        raise InputError(
            f"{robot.folder}: is not the robot of {record.folder}, whose joints, bodies or limbs are others; "
            "give the right one with --robot"
        )


def robot_bodies(scene: mujoco.MjModel) -> np.ndarray:
    """(b,) int; bodies of the robot in MuJoCo's order, the base first."""
    return np.flatnonzero(scene.body_rootid == scene.jnt_bodyid[0])


def _report(path: Path) -> dict[str, Any]:
    """The report of a run, with what an export says of it."""
    report = read_json(path)
    kinds = {"world": str, "robot": str, "verdict": str, "reason": str, "seed": int, "options": dict, "versions": dict}
    wrong = [name for name, kind in kinds.items() if not isinstance(report, dict) or type(report.get(name)) is not kind]
    if wrong:
        raise InputError(f"{path}: has no valid {wrong[0]}; it is not the report of a run")
    return report


def _arrays(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Some arrays of an npz file."""
    content = read_arrays(path)
    missing = [name for name in names if name not in content]
    if missing:
        raise InputError(f"{path}: lacks {missing[0]}; it is not the record of a run that was executed")
    return {name: content[name] for name in names}


def _check_arrays(
    folder: Path, scene: mujoco.MjModel, execution: dict[str, np.ndarray], motion: dict[str, np.ndarray]
) -> None:
    """Raise where the arrays do not belong to the scene or to each other, or the states are no states."""
    states = {"qpos": (scene.nq,), "qvel": (scene.nv,), "torque": (scene.nu,)}
    limbs = {"wrench": (4, 6), "wrench_planned": (4, 6), "limb_pose": (4, 7)}
    curves = dict.fromkeys(("com", "linear_momentum", "angular_momentum"), (3,))
    for name, arrays, prefix, times, tails in (
        (EXECUTION, execution, "", "tick_times", states | limbs),
        (MOTION, motion, "wholebody_", "wholebody_times", states),
        (MOTION, motion, "centroidal_", "centroidal_times", curves),
    ):
        grid = arrays[times]
        if grid.ndim != 1 or len(grid) < 1 or not (np.isfinite(grid).all() and (np.diff(grid) > 0.0).all()):
            raise InputError(f"{folder / name}: {times} are no increasing times")
        for key, tail in tails.items():
            if arrays[prefix + key].shape != (len(grid), *tail):
                raise InputError(f"{folder / name}: {prefix + key} does not belong to {SCENE}; take all from one run")
            if key in ("qpos", "qvel", "torque", "com") and not np.isfinite(arrays[prefix + key]).all():
                raise InputError(f"{folder / name}: {prefix + key} is not finite everywhere; such a run has no motion")


def _schedule(folder: Path, sequence: ContactSequence, motion: dict[str, np.ndarray]) -> ContactSchedule:
    """When the contacts hold; the rests before and after the sequence are those of the planned motion."""
    end = float(motion["centroidal_times"][-1])
    entries = read_json(folder / PLAN)["transitions"]
    try:
        initial = float(entries[0]["times"]["start"]) if entries else 0.0
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{folder / PLAN}: transitions[0] has no valid start ({error})") from error
    final = end - sequence.duration - initial
    if not (initial >= 0.0 and final > -1e-6):
        raise InputError(f"{folder / PLAN}: its times do not belong to {MOTION}; take both from one run")
    return ContactSchedule.of(sequence, initial_rest=initial, final_rest=max(final, 0.0))
