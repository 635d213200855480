"""write_run: every file of a run into its folder."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any, Protocol

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.schedule import ContactSchedule
from toolkit.execution.check import Check
from toolkit.execution.result import Execution
from toolkit.report.arrays import write_execution, write_motion
from toolkit.report.files import EXECUTION, MOTION, PLAN, RECORDING, REPORT, SCENE, write_scene
from toolkit.report.plan_file import write_plan
from toolkit.report.run_report import RunReport, write_report
from toolkit.robot.model import RobotModel
from toolkit.search.result import SearchResult, Solution
from toolkit.wholebody.trajectory import WholeBodyTrajectory
from toolkit.world.world import World


class TrialLike(Protocol):
    """A tested contact sequence; stages that were not reached are None."""

    @property
    def solution(self) -> Solution:
        """The contact sequence."""
        ...

    @property
    def schedule(self) -> ContactSchedule:
        """When its contacts hold."""
        ...

    @property
    def motion(self) -> CentroidalMotion | None:
        """None where it was not reached."""
        ...

    @property
    def trajectory(self) -> WholeBodyTrajectory | None:
        """None where it was not reached."""
        ...

    @property
    def execution(self) -> Execution | None:
        """None where it was not reached."""
        ...


class ResultLike(Protocol):
    """What the pipeline returns; see `toolkit.pipeline.PipelineResult`."""

    @property
    def robot(self) -> RobotModel:
        """The robot."""
        ...

    @property
    def world(self) -> World:
        """The world."""
        ...

    @property
    def search(self) -> SearchResult:
        """Of the contact search."""
        ...

    @property
    def trial(self) -> TrialLike | None:
        """The trial that the verdict is about; None without a plan."""
        ...

    @property
    def tested(self) -> int:
        """Contact sequences tested."""
        ...

    @property
    def reason(self) -> str:
        """One line where the verdict is FAIL."""
        ...

    @property
    def passed(self) -> bool:
        """The verdict."""
        ...

    @property
    def checks(self) -> tuple[Check, ...]:
        """Of the verdict."""
        ...


def report_of(result: ResultLike, seed: int, surface_seconds: float, options: dict[str, Any]) -> RunReport:
    """The report of a pipeline's result.

    Args:
        result: what the pipeline returned.
        seed: of every random draw.
        surface_seconds: wall-clock of loading the world.
        options: further settings worth keeping.
    """
    trial = result.trial
    return RunReport.of(
        world=result.world.name,
        robot=result.robot.name,
        seed=seed,
        passed=result.passed,
        reason=result.reason,
        surfaces=result.world.surfaces,
        surface_seconds=surface_seconds,
        search=result.search,
        solution=trial.solution if trial else None,
        sequences_tested=result.tested,
        motion=trial.motion if trial else None,
        trajectory=trial.trajectory if trial else None,
        execution=trial.execution if trial else None,
        checks=result.checks,
        options=options,
    )


def write_run(folder: Path, result: ResultLike, args: Namespace, surface_seconds: float) -> RunReport:
    """Write every file of a run, as far as the run came; see `toolkit.report.files` for their names.

    Args:
        folder: existing folder to write into (`RunFolder.path`).
        result: what the pipeline returned.
        args: options of the command: `seed`, and where there are any `no_recording`, `pictures`, `video`.
        surface_seconds: wall-clock of loading the world.

    Returns:
        The report.

    Raises:
        InputError: pictures or a video were asked for and this machine cannot render.
    """
    plain = {name: value for name, value in vars(args).items() if isinstance(value, (bool, int, float, str, Path))}
    options = {name: value for name, value in plain.items() if name not in ("seed", "out")}
    report = report_of(result, args.seed, surface_seconds, options)
    trial, world, robot = result.trial, result.world, result.robot
    if trial is not None:
        sequence = trial.solution.sequence
        initial_rest = _initial_rest(trial)
        plan = folder / PLAN
        write_plan(
            plan, sequence, world=world.name, robot=robot.name, initial_rest=initial_rest, solution=trial.solution
        )
        if trial.motion is not None:
            write_motion(folder / MOTION, trial.motion, trial.trajectory)
        if trial.execution is not None:
            write_execution(folder / EXECUTION, trial.execution)
            write_scene(folder / SCENE, trial.execution.scene)
    if not getattr(args, "no_recording", False):
        from toolkit.report.recording import write_recording  # rerun takes its time to load

        write_recording(
            folder / RECORDING,
            world=world,
            robot=robot,
            report=report,
            search=result.search,
            solution=trial.solution if trial else None,
            schedule=trial.schedule if trial else None,
            motion=trial.motion if trial else None,
            trajectory=trial.trajectory if trial else None,
            execution=trial.execution if trial else None,
        )
    if getattr(args, "pictures", False) or getattr(args, "video", False):
        _write_pictures(folder, result, args)
    write_report(folder / REPORT, report)
    return report


def _initial_rest(trial: TrialLike) -> float:
    """Seconds at rest before the first transition's own shift."""
    transitions = trial.solution.sequence.transitions
    return trial.schedule.phases[0].duration - transitions[0].timing.shift if transitions else 0.0


def _write_pictures(folder: Path, result: ResultLike, args: Namespace) -> None:
    """The pictures that were asked for: the plan from above, the curves, the strip, the video."""
    from toolkit.report.offscreen import Patches
    from toolkit.report.pictures import strip, video
    from toolkit.report.plots import draw_plots
    from toolkit.report.top_view import draw_top_view

    trial = result.trial
    if trial is None:
        return
    execution = trial.execution
    if getattr(args, "pictures", False):
        executed = execution.samples.com if execution is not None else None
        draw_top_view(folder / "plan.png", result.world, result.robot, trial.solution, trial.motion, executed)
        if execution is not None:
            draw_plots(folder / "execution.png", execution, trial.schedule)
    if execution is None or not len(execution.samples.tick_times):
        return
    contacts = list(trial.solution.sequence.start.contacts)
    contacts += [t.contact for t in trial.solution.sequence.transitions if t.contact is not None]
    patches, samples = Patches(contacts, result.robot.half_sizes), execution.samples
    if getattr(args, "pictures", False):
        strip(execution.scene, samples.qpos, samples.tick_times, folder / "strip.png", patches=patches)
    if getattr(args, "video", False):
        video(execution.scene, samples.qpos, samples.tick_times, folder / "video.mp4", patches=patches)
