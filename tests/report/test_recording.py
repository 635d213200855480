"""The recording holds every part of a run, at the right place and time, and the layout to look at it."""

import json
from collections import defaultdict
from dataclasses import fields, replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader

from toolkit.contacts.failure import Failure
from toolkit.execution.check import Check
from toolkit.execution.result import Samples
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.pipeline import Trial
from toolkit.report import draw
from toolkit.report.motion_scene import NEWTON_PER_METRE, frames, standing
from toolkit.report.recording import write_recording
from toolkit.report.run_report import RunReport
from toolkit.report.summary import search_summary, summary


class Recording:
    """A recording read back: entity path -> chunks."""

    def __init__(self, path):
        reader = RrdReader(path)
        self.chunks = defaultdict(list)
        (store,) = reader.recordings()
        for chunk in reader.stream(store=store):
            self.chunks[chunk.entity_path].append(chunk)
        self.blueprint = [chunk for store in reader.blueprints() for chunk in reader.stream(store=store)]

    def has(self, prefix):
        return any(path == prefix or path.startswith(prefix + "/") for path in self.chunks)

    def columns(self, path, name, timeline="time"):
        """(n,) s and the list of (k, ...) values of a component at an entity."""
        rows = {}
        for chunk in self.chunks[path]:
            batch = chunk.to_record_batch()
            if timeline not in batch.schema.names:
                continue
            for column in batch.schema.names:
                if column.endswith(":" + name):
                    times = np.array(batch.column(timeline).cast("int64")) * 1e-9
                    rows |= dict(zip(times.tolist(), batch.column(column).to_pylist(), strict=True))
        return np.array(sorted(rows)), [np.array(rows[time]) for time in sorted(rows)]


def write(path, result, report):
    write_recording(path, result, report)
    return Recording(path)


@pytest.fixture(scope="module")
def recording(run, tmp_path_factory):
    return write(tmp_path_factory.mktemp("recording") / "recording.rrd", run.result, run.report)


PATHS = [
    "/world/scene/floor",
    "/world/scene/block\\/one",
    "/world/robot/block",
    "/world/robot/left_leg",
    "/world/surfaces/foot/outline",
    "/world/surfaces/foot/fill",
    "/world/surfaces/palm/outline",
    "/world/goal",
    "/world/plan/left_foot",
    "/world/plan/right_foot/fill",
    "/world/plan/left_palm",
    "/world/plan/held",
    "/world/executed/contacts",
    "/world/com/predicted/path",
    "/world/com/optimised/now",
    "/world/com/executed/now",
    "/world/forces/planned/left_foot",
    "/world/forces/measured/right_foot",
    "/world/search/expanded",
    "/series/tracking/com",
    "/series/tracking/left_foot",
    "/series/linear_momentum/planned",
    "/series/angular_momentum/measured",
    "/series/cop_margin/left_foot",
    "/series/force/left_foot/measured",
    "/series/torque_ratio/largest",
    "/series/slip",
    "/contacts/left_foot/planned",
    "/contacts/left_palm/measured",
    "/search/cost",
    "/search/best_cost",
    "/search/solutions",
    "/search/expanded_states",
    "/events",
    "/summary",
]


def test_every_part_of_the_run_is_there(recording):
    missing = [path for path in PATHS if not recording.has(path)]
    assert not missing, sorted(recording.chunks)


def test_the_layout_shows_every_view_on_the_run_s_timeline(recording):
    batches = [chunk.to_record_batch() for chunk in recording.blueprint]
    names = [(batch, name) for batch in batches for name in batch.schema.names if ":" in name]
    text = "\n".join(f"{name} {batch.column(name).to_pylist()}" for batch, name in names)
    for shown in ("3D", "TimeSeries", "TextDocument", "StateTimeline", "BarChart"):
        assert shown in text
    for origin in ("world", "series/tracking", "series/cop_margin", "series/torque_ratio", "contacts", "summary"):
        assert f"{origin}'" in text, origin
    assert "'time'" in text


def test_time_is_the_motion_s_or_the_search_s_alone(recording):
    timelines = {name for chunks in recording.chunks.values() for chunk in chunks for name in chunk.timeline_names}
    assert timelines == {"time", "search"}


def test_bodies_are_where_mujoco_puts_them(run, recording):
    execution = run.execution
    times, positions = recording.columns("/world/robot/left_leg", "translation")
    _, quaternions = recording.columns("/world/robot/left_leg", "quaternion")
    assert times[0] == 0.0 and len(times) == pytest.approx(30 * execution.samples.tick_times[-1], rel=0.05)
    body = mujoco.mj_name2id(execution.scene, mujoco.mjtObj.mjOBJ_BODY, "left_leg")
    data = mujoco.MjData(execution.scene)
    for row in (0, len(times) // 2, len(times) - 1):
        data.qpos = execution.samples.qpos[np.argmin(np.abs(execution.samples.tick_times - times[row]))]
        mujoco.mj_kinematics(execution.scene, data)
        # single precision in the recording
        np.testing.assert_allclose(positions[row][0], data.xpos[body], rtol=0, atol=1e-6)
        np.testing.assert_allclose(np.roll(quaternions[row][0], 1), data.xquat[body], rtol=0, atol=1e-6)


def test_the_robot_is_there_from_the_first_moment_on_both_timelines(recording):
    for timeline in ("time", "search"):
        times, _ = recording.columns("/world/robot/block", "translation", timeline)
        assert times[0] == 0.0


def test_forces_have_the_stated_scale_and_vanish_without_contact(run, recording):
    times, vectors = recording.columns("/world/forces/planned/left_foot", "vectors")
    drawn = [len(vector) for vector in vectors]
    assert 0 in drawn and max(drawn) == 1
    row = drawn.index(1)
    tick = np.argmin(np.abs(run.execution.samples.tick_times - times[row]))
    force = run.execution.samples.wrench_planned[tick, Limb.LEFT_FOOT, :3]
    np.testing.assert_allclose(NEWTON_PER_METRE * vectors[row][0], force, rtol=1e-6)


def test_slip_changes_with_the_stance(run, recording):
    times, values = recording.columns("/series/slip", "scalars")
    ends = [phase.end for phase in run.plan.schedule.phases if phase.swing is not None]
    np.testing.assert_allclose(times[:-1], [0.0, *ends], rtol=0, atol=1e-6)  # nanoseconds in the recording
    np.testing.assert_allclose(np.ravel(values)[:-1], 1e3 * np.array(run.execution.slip), rtol=1e-9)


def test_made_contacts_add_up(run, recording):
    times, strips = recording.columns("/world/executed/contacts", "strips")
    made = [touch for touch in run.execution.touchdowns if touch["limb"] != "left_palm"]
    # two start contacts, then one for each touchdown; the palm's pose is known, its break has none
    assert len(strips[-1]) >= 2 + len(made)
    assert all(len(a) <= len(b) for a, b in zip(strips, strips[1:], strict=False))
    assert times[0] == 0.0


STAGES = {
    "wholebody": (lambda run: run.only(run.plan), "/series/tracking", "/series/linear_momentum/planned"),
    "dynamics": (lambda run: run.only(run.motion_plan), "/world/com/executed", "/world/com/optimised"),
    "search": (lambda run: replace(run.result, trial=None), "/world/com/optimised", "/world/com/predicted"),
}


@pytest.mark.parametrize(("result", "absent", "present"), STAGES.values(), ids=STAGES)
def test_a_run_that_failed_is_recorded_as_far_as_it_came(run, tmp_path, result, absent, present):
    recording = write(tmp_path / "part.rrd", result(run), run.report)
    assert not recording.has(absent) and recording.has(present)
    assert recording.columns("/world/robot/block", "translation")[0][0] == 0.0


def test_a_search_without_a_solution_and_a_motion_without_sense_are_recorded(run, tmp_path):
    search = replace(run.result.search, solutions=(), expanded=np.zeros((0, 3)), reason="nothing leads there")
    recording = write(tmp_path / "none.rrd", replace(run.result, search=search, trial=None), run.report)
    assert recording.has("/world/robot") and not recording.has("/world/plan")
    motion = replace(run.plan.motion, feasible=False, com=run.plan.motion.com * np.nan)
    recording = write(tmp_path / "broken.rrd", run.only(replace(run.motion_plan, motion=motion)), run.report)
    assert not recording.has("/world/com/optimised")


def test_a_fall_at_once_is_recorded(run, tmp_path):
    execution = run.execution
    cut = Samples(**{item.name: getattr(execution.samples, item.name)[:1] for item in fields(Samples)})
    short = replace(execution, samples=cut, touchdowns=(), slip=(), fall=Failure("tilted by 60 degrees", 0.0))
    recording = write(tmp_path / "fall.rrd", run.only(run.plan, short), run.report)
    (chunk,) = recording.chunks["/events"]
    assert "tilted by 60 degrees" in str(chunk.to_record_batch().to_pydict())


def test_the_summary_states_verdict_checks_and_legend(run):
    text = summary(run.report)
    assert text.startswith("# FAIL: glider in made-up")
    for part in ("slip is 0.03 m", "| slip | 0.03 m | 0.02 m |", "NOT_CHECKED", "1 m = 1000 N", "left foot red"):
        assert part in text
    execution = replace(run.execution, checks=(Check("fall", 0.0, "", 0.0),))
    passed = RunReport.of(replace(run.result, trial=Trial(run.result.candidates[-1], run.plan, execution)))
    assert summary(passed).startswith("# PASS") and "FAIL" not in summary(passed)
    assert json.dumps(passed.as_dict())


def test_the_search_s_summary_has_a_row_per_solution(run):
    text = search_summary(run.result)
    assert "| 0.100 s | 9.000 | unknown | 6 |" in text and "| 0.600 s | 7.000 | 40 % | 6 |" in text
    total = f"{run.result.cost.total:.1f}"
    assert "| 0 | search | 6 | 1 | 9.0 | – | no feasible centroidal motion: it stretches |" in text
    assert f"| 1 | search | 6 | 1 | 7.0 | {total} | chosen |" in text
    nothing = replace(run.result.search, solutions=(), reason="no way")
    assert "**no way**" in search_summary(replace(run.result, search=nothing, trial=None, candidates=()))


def test_frames_keep_the_ends():
    times = np.arange(0, 1.0005, 0.002)
    rows = frames(times, 30.0)
    assert rows[0] == 0 and rows[-1] == len(times) - 1 and len(rows) == 31
    assert frames(np.zeros(0), 30.0).size == 0 and list(frames(np.zeros(1), 30.0)) == [0]


def test_standing_puts_the_home_posture_on_a_frame(run):
    feet = Pose.from_yaw(np.array([1.0, 2.0, 0.5]), np.pi / 2)
    qpos = standing(run.plan.robot, feet)[0]
    np.testing.assert_allclose(qpos[:3], [1.0, 2.0, 0.5 + run.plan.robot.home[2]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(qpos[3:7], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)], rtol=0, atol=1e-12)


def test_a_recording_of_surfaces_alone_needs_no_robot(run, tmp_path):
    with draw.recording(tmp_path / "surfaces.rrd", "surfaces", "made-up\udcff") as stream:
        draw.draw_surfaces(stream, run.plan.world.surfaces)
    assert Recording(tmp_path / "surfaces.rrd").has("/world/surfaces/palm/fill")


def test_a_full_disk_is_an_error_and_no_wait(run):
    with pytest.raises(OSError, match="No space left"), draw.recording(Path("/dev/full"), "surfaces", "x") as stream:
        draw.draw_surfaces(stream, run.plan.world.surfaces)
