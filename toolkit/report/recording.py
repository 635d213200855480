"""recording.rrd: a run for the rerun viewer, with the layout it opens in."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import rerun as rr

from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.execution.result import Execution
from toolkit.pipeline.loop import PipelineResult
from toolkit.report.blueprint import blueprint
from toolkit.report.draw import draw_goal, draw_scene, draw_surfaces, recording
from toolkit.report.motion_scene import (
    TIMELINE,
    draw_centres,
    draw_forces,
    draw_made_contacts,
    draw_motion,
    draw_plan,
    draw_search,
    frames,
    standing,
)
from toolkit.report.run_report import RunReport
from toolkit.report.series import plot_execution, plot_motion, send_contact_states, touchdown_entries
from toolkit.report.summary import search_summary, summary
from toolkit.robot.model import RobotModel
from toolkit.wholebody.trajectory import WholeBodyTrajectory
from toolkit.world.world import World

APPLICATION = "humanoid contact planning"


def write_recording(path: Path, result: PipelineResult, report: RunReport, rate: float = 30.0) -> None:
    """Write the recording of a run, as far as the run came.

    Entities: `world/...` is the 3D scene in metres, `series/...` the curves, `contacts/...` the lanes of contacts,
    `search/...` the search on its own timeline, `summary` the text, `events` a log. Time is in seconds of the motion.

    Args:
        path: File to write.
        result: What the pipeline returned; of a search of which no sequence was tested, the newest one is shown.
        report: Verdict and checks for the text.
        rate: Hz of everything drawn in 3D.
    """
    world, robot, search, trial = result.world, result.robot, result.search, result.trial
    solution = sequence = schedule = motion = trajectory = execution = None
    if trial is not None:
        solution, trajectory, execution = trial.solution, trial.trajectory, trial.execution
        sequence, schedule, motion = trial.plan.sequence, trial.plan.schedule, trial.plan.motion
    elif search.solutions:
        solution = search.solutions[-1]
        sequence, schedule = solution.sequence, ContactSchedule.of(solution.sequence)
    executed = execution is not None and len(execution.samples.tick_times) > 0
    feasible = motion is not None and motion.feasible

    with recording(path, APPLICATION, f"{robot.name} in {world.name}") as stream:
        shown = {"executed": executed, "momenta": executed or feasible}
        stream.send_blueprint(blueprint(world.mujoco_model, _way(world, sequence), **shown))
        stream.log("summary", rr.TextDocument(summary(report), media_type=rr.MediaType.MARKDOWN), static=True)
        draw_scene(stream, world.mujoco_model)
        draw_surfaces(stream, world.surfaces)
        draw_goal(stream, world.goal)
        _draw_robot(stream, robot, world, sequence, trajectory, execution if executed else None, rate)
        if sequence is not None:
            draw_plan(stream, sequence, schedule, robot.half_sizes)
        predicted = solution.com if solution is not None else None
        draw_centres(stream, schedule, predicted, motion, execution if executed else None, rate)
        if execution is not None and executed:
            samples, rows = execution.samples, frames(execution.samples.tick_times, rate)
            times, pose = samples.tick_times[rows], samples.limb_pose[rows]
            draw_made_contacts(stream, execution, robot.half_sizes)
            draw_forces(stream, "planned", times, samples.wrench_planned[rows], pose, 0.008)
            draw_forces(stream, "measured", times, samples.wrench[rows], pose, 0.018)
            plot_execution(stream, execution, trajectory, schedule)
            for time, text in touchdown_entries(execution):
                stream.set_time(TIMELINE, duration=time)
                stream.log("events", rr.TextLog(text))
            if execution.fall is not None:
                stream.set_time(TIMELINE, duration=float(execution.samples.tick_times[-1]))
                stream.log("events", rr.TextLog(execution.fall.reason, level=rr.TextLogLevel.ERROR))
            stream.reset_time()
        elif motion is not None and motion.feasible:
            plot_motion(stream, motion)
        send_contact_states(stream, schedule, execution)
        if search is not None:
            text = rr.TextDocument(search_summary(result), media_type=rr.MediaType.MARKDOWN)
            stream.log("search/solutions", text, static=True)
            draw_search(stream, search, _heights(_way(world, sequence)))


def _draw_robot(
    stream: rr.RecordingStream,
    robot: RobotModel,
    world: World,
    sequence: ContactSequence | None,
    trajectory: WholeBodyTrajectory | None,
    execution: Execution | None,
    rate: float,
) -> None:
    """Draw the robot as executed, else as planned, else standing at the start."""
    if execution is not None:
        rows = frames(execution.samples.tick_times, rate)
        draw_motion(stream, execution.scene, execution.samples.tick_times[rows], execution.samples.qpos[rows])
    elif trajectory is not None and len(trajectory.times) and np.isfinite(trajectory.qpos).all():
        rows = frames(trajectory.times, rate)
        draw_motion(stream, robot.mujoco_model, trajectory.times[rows], trajectory.qpos[rows])
    else:
        feet = sequence.start.mean_feet if sequence is not None else world.start
        draw_motion(stream, robot.mujoco_model, np.zeros(1), standing(robot, feet))


def _way(world: World, sequence: ContactSequence | None) -> np.ndarray:
    """(k, 3) m: the mean feet of each stance and the goal, or a straight line from start to goal."""
    goal = np.array(world.goal.position, float)
    if sequence is not None and sequence.transitions:
        return np.array([*(stance.mean_feet.position for stance in sequence.stances), goal])
    return np.linspace(world.start.position, goal, 8)


def _heights(way: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Height in m of the point of the way nearest to each of (n, 2) points: where to draw points of the plane."""

    def heights(points: np.ndarray) -> np.ndarray:
        distance = np.linalg.norm(points[:, None] - way[None, :, :2], axis=-1)
        return way[distance.argmin(1), 2]

    return heights
