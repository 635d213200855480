"""RunReport: what report.json says about a run."""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.centroidal.residual import check, cop_margin, friction_margin
from toolkit.errors import InputError
from toolkit.execution.check import Check
from toolkit.execution.result import Execution
from toolkit.report.checks import check_entries, read_checks
from toolkit.report.files import read_json, write_json
from toolkit.search.result import SearchResult, Solution
from toolkit.wholebody.trajectory import WholeBodyTrajectory
from toolkit.world.surface import Surface

SCHEMA = 2
PACKAGES = ("mujoco", "placo", "pin", "casadi", "daqp", "numpy", "scipy", "numba", "rerun-sdk")

SURFACES = ("count", "foot", "palm", "seconds")
PLANNING = (
    "found",
    "first_solution_seconds",
    "seconds",
    "heuristic_seconds",
    "expansions",
    "solutions",
    "contacts",
    "palm_contacts",
    "sequences_tested",
)
DYNAMICS = ("feasible", "seconds", "objective", "max_residual", "min_friction_margin", "min_cop_margin", "status")
WHOLEBODY = ("feasible", "seconds", "max_position_error", "max_orientation_error", "limits_respected", "reason")
EXECUTION = (
    "completed",
    "fell",
    "goal_reached",
    "final_goal_distance",
    "max_slip",
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
"""Every stage and its figures, in order. A stage that was not reached has its first figure False, the rest None."""


def versions() -> dict[str, str]:
    """Versions of Python, the toolkit and the packages that decide the result."""
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
        world, robot: names.
        seed: of every random draw.
        verdict: "PASS" or "FAIL".
        reason: one line where the verdict is FAIL, else "".
        stages: stage -> figure -> value; SI units, radians; see `STAGES`.
        checks: of the verdict.
        options: further settings of the run worth keeping.
        versions: of the software.
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

    @classmethod
    def of(
        cls,
        *,
        world: str,
        robot: str,
        seed: int,
        passed: bool,
        reason: str,
        surfaces: Sequence[Surface],
        surface_seconds: float | None = None,
        search: SearchResult | None = None,
        solution: Solution | None = None,
        sequences_tested: int = 0,
        motion: CentroidalMotion | None = None,
        trajectory: WholeBodyTrajectory | None = None,
        execution: Execution | None = None,
        checks: Sequence[Check] = (),
        options: dict[str, Any] | None = None,
    ) -> RunReport:
        """Assemble the report of a run from what its stages made; a stage that was not reached is None.

        Args:
            world: name of the world.
            robot: name of the robot.
            seed: of every random draw.
            passed: the verdict.
            reason: one line where it did not pass.
            surfaces: of the world.
            surface_seconds: wall-clock of their extraction.
            search: result of the contact search.
            solution: the one of its solutions that the later stages belong to; None for the newest.
            sequences_tested: contact sequences that were tested.
            motion: centroidal motion.
            trajectory: whole-body trajectory.
            execution: simulated execution.
            checks: of the verdict.
            options: further settings worth keeping.
        """
        stages: dict[str, dict[str, Any]] = {
            "surfaces": {
                "count": len(surfaces),
                "foot": sum(surface.serves_foot for surface in surfaces),
                "palm": sum(surface.serves_palm for surface in surfaces),
                "seconds": surface_seconds,
            },
            "planning": _planning(search, solution, sequences_tested),
            "dynamics": _dynamics(motion),
            "wholebody": _figures(WHOLEBODY, trajectory),
            "execution": _execution(execution),
        }
        verdict = "PASS" if passed else "FAIL"
        return cls(world, robot, seed, verdict, "" if passed else reason, stages, tuple(checks), options or {})

    @property
    def passed(self) -> bool:
        """Whether the verdict is PASS."""
        return self.verdict == "PASS"

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
            "stages": self.stages,
            "checks": check_entries(self.checks),
        }


def write_report(path: Path, report: RunReport) -> None:
    """Write report.json; a number that is not finite becomes null (a failed check's value among them)."""
    write_json(path, report.as_dict())


def read_report(path: Path) -> RunReport:
    """Read report.json.

    A check's value or limit that was not finite comes back as inf, so that the check's result stays the same.

    Raises:
        InputError: the file cannot be read, or a key is missing or wrong.
    """
    content = read_json(path)
    try:
        if content["schema"] != SCHEMA:
            raise InputError(f"{path}: has schema {content['schema']}, this version reads {SCHEMA}")
        checks = read_checks(content["checks"])
        names = ("world", "robot", "seed", "verdict", "reason", "stages")
        return RunReport(
            *[content[name] for name in names],
            checks=checks,
            options=content.get("options", {}),
            versions=content["versions"],
        )
    except (KeyError, TypeError) as error:
        raise InputError(f"{path}: is not a run report, {error} is missing or wrong") from error


def _figures(names: tuple[str, ...], stage: Any) -> dict[str, Any]:
    """Attributes of a stage's result by name; where it was not reached, the first is False and the rest None."""
    if stage is None:
        return {name: False if name == names[0] else None for name in names}
    return {name: getattr(stage, name) for name in names}


def _planning(search: SearchResult | None, solution: Solution | None, tested: int) -> dict[str, Any]:
    """Figures of the contact search."""
    if search is None:
        return _figures(PLANNING, None)
    solutions = [
        {"seconds": s.seconds, "cost": s.cost, "contacts": len(s.sequence.transitions), "bound": s.bound}
        for s in search.solutions
    ]
    chosen = solution or (search.solutions[-1] if search.solutions else None)
    made = [t.limb for t in chosen.sequence.transitions if t.contact is not None] if chosen else []
    return {
        "found": bool(search.solutions),
        "first_solution_seconds": search.solutions[0].seconds if search.solutions else None,
        "seconds": search.seconds,
        "heuristic_seconds": search.heuristic_seconds,
        "expansions": search.expansions,
        "solutions": solutions,
        "contacts": len(chosen.sequence.transitions) if chosen else None,
        "palm_contacts": sum(not limb.is_foot for limb in made) if chosen else None,
        "sequences_tested": tested,
    }


def _dynamics(motion: CentroidalMotion | None) -> dict[str, Any]:
    """Figures of the centroidal motion; residual and margins recomputed in NumPy, not the solver's."""
    if motion is None:
        return _figures(DYNAMICS, None)
    return {
        "feasible": motion.feasible,
        "seconds": motion.seconds,
        "objective": motion.objective if motion.feasible else None,
        "max_residual": check(motion).largest,
        "min_friction_margin": friction_margin(motion) if motion.feasible else None,
        "min_cop_margin": cop_margin(motion) if motion.feasible else None,
        "status": motion.status,
    }


def _execution(execution: Execution | None) -> dict[str, Any]:
    """Figures of the simulated execution."""
    figures = _figures(EXECUTION, execution)
    if execution is not None:
        figures["tick_seconds"] = _spread(execution.tick_seconds)
        figures["unplanned_contacts"] = len(execution.unplanned_contacts)
        figures["unplanned_contact_geoms"] = [list(pair) for pair in execution.unplanned_contacts]
        figures["fall_reason"] = execution.fall_reason
    return figures


def _spread(seconds: np.ndarray) -> dict[str, float] | None:
    """Median, 99th percentile and largest of wall-clock times; None where there are none."""
    if not len(seconds):
        return None
    return {"median": float(np.median(seconds)), "p99": float(np.percentile(seconds, 99)), "max": float(seconds.max())}
