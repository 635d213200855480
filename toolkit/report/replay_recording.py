"""The recording of a replay for the rerun viewer, made of nothing but a run's files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import rerun as rr

from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.drafts import write_whole
from toolkit.execution.result import Execution
from toolkit.report.blueprint import blueprint
from toolkit.report.draw import draw_goal, draw_scene, recording
from toolkit.report.motion_scene import draw_centres, draw_motion, draw_plan, frames
from toolkit.report.recording import APPLICATION, draw_execution
from toolkit.report.run_report import RunReport
from toolkit.report.series import send_contact_states
from toolkit.report.summary import summary

RATE = 30.0
"""Hz of everything drawn in 3D."""


def write_replay_recording(path: Path, report: RunReport, again: Execution, sequence: ContactSequence) -> None:
    """Write the recording of a replay: the robot, its CoM, contacts, forces and curves, as simulated anew.

    Args:
        path: File to write; it appears whole or not at all.
        report: The report of the recorded run.
        again: The replay.
        sequence: The planned contacts.

    Raises:
        InputError: It cannot be written.
    """
    standard, samples = again.standard, again.samples
    half_sizes = standard.robot.half_sizes
    schedule = schedule_of(sequence, again)
    way = np.array([*(stance.mean_feet.position for stance in sequence.stances), standard.goal.position])
    verdict, reason = ("PASS", "") if again.failure is None else ("FAIL", again.failure.reason)
    said = replace(report, verdict=verdict, reason=reason, checks=again.checks)
    with recording(path, APPLICATION, f"replay of {report.robot} in {report.world}", _write) as stream:
        stream.send_blueprint(blueprint(again.scene, way, executed=True, momenta=True, searched=False))
        stream.log("summary", rr.TextDocument(summary(said), media_type=rr.MediaType.MARKDOWN), static=True)
        draw_scene(stream, again.scene)
        draw_goal(stream, standard.goal)
        rows = frames(samples.tick_times, RATE)
        draw_motion(stream, again.scene, samples.tick_times[rows], samples.qpos[rows])
        draw_plan(stream, sequence, schedule, half_sizes)
        draw_centres(stream, schedule, None, None, again, RATE)
        draw_execution(stream, again, None, schedule, half_sizes, RATE)
        send_contact_states(stream, schedule, again)


def schedule_of(sequence: ContactSequence, execution: Execution) -> ContactSchedule:
    """When the contacts of a sequence hold that was executed."""
    moves, times = execution.standard.moves, execution.standard.times
    if not moves:
        return ContactSchedule.of(sequence, final_rest=float(times[-1]))
    rest = moves[0].start - sequence.transitions[0].timing.shift
    return ContactSchedule.of(sequence, initial_rest=rest, final_rest=max(float(times[-1]) - moves[-1].end, 0.0))


def _write(path: Path, content: bytes) -> None:
    """Write the file whole."""
    write_whole(path, content, "--rerun")
