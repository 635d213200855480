"""One attempt at a clip: a random world, planned and executed, and what is kept of it."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.clips.terrain import random_world
from toolkit.drafts import remove, write_whole
from toolkit.errors import InputError, ToolkitError
from toolkit.exchange.folder import FILES, write_export
from toolkit.exchange.frames import MotionFrames, frames_of
from toolkit.exchange.record import read_run
from toolkit.pipeline import PipelineConfig, PipelineResult, make_planner, run
from toolkit.report.files import REPORT, RunFolder, plain, read_json
from toolkit.report.run import RunOptions, write_run
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from toolkit.search.planner_config import PlannerConfig
from toolkit.world.loader import load_world
from toolkit.world.scaling import Fit, scaled

CLIPS, RUNS, ATTEMPTS, ROBOT = "clips", "runs", "attempts", "robot"
"""Folders of a data set: the motions, the runs that replay them, a record of each attempt, and the robot."""
WORLD = "world.xml"
"""The world of a clip, in its folder and in that of its run."""
_ROBOT_FROM_CLIP = f"../../{ROBOT}"

Record = dict[str, Any]


@dataclass(frozen=True)
class ClipConfig:
    """What every clip of a data set is made with.

    Attributes:
        robot: Name of the robot.
        robots: Folder that holds it.
        kinds: Keys of `toolkit.clips.terrain.KINDS`; they take turns.
        planner: Who judges transitions (see `toolkit.pipeline.make_planner`), "auto" already resolved.
        planning: Settings of the planner.
        networks: Digest of the robot's networks, so that a data set goes on with the same ones; "" without.
        seed: Seed of every random draw.
        time_limit: s for each contact search.
        candidates: Contact sequences of a world that are tested at most.
        format: A key of `toolkit.exchange.formats.FORMATS`.
        fps: Frames per second.
    """

    robot: str
    robots: str
    kinds: tuple[str, ...]
    planner: str = "kinematic"
    planning: PlannerConfig = field(default_factory=PlannerConfig)
    networks: str = ""
    seed: int = 0
    time_limit: float = 120.0
    candidates: int = 6
    format: str = "npz"
    fps: float = 50.0


def name_of(index: int) -> str:
    """Name of an attempt, and of the folders of its clip and its run."""
    return f"{index:06d}"


@lru_cache(maxsize=2)
def _robot_of(name: str, robots: str) -> RobotModel:
    """The robot, loaded once per process."""
    return load_robot(name, Path(robots))


def attempt(config: ClipConfig, index: int, folder: str) -> Record:
    """Make the attempt with this index, a pure function of its arguments but for times; see `kept_figures`.

    A run that passed is written into the data set at `folder`: the run first, then the clip, the record last, so that
    an attempt without a record is made again. An error in a world is its reason, and does not stop the others.

    Raises:
        InputError: The data set cannot be written.
    """
    began, busy, place = time.perf_counter(), time.process_time(), Path(folder)
    rng = np.random.default_rng([config.seed, index])
    kind = config.kinds[index % len(config.kinds)]
    text, options = random_world(kind, rng)
    text = scaled(text, Fit.of(_robot_of(config.robot, config.robots)).factor)
    seed = int(rng.integers(2**31))
    record: Record = {"attempt": index, "kind": kind, "options": options, "seed": seed, "passed": False}
    try:
        result = _run(config, kind, text, seed)
        record |= {"stage": result.stage, "reason": result.reason}
    except ToolkitError as error:
        result, record = None, record | {"stage": "planning", "reason": " ".join(str(error).split())}
    except Exception as error:  # whatever it is, this world has failed, and the next one may not
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        result, record = None, record | {"stage": "error", "reason": reason}
    if result is not None and result.passed:
        record |= _keep(config, place, index, text, result)
    record |= {"seconds": time.perf_counter() - began, "processor_seconds": time.process_time() - busy}
    _write_record(place, index, record)
    return record


def _run(config: ClipConfig, kind: str, text: str, seed: int) -> PipelineResult:
    """Plan and execute in a world."""
    robot, world = _robot_of(config.robot, config.robots), load_world(f"{kind}.xml", mjcf=text)
    planner = make_planner(robot, world, config.planner, config.planning)
    settings = PipelineConfig(seed=seed, time_limit=config.time_limit, candidates=config.candidates)
    return run(robot, world, planner, settings)


def _keep(config: ClipConfig, place: Path, index: int, text: str, result: PipelineResult) -> Record:
    """Write the run and the clip of an attempt that passed; returns what its record says of them."""
    name, names = name_of(index), (result.world.name, result.robot.name)
    settings = {"planner": config.planner, "robot": config.robot}
    with RunFolder(place / RUNS / name, *names, [WORLD]) as run_folder:
        write_run(run_folder.path, result, RunOptions(recording=False, settings=settings))
        (run_folder.path / WORLD).write_text(text, encoding="utf-8")
    saved = read_run(place / RUNS / name)
    frames = frames_of(saved, result.robot, config.fps)
    with RunFolder(place / CLIPS / name, *names, [WORLD], FILES, "export") as clip:
        write_export(clip.path, config.format, saved, result.robot, frames, robot_folder=_ROBOT_FROM_CLIP)
        (clip.path / WORLD).write_text(text, encoding="utf-8")
    return {"passed": True, **kept_figures(result, frames)}


def kept_figures(result: PipelineResult, frames: MotionFrames) -> Record:
    """What is told of a clip; `duration` in s, `distance` from the first to the last CoM seen from above in m.

    `speed` is the distance over the duration, rests included, and `top_speed` the CoM's largest one, both in m/s.
    """
    trial = result.trial
    assert trial is not None and trial.execution is not None
    execution, made = trial.execution, [t for t in trial.plan.sequence.transitions if t.contact is not None]
    duration = float(frames.times[-1] - frames.times[0])
    distance = float(np.linalg.norm(frames.com[-1, :2] - frames.com[0, :2]))
    speeds = np.linalg.norm(frames.linear_momentum, axis=1) / result.robot.mass
    return {
        "duration": duration,
        "frames": len(frames.times),
        "fps": frames.fps,
        "transitions": len(trial.plan.sequence.transitions),
        "contacts": len(made),
        "palm_contacts": sum(not transition.limb.is_foot for transition in made),
        "distance": distance,
        "speed": distance / max(duration, 1e-9),
        "top_speed": float(speeds.max()),
        **{name: float(getattr(execution, name)) for name in MEASURED},
    }


MEASURED = ("max_slip", "max_scuff", "max_torque_ratio", "max_velocity_ratio", "com_rms_error", "final_goal_distance")
"""Figures of an execution that a clip's record has."""


def _write_record(place: Path, index: int, record: Record) -> None:
    """Keep what is known of an attempt."""
    text = json.dumps(plain(record), allow_nan=False, ensure_ascii=False, indent=1)
    write_whole(place / ATTEMPTS / f"{name_of(index)}.json", f"{text}\n".encode())


def read_records(place: Path) -> dict[int, Record]:
    """Records of a data set by the attempt's index; a file that is none, or whose clip is gone, is left out."""
    found = {}
    for path in sorted((place / ATTEMPTS).glob("[0-9]*.json")):
        try:
            record = read_json(path)
            index = int(record["attempt"])
            whole = not record["passed"] or (float(record["duration"]) > 0.0 and has_clip(place, index))
        except (InputError, KeyError, TypeError, ValueError):
            continue
        if whole and path.stem == name_of(index):
            found[index] = record
    return found


def has_clip(place: Path, index: int) -> bool:
    """Whether a data set has the clip of an attempt; its run may have been removed."""
    return (place / CLIPS / name_of(index) / REPORT).is_file()


def remove_attempt(place: Path, index: int) -> None:
    """Remove all that an attempt has left; its record goes first."""
    remove(place / ATTEMPTS / f"{name_of(index)}.json")
    for kind in (CLIPS, RUNS):
        remove(place / kind / name_of(index))
