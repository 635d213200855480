"""RunReport: the content of report.json."""

from __future__ import annotations

import importlib.metadata
import platform
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.centroidal.problem import Weights
from toolkit.centroidal.residual import check, cop_margin, friction_margin, objective
from toolkit.errors import InputError
from toolkit.execution.check import Check
from toolkit.execution.result import Execution
from toolkit.pipeline.candidate import Candidate
from toolkit.pipeline.loop import PipelineResult
from toolkit.report.files import REPORT, check_entries, read_check, read_json, scuff_entries, write_json
from toolkit.world.world import World

SCHEMA = 3
PACKAGES = ("mujoco", "placo", "pin", "daqp", "numpy", "scipy", "numba", "rerun-sdk")

SURFACES = ("count", "foot", "palm", "seconds")
PLANNING = (
    "found",
    "first_feasible_seconds",
    "first_feasible_optimiser_seconds",
    "seconds",
    "heuristic_seconds",
    "expansions",
    "solutions",
    "contacts",
    "palm_contacts",
    "sequences",
    "sequences_tested",
)
DYNAMICS = (
    "feasible",
    "seconds",
    "true_cost",
    "cost_terms",
    "objective",
    "paper_objective",
    "plan_seconds",
    "walking_seconds",
    "max_residual",
    "min_friction_margin",
    "min_cop_margin",
    "status",
)
WHOLEBODY = ("feasible", "seconds", "max_position_error", "max_orientation_error", "limits_respected", "reason")
EXECUTION = (
    "completed",
    "fell",
    "goal_reached",
    "final_goal_distance",
    "max_slip",
    "max_scuff",
    "max_scuff_impulse",
    "max_scuff_force",
    "max_touchdown_error",
    "max_torque_ratio",
    "max_velocity_ratio",
    "com_rms_error",
    "unplanned_contacts",
    "solver_failures",
    "replans",
    "replan_failures",
    "replan_departures",
    "replan_landings",
    "replan_seconds",
    "simulated_seconds",
    "real_time_factor",
    "tick_seconds",
)
STAGES = dict(surfaces=SURFACES, planning=PLANNING, dynamics=DYNAMICS, wholebody=WHOLEBODY, execution=EXECUTION)
"""Every stage and its figures, in order. The first figure of a stage that was not reached is False, the rest None."""


def versions() -> dict[str, str]:
    """Versions of Python, the toolkit and the packages that affect the result."""
    found = {"python": platform.python_version()}
    for package in ("humanoid-contact-toolkit", *PACKAGES):
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


@dataclass(frozen=True)
class RunReport:
    """Content of report.json.

    Attributes:
        world, robot: Names.
        seed: Seed of every random draw.
        verdict: "PASS" or "FAIL".
        reason: One line where the verdict is FAIL, else "".
        stages: Value of each figure of each stage in `STAGES`; SI units, radians.
        checks: Checks of the verdict.
        options: Further settings of the run.
        versions: Versions of the software.
        warnings: What is doubtful about the robot, one line each.
    """

    world: str
    robot: str
    seed: int
    verdict: str
    reason: str
    stages: dict[str, dict[str, Any]]
    checks: tuple[Check, ...] = ()
    options: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=versions)
    warnings: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, result: PipelineResult, surface_seconds: float | None = None, settings: dict[str, Any] | None = None
    ) -> RunReport:
        """The report of a pipeline's result; the world took `surface_seconds` to load."""
        trial = result.trial
        stages = {
            "surfaces": _surfaces(result.world, surface_seconds),
            "planning": _planning(result),
            "dynamics": _dynamics(result),
            "wholebody": _figures(WHOLEBODY, None if trial is None else trial.trajectory),
            "execution": _execution(None if trial is None else trial.execution),
        }
        verdict, reason = ("PASS", "") if result.passed else ("FAIL", result.reason)
        names = result.world.name, result.robot.name
        return cls(
            *names,
            result.config.seed,
            verdict,
            reason,
            stages,
            result.checks,
            settings or {},
            warnings=result.robot.warnings,
        )

    @classmethod
    def without_search(cls, world: World, robot: str, seed: int, reason: str, settings: dict[str, Any]) -> RunReport:
        """The report of a run that ended before any result, with the error in one line as its reason."""
        stages = {stage: _figures(names, None) for stage, names in STAGES.items()}
        stages["surfaces"] = _surfaces(world, None)
        return cls(world.name, robot, seed, "FAIL", reason, stages, options=settings)

    def as_dict(self) -> dict[str, Any]:
        """The report as report.json holds it."""
        return {
            "schema": SCHEMA,
            "world": self.world,
            "robot": self.robot,
            "seed": self.seed,
            "versions": self.versions,
            "options": self.options,
            "verdict": self.verdict,
            "reason": self.reason,
            "warnings": list(self.warnings),
            "stages": self.stages,
            "checks": check_entries(self.checks),
        }


def write_report(path: Path, report: RunReport) -> None:
    """Write report.json; a number that is not finite, such as a failed check's value, becomes null."""
    write_json(path, report.as_dict())


def report_of(folder: Path) -> RunReport:
    """The report in the folder of a run.

    Raises:
        InputError: The folder has none, or it is broken; see `read_report`.
    """
    if not (folder / REPORT).is_file():
        raise InputError(f"{folder}: holds no {REPORT}, so it is not the folder of a run")
    return read_report(folder / REPORT)


def read_report(path: Path) -> RunReport:
    """Read report.json.

    Raises:
        InputError: The file cannot be read, is of another version, or an entry is missing or wrong.
    """
    content = read_json(path)
    if not isinstance(content, dict) or "schema" not in content:
        raise InputError(f"{path}: is not the report of a run")
    if content["schema"] != SCHEMA:
        raise InputError(f"{path}: has schema {content['schema']}, this version reads {SCHEMA}; run it again")
    where = "the file"
    try:
        stages = {}
        for stage, names in STAGES.items():
            where = f"stages.{stage}"
            stages[stage] = {name: None for name in names} | dict(content["stages"][stage])
        where = "checks"
        checks = tuple(read_check(entry) for entry in content["checks"])
        where = "the file"
        words = {name: str(content[name]) for name in ("world", "robot", "verdict", "reason")}
        if words["verdict"] not in ("PASS", "FAIL"):
            raise ValueError(f"verdict is {words['verdict']}, must be PASS or FAIL")
        return RunReport(
            seed=int(content["seed"]),
            stages=stages,
            checks=checks,
            options=dict(content["options"]),
            warnings=tuple(str(warning) for warning in content.get("warnings", [])),
            versions={str(name): str(version) for name, version in dict(content["versions"]).items()},
            **words,
        )
    except KeyError as error:
        raise InputError(f"{path}: {where} has no valid {error}") from error
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path}: {where} is broken: {error}") from error


def _figures(names: tuple[str, ...], stage: Any) -> dict[str, Any]:
    """Attributes of a stage's result by name; where it was not reached, the first is False and the rest None."""
    if stage is None:
        return {name: False if name == names[0] else None for name in names}
    return {name: getattr(stage, name) for name in names}


def _surfaces(world: World, seconds: float | None) -> dict[str, Any]:
    """Figures of the extracted surfaces."""
    surfaces = world.surfaces
    feet, palms = (sum(serves) for serves in ([s.serves_foot for s in surfaces], [s.serves_palm for s in surfaces]))
    return {"count": len(surfaces), "foot": feet, "palm": palms, "seconds": seconds}


def _planning(result: PipelineResult) -> dict[str, Any]:
    """Figures of the contact search."""
    search, chosen = result.search, None if result.trial is None else result.trial.solution
    solutions = [
        {"seconds": s.seconds, "cost": s.cost, "contacts": len(s.sequence.transitions), "bound": s.bound}
        for s in search.solutions
    ]
    chosen = chosen or (search.solutions[-1] if search.solutions else None)
    first = result.first_feasible
    made = [t.limb for t in chosen.sequence.transitions if t.contact is not None] if chosen else []
    return {
        "found": bool(search.solutions),
        "first_feasible_seconds": None if first is None else first.seconds,
        "first_feasible_optimiser_seconds": None if first is None else first.plan.motion.seconds,
        "seconds": search.seconds,
        "heuristic_seconds": search.heuristic_seconds,
        "expansions": search.expansions,
        "solutions": solutions,
        "contacts": len(chosen.sequence.transitions) if chosen else None,
        "palm_contacts": sum(not limb.is_foot for limb in made) if chosen else None,
        "sequences": [_sequence(result, candidate) for candidate in result.candidates],
        "sequences_tested": len(result.trials),
    }


def _sequence(result: PipelineResult, candidate: Candidate) -> dict[str, Any]:
    """Figures of one sequence that was optimised."""
    return {
        "number": candidate.number,
        "source": candidate.source,
        "search": candidate.search,
        "seconds": candidate.seconds,
        "transitions": len(candidate.solution.sequence.transitions),
        "palm_contacts": candidate.palm_contacts,
        "predicted_cost": candidate.solution.predicted,
        "true_cost": candidate.cost.total if candidate.feasible else None,
        "feasible": candidate.feasible,
        "reason": result.reason_against(candidate),
        "chosen": result.is_chosen(candidate),
    }


def _dynamics(result: PipelineResult) -> dict[str, Any]:
    """Figures of the centroidal motion and what it costs; residual and margins are recomputed without the solver."""
    trial, cost = result.trial, result.cost
    if trial is None or cost is None:
        return _figures(DYNAMICS, None)
    motion = trial.plan.motion
    return {
        "feasible": motion.feasible,
        "seconds": motion.seconds,
        "true_cost": cost.total if motion.feasible else None,
        "cost_terms": cost.terms if motion.feasible else None,
        "objective": motion.objective if motion.feasible else None,
        "paper_objective": objective(motion, Weights()) if motion.feasible else None,
        "plan_seconds": cost.seconds,
        "walking_seconds": trial.plan.sequence.duration,
        "max_residual": check(motion).largest,
        "min_friction_margin": friction_margin(motion) if motion.feasible else None,
        "min_cop_margin": cop_margin(motion) if motion.feasible else None,
        "status": motion.outcome,
    }


def _execution(execution: Execution | None) -> dict[str, Any]:
    """Figures of the simulated execution."""
    if execution is None:
        return _figures(EXECUTION, None)
    named = execution.named()
    named |= {name: getattr(execution, name) for name in ("max_scuff_impulse", "max_scuff_force")}
    figures = {name: named[name] for name in EXECUTION}
    figures["tick_seconds"] = _spread(execution.samples.tick_seconds)
    figures["unplanned_contacts"] = len(execution.unplanned_contacts)
    figures["unplanned_contact_geoms"] = [list(pair) for pair in execution.unplanned_contacts]
    figures["scuffs"] = scuff_entries(execution.scuffs)
    figures["fall_reason"] = named["fall_reason"]
    return figures


def _spread(seconds: np.ndarray) -> dict[str, float] | None:
    """Median, 99th percentile and largest of wall-clock times; None where there are none."""
    if not len(seconds):
        return None
    return {"median": float(np.median(seconds)), "p99": float(np.percentile(seconds, 99)), "max": float(seconds.max())}
