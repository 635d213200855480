"""The paper's pictures of plans, each drawn from a run of its own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit import pipeline
from toolkit.errors import PlanningError
from toolkit.report.pictures import strip
from toolkit.report.top_view import draw_top_view
from toolkit.world.loader import load_world
from validation.cases import WORLDS
from validation.jobs import Record, reason_of
from validation.options import TrialSettings
from validation.run_trial import make_planner, robot_of

_FRAMES = 6


@dataclass(frozen=True)
class Picture:
    """A picture of a plan.

    Attributes:
        name: Of the file, without its ending.
        world: Name of a file in worlds/.
        planner: Who judges transitions.
        words: Below the picture.
        title: Name and words of a strip of the simulated run; empty where it is not simulated.
    """

    name: str
    world: str
    planner: str
    words: str
    title: tuple[str, str] | tuple[()] = ()

    @property
    def files(self) -> list[tuple[str, str]]:
        """Names of all its files, with the words below them."""
        return [(self.name, self.words), *([self.title] if self.title else [])]


PICTURES = (
    Picture("plan_gap", "wide_gap", "learned", "Planning example: the wide gap."),
    Picture(
        "plan_slope",
        "steep_slope",
        "learned",
        "Planning example: the steep slope.",
        ("title_slope", "Title, left: down the steep slope."),
    ),
    Picture("plan_field", "rubble_field", "learned", "Planning example: the rubble field."),
    Picture(
        "plan_corridor",
        "rubble_corridor",
        "learned",
        "Planning example: the rubble corridor.",
        ("title_corridor", "Title, right: through the rubble corridor."),
    ),
    Picture("quasi_static_field", "rubble_field", "quasi-static", "Quasi-static: the rubble field."),
    Picture("quasi_static_corridor", "rubble_corridor", "quasi-static", "Quasi-static: the rubble corridor."),
)


def picture_trial(settings: TrialSettings, picture: Picture, folder: Path) -> Record:
    """Make the run of a picture and draw it into a folder; the record says how far the run came."""
    robot = robot_of(settings.robot, settings.robots)
    world = load_world(WORLDS / f"{picture.world}.xml")
    record: Record = {"picture": picture.name, "stage": "planning", "passed": False}
    until = "execution" if picture.title else "dynamics"
    limit = settings.planning.time_limit
    config = pipeline.PipelineConfig(execution=settings.execution, until=until, time_limit=limit)
    try:
        result = pipeline.run(robot, world, make_planner(settings, world, picture.planner), config, pipeline.Observer())
    except PlanningError as error:
        return record | {"reason": reason_of(error)}
    trial = result.trial
    if trial is None:
        return record | {"reason": result.reason}
    folder.mkdir(parents=True, exist_ok=True)
    draw_top_view(folder / f"{picture.name}.png", trial.plan, trial.solution)
    execution = trial.execution
    if execution is not None and picture.title:
        samples = execution.samples
        strip(execution.scene, samples.qpos, samples.tick_times, folder / f"{picture.title[0]}.png", _FRAMES)
    transitions = trial.plan.sequence.transitions
    seconds = float(np.sum(trial.plan.motion.problem.dt)) if trial.plan.motion.feasible else None
    return record | {
        "stage": "done",
        "passed": result.passed,
        "reason": result.reason,
        "transitions": len(transitions),
        "seconds": seconds,
    }
