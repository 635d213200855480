"""One cell of the map: a world, the whole pipeline, and the outcome with its reason in short words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from toolkit import pipeline
from toolkit.errors import PlanningError
from validation.jobs import ERROR, Record, reason_of
from validation.map_families import Cell
from validation.map_scale import world_of
from validation.options import TrialSettings
from validation.run_trial import StageLog, make_planner, robot_of

PASS, NO_SEQUENCE, IMPOSSIBLE = "PASS", "no sequence found", "proven impossible"
FAILURES = {stage: f"FAIL {stage}" for stage in ("start", "dynamics", "wholebody", "execution")}
OUTCOMES = (PASS, *FAILURES.values(), NO_SEQUENCE, IMPOSSIBLE, ERROR)
CANDIDATES = 6  # sequences that a cell may test after the optimiser

_PROOF = "nothing leads to the goal"  # what the planner's error says where it has proved that there is no way
_LONGEST = 40  # letters of a reason in short words
_REJECTED = re.compile(r"rejected for: ([^,]*?) \d+ %")
_STOPPED = {"every stance": "all stances seen", "time limit": "time", "expansions": "expansions", "memory": "memory"}


def map_trial(settings: TrialSettings, cell: Cell) -> Record:
    """The record of a cell, whose world is to the scale of the robot's legs."""
    robot = robot_of(settings.robot, settings.robots)
    world = world_of(cell, robot.scale.length)
    log = StageLog()
    config = pipeline.PipelineConfig(
        seed=cell.seed,
        time_limit=settings.planning.time_limit,
        candidates=CANDIDATES,
        execution=settings.execution,
    )
    try:
        result = pipeline.run(robot, world, make_planner(settings, world), config, log)
    except PlanningError as error:
        reason = reason_of(error).removeprefix(f"{world.path.name}: ")
        if _PROOF in reason:
            return _record(cell, IMPOSSIBLE, "planning", reason)
        return _record(cell, FAILURES["start"], "start", reason)
    trial, stage = result.trial, result.stage
    outcome = PASS if result.passed else NO_SEQUENCE if trial is None else FAILURES[stage]
    found = _record(cell, outcome, stage, result.reason)
    found |= {"stages": log.entries, "tested": len(result.trials), "expansions": result.search.expansions}
    if trial is not None:
        found["transitions"] = len(trial.plan.sequence.transitions)
        if trial.execution is not None:
            found["failed_checks"] = [check.name for check in trial.execution.checks if check.result != "PASS"]
            found["max_slip"] = trial.execution.max_slip
    return found


def completed(records: list[Record], cells: Mapping[str, Cell]) -> list[Record]:
    """Records of cells with their reasons in short words, and with what those lack that ended in an error."""
    whole = [{**_record(cells[record["name"]], ERROR, "error", ""), **record} for record in records]
    return [record | {"short": in_short(record["outcome"], record["reason"])} for record in whole]


def in_short(outcome: str, reason: str) -> str:
    """A reason in few words without numbers, for pictures; "" of a success."""
    if outcome == PASS:
        return ""
    if outcome == NO_SEQUENCE:
        stopped = next((short for words, short in _STOPPED.items() if words in reason), "")
        rejected = _REJECTED.search(reason)
        return _cut(", ".join(filter(None, [stopped, "" if rejected is None else rejected.group(1)])))
    if outcome == IMPOSSIBLE:
        return _cut(reason.rpartition(": ")[2].partition(";")[0])
    for head in ("no feasible centroidal motion: ", "no whole-body motion: ", "the robot "):
        reason = reason.removeprefix(head)
    reason = re.sub(r"\ba geom of |\b(left|right)_", "", reason)
    return _cut(re.split(r" is -?\d| at \d|, the limit|[;,(]", reason)[0])


def _cut(text: str) -> str:
    """Text of at most `_LONGEST` letters, cut between words, without numbers."""
    text = re.sub(r"-?\d+(\.\d+)?(e[-+]?\d+)?", "#", " ".join(text.split()))
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST].rpartition(' ')[0]} ..."


def _record(cell: Cell, outcome: str, stage: str, reason: str) -> dict[str, Any]:
    """What every record has."""
    return {
        "family": cell.family,
        "values": list(cell.values),
        "seed": cell.seed,
        "outcome": outcome,
        "stage": stage,
        "passed": outcome == PASS,
        "reason": reason,
    }
