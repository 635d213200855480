"""write_run: every file of a run into its folder."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toolkit.pipeline.loop import PipelineResult
from toolkit.pipeline.trial import Trial
from toolkit.report.arrays import write_execution, write_motion
from toolkit.report.files import EXECUTION, MOTION, PLAN, RECORDING, REPORT, SCENE, write_scene
from toolkit.report.plan_file import write_plan
from toolkit.report.run_report import RunReport, write_report


@dataclass(frozen=True)
class RunOptions:
    """What is written of a run beside its report, plan, motion and execution.

    Attributes:
        recording: Whether to write the recording for the viewer.
        pictures: Whether to draw the plan from above, the curves and a strip of pictures.
        video: Whether to render a video.
        surface_seconds: Wall-clock of loading the world, for the report; None where nobody measured it.
        settings: Further settings worth keeping in the report.
    """

    recording: bool = True
    pictures: bool = False
    video: bool = False
    surface_seconds: float | None = None
    settings: dict[str, Any] = field(default_factory=dict)


def write_run(folder: Path, result: PipelineResult, options: RunOptions = RunOptions()) -> RunReport:
    """Write every file of a run, as far as the run came; see `toolkit.report.files` for their names.

    Args:
        folder: Existing folder to write into (`RunFolder.path`).
        result: What the pipeline returned.
        options: What to write.

    Returns:
        The report.

    Raises:
        InputError: pictures or a video were asked for and this machine cannot render.
    """
    report = RunReport.of(result, options.surface_seconds, options.settings)
    trial = result.trial
    if trial is not None:
        write_plan(folder / PLAN, trial.plan, trial.solution)
        write_motion(folder / MOTION, trial.plan.motion, trial.trajectory)
        if trial.execution is not None:
            write_execution(folder / EXECUTION, trial.execution)
            write_scene(folder / SCENE, trial.execution.scene)
    if options.recording:
        from toolkit.report.recording import write_recording  # rerun takes its time to load

        write_recording(folder / RECORDING, result, report)
    if trial is not None and options.pictures:
        _draw_pictures(folder, trial)
    if trial is not None and (options.pictures or options.video):
        _render(folder, trial, options)
    write_report(folder / REPORT, report)
    return report


def _draw_pictures(folder: Path, trial: Trial) -> None:
    """The plan from above and the curves."""
    from toolkit.report.plots import draw_plots
    from toolkit.report.top_view import draw_top_view

    execution = trial.execution
    draw_top_view(folder / "plan.png", trial.plan, trial.solution, None if execution is None else execution.samples.com)
    if execution is not None:
        draw_plots(folder / "execution.png", execution, trial.plan.schedule)


def _render(folder: Path, trial: Trial, options: RunOptions) -> None:
    """The strip and the video of the simulated run, where there is one."""
    from toolkit.report.offscreen import Patches
    from toolkit.report.pictures import strip, video

    execution, sequence = trial.execution, trial.plan.sequence
    if execution is None or not len(execution.samples.tick_times):
        return
    patches, samples = Patches(sequence.contacts, trial.plan.robot.half_sizes), execution.samples
    if options.pictures:
        strip(execution.scene, samples.qpos, samples.tick_times, folder / "strip.png", patches=patches)
    if options.video:
        video(execution.scene, samples.qpos, samples.tick_times, folder / "video.mp4", patches=patches)
