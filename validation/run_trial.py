"""One trial: a world, a seed, the whole pipeline; the record says how far it came and what was measured."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from toolkit import pipeline
from toolkit.contacts.sequence import ContactSequence
from toolkit.errors import ToolkitError
from toolkit.execution.config import SCUFF_LIMIT, ExecutionConfig
from toolkit.execution.replay import replay_controls
from toolkit.execution.result import Execution
from toolkit.geometry.limb import PALMS
from toolkit.report.files import REPORT, RunFolder
from toolkit.report.run import RunOptions, write_run
from toolkit.report.run_report import RunReport, write_report
from toolkit.robot.loader import load_robot
from toolkit.robot.model import RobotModel
from toolkit.search.planner import ContactPlanner
from toolkit.world.world import World
from validation.cases import Case
from validation.jobs import reason_of
from validation.options import TrialSettings

WORLD_FILE = "world.xml"  # in a run's folder, to run it again
PLANNING = ("planning", "dynamics", "refinement")  # stages
PALM_FORCE = 5.0  # N; planned palm forces below it are ramps and count nowhere


class StageLog(pipeline.Observer):
    """An observer that remembers how each stage of each sequence ended."""

    def __init__(self):
        """Start empty."""
        self.entries: list[dict[str, Any]] = []

    def finished(self, stage: str, passed: bool, seconds: float, detail: str = "") -> None:
        """Remember."""
        self.entries.append({"stage": stage, "passed": passed, "seconds": seconds, "detail": detail})


@lru_cache(maxsize=2)
def robot_of(name: str, robots: Path) -> RobotModel:
    """The robot, loaded once in each process."""
    return load_robot(name, robots)


def make_planner(
    settings: TrialSettings, world: World, kind: str | None = None, first_only: bool = False
) -> ContactPlanner:
    """The planner of a trial; `kind` in place of that of the settings, `first_only` as in `AnaStarConfig`."""
    config = settings.planning.planner_config()
    config = replace(config, search=replace(config.search, first_only=first_only))
    return pipeline.make_planner(robot_of(settings.robot, settings.robots), world, kind or settings.planner, config)


def run_pipeline(
    settings: TrialSettings, case: Case, world: World, config: pipeline.PipelineConfig
) -> tuple[pipeline.PipelineResult, StageLog]:
    """Run the whole pipeline on a case.

    Raises:
        ToolkitError: it has no start stance, or nothing leads to the goal.
    """
    log = StageLog()
    robot = robot_of(settings.robot, settings.robots)
    config = replace(config, seed=case.seed, time_limit=settings.planning.time_limit)
    return pipeline.run(robot, world, make_planner(settings, world), config, log), log


def execution_trial(settings: TrialSettings, case: Case) -> dict[str, Any]:
    """A record of the experiment `validation.execution`."""
    began = time.perf_counter()
    world = case.world()
    surface_seconds = time.perf_counter() - began
    record: dict[str, Any] = {"kind": case.kind, "seed": case.seed, "planned": False, "passed": False}
    try:
        result, log = run_pipeline(settings, case, world, pipeline.PipelineConfig(execution=settings.execution))
    except ToolkitError as error:
        reason = reason_of(error)
        folder = keep_failure(settings, case, world, reason)
        return record | {"stage": "planning", "reason": reason, "folder": folder}
    trial = result.trial
    record |= {
        "planned": bool(result.search.solutions),
        "tested": len(result.trials),
        "stages": log.entries,
        "planning_seconds": sum(entry["seconds"] for entry in log.entries if entry["stage"] in PLANNING),
        "feasible": trial is not None and trial.plan.motion.feasible,
        "wholebody": trial is not None and trial.trajectory is not None and trial.trajectory.feasible,
        "arrived": False,
        "held": False,
        "stage": result.stage,
        "passed": result.passed,
        "reason": result.reason,
    }
    if trial is not None:
        transitions = trial.plan.sequence.transitions
        record["transitions"] = len(transitions)
        record["palm_contacts"] = sum(not t.limb.is_foot and t.contact is not None for t in transitions)
        record["pace"] = pace_of(trial.plan.sequence)
        if trial.execution is not None:
            record |= executed(trial.execution)
            if record["arrived"] and not record["replays"]:
                record |= {"passed": False, "stage": "replay", "reason": "plain MuJoCo does not replay the run"}
    if not record["passed"]:
        record["folder"] = keep_run(settings, case, result, surface_seconds)
    return record


def executed(execution: Execution) -> dict[str, Any]:
    """What is told of an execution; `held`: everything that a run has to keep to be counted as a success."""
    arrived = execution.completed and not execution.fell and execution.goal_reached
    final = replay_controls(execution.scene, execution.controls)
    figures = {
        "arrived": arrived,
        "replays": bool(np.array_equal(final, execution.controls.final_qpos)),
        "fell": execution.fell,
        "fall_reason": "" if execution.fall is None else execution.fall.reason,
        "simulated_seconds": execution.simulated_seconds,
        "max_slip": execution.max_slip,
        "max_scuff": execution.max_scuff,
        "max_torque_ratio": execution.max_torque_ratio,
        "max_velocity_ratio": execution.max_velocity_ratio,
        "unplanned_contacts": len(execution.unplanned_contacts),
        "unplanned": ["/".join(pair) for pair in execution.unplanned_contacts[:5]],
        "com_rms_error": execution.com_rms_error,
        "max_touchdown_error": execution.max_touchdown_error,
        "final_goal_distance": execution.final_goal_distance,
        "solver_failures": execution.solver_failures,
        "real_time_factor": execution.real_time_factor,
        "tick_median": float(np.median(execution.samples.tick_seconds)),
        "tick_99": float(np.percentile(execution.samples.tick_seconds, 99)),
        "palm_force_error": palm_force_error(execution.samples.wrench, execution.samples.wrench_planned),
        "failed_checks": [check.name for check in execution.checks if check.result != "PASS"],
    }
    return figures | {"held": holds(figures)}


def pace_of(sequence: ContactSequence) -> float | None:
    """Straight distance in XY that the mean of the feet goes, over the time of all transitions, in m/s."""
    first, last = (stance.mean_feet.position[:2] for stance in (sequence.stances[0], sequence.stances[-1]))
    return float(np.linalg.norm(last - first)) / sequence.duration if sequence.transitions else None


def holds(figures: dict[str, Any]) -> bool:
    """Whether a run arrived, is replayable, and kept slip, scuffs, contacts, torques and velocities within bounds."""
    return figures["arrived"] and figures["replays"] and held_within(figures)


def held_within(figures: dict[str, Any]) -> bool:
    """The bounds alone."""
    return (
        figures["max_slip"] <= ExecutionConfig().slip_limit
        and figures["max_scuff"] <= SCUFF_LIMIT
        and figures["unplanned_contacts"] == 0
        and figures["max_torque_ratio"] <= 1.0
        and figures["max_velocity_ratio"] <= 1.0
    )


def palm_force_error(measured: np.ndarray, planned: np.ndarray) -> float | None:
    """Mean deviation of the palms' forces from the plan over the mean planned force, while they are planned to push.

    Args:
        measured: (C, 4, 6) wrenches, force first.
        planned: the same.

    Returns:
        A fraction; None where no palm was planned to push.
    """
    force, wanted = (np.linalg.norm(wrench[:, list(PALMS), :3], axis=-1) for wrench in (measured, planned))
    pushing = wanted > PALM_FORCE
    if not pushing.any():
        return None
    return float(np.abs(force - wanted)[pushing].mean() / wanted[pushing].mean())


def keep_run(
    settings: TrialSettings, case: Case, result: pipeline.PipelineResult, surface_seconds: float, name: str = ""
) -> str:
    """Write the folder of a run, with its world and its recording; returns its path."""
    options = RunOptions(
        recording=settings.recording,
        surface_seconds=surface_seconds,
        settings={"planner": settings.planner, "robot": settings.robot},
    )
    folder = RunFolder(settings.out / "runs" / (name or case.name), result.world.name, settings.robot, [WORLD_FILE])
    with folder:
        write_run(folder.path, result, options)
        (folder.path / WORLD_FILE).write_text(case.mjcf(), encoding="utf-8")
    return shown(folder.target, settings.out)


def keep_failure(settings: TrialSettings, case: Case, world: World, reason: str) -> str:
    """The same for a trial that ended before there was anything but its world."""
    folder = RunFolder(settings.out / "runs" / case.name, world.name, settings.robot, [WORLD_FILE])
    report = RunReport.without_search(world, settings.robot, case.seed, reason, {"planner": settings.planner})
    with folder:
        write_report(folder.path / REPORT, report)
        (folder.path / WORLD_FILE).write_text(case.mjcf(), encoding="utf-8")
    return shown(folder.target, settings.out)


def shown(path: Path, out: Path) -> str:
    """A path in the folder `out` as results show it: relative to the working directory, or below "OUT" elsewhere.

    Results are published, so they name no folder of a machine.
    """
    here = Path.cwd()
    if path.is_relative_to(here):
        return str(path.relative_to(here))
    return str("OUT" / path.relative_to(out.resolve()))
