"""Drawings that move in a recording: the robot, centres of mass, planned and made contacts, forces, the search."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import rerun as rr

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence
from toolkit.execution.result import Execution
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.report.colors import EXECUTED, LIMB_COLORS, OPTIMISED, PREDICTED
from toolkit.report.draw import draw_bodies, draw_patches, patch_outline, patch_outlines
from toolkit.robot.model import RobotModel
from toolkit.search.result import SearchResult

TIMELINE = "time"
SEARCH_TIMELINE = "search"
NEWTON_PER_METRE = 1000.0  # scale of the force arrows
LEAST_FORCE = 1.0  # N; smaller forces are not drawn
MOST_STATES = 5000  # drawn states of a search; more are thinned evenly


def at(times: np.ndarray) -> list[rr.TimeColumn]:
    """Time index of columns for (n,) s on the run's timeline."""
    return [rr.TimeColumn(TIMELINE, duration=np.asarray(times, float))]


def frames(times: np.ndarray, rate: float) -> np.ndarray:
    """Indices of `rate` samples per second, with the first and the last sample."""
    if not len(times):
        return np.zeros(0, int)
    wanted = np.arange(times[0], times[-1], 1 / rate)
    return np.unique([*np.searchsorted(times, wanted - 1e-9), len(times) - 1])


def draw_motion(
    stream: rr.RecordingStream, model: mujoco.MjModel, times: np.ndarray, qpos: np.ndarray, root: str = "world"
) -> None:
    """Draw the moving bodies of `model` below `root` with their poses in it at (n,) s for (n, nq) configurations."""
    entities, data = draw_bodies(stream, model, root), mujoco.MjData(model)
    position, quaternion_wxyz = np.empty((len(times), model.nbody, 3)), np.empty((len(times), model.nbody, 4))
    for row, configuration in enumerate(qpos):
        data.qpos[:] = configuration
        mujoco.mj_kinematics(model, data)
        position[row], quaternion_wxyz[row] = data.xpos, data.xquat
    quaternion_xyzw = np.roll(quaternion_wxyz, -1, axis=-1).astype(np.float32)
    for body, entity in entities.items():
        poses = rr.Transform3D.columns(translation=position[:, body], quaternion=quaternion_xyzw[:, body])
        stream.send_columns(entity, at(times), poses)
        first = rr.Transform3D.columns(translation=position[:1, body], quaternion=quaternion_xyzw[:1, body])
        stream.send_columns(entity, [rr.TimeColumn(SEARCH_TIMELINE, duration=[0.0])], first)


def standing(robot: RobotModel, feet: Pose) -> np.ndarray:
    """(1, 7 + n) home posture moved to `feet`, the upright frame between the feet."""
    qpos = np.array(robot.home, float)
    world_from_base = feet @ Pose.from_quaternion(qpos[:3], qpos[3:7])
    qpos[:3], qpos[3:7] = world_from_base.position, world_from_base.quaternion_wxyz
    return qpos[None]


def draw_com(
    stream: rr.RecordingStream,
    name: str,
    color: tuple[int, int, int],
    path: np.ndarray,
    times: np.ndarray | None,
    moving: np.ndarray | None = None,
    root: str = "world",
) -> None:
    """Draw a CoM as a line along `path` (k, 3) m and, with times (n,) s, as a point that moves along (n, 3) m.

    Where `moving` is None the point moves along `path`. The entities are below `root`.
    """
    line = rr.LineStrips3D([path], radii=0.006, colors=color)
    stream.log(f"{root}/com/{name}/path", line, static=True)
    if times is None:
        return
    points = path if moving is None else moving
    entity = f"{root}/com/{name}/now"
    stream.log(entity, rr.Points3D.from_fields(radii=0.03, colors=color), static=True)
    stream.send_columns(entity, at(times), rr.Points3D.columns(positions=points))


def draw_centres(
    stream: rr.RecordingStream,
    schedule: ContactSchedule | None,
    predicted: np.ndarray | None,
    motion: CentroidalMotion | None,
    execution: Execution | None,
    rate: float,
) -> None:
    """Draw the CoM as predicted by the search, as optimised, and as executed, at `rate` Hz."""
    if predicted is not None:
        times = np.array(schedule.stance_times) if schedule is not None else None
        if times is not None and len(times) == len(predicted):
            grid = np.arange(0.0, times[-1] + 1 / rate, 1 / rate)
            moving = np.column_stack([np.interp(grid, times, predicted[:, axis]) for axis in range(3)])
            draw_com(stream, "predicted", PREDICTED, predicted, grid, moving)
        else:
            draw_com(stream, "predicted", PREDICTED, predicted, None)
        stances = rr.Points3D(predicted, radii=0.012, colors=PREDICTED)
        stream.log("world/com/predicted/stances", stances, static=True)
    if motion is not None and motion.feasible:
        times = np.arange(0.0, motion.problem.times[-1] + 1 / rate, 1 / rate)
        draw_com(stream, "optimised", OPTIMISED, np.array([motion.sample(float(time))[0] for time in times]), times)
    if execution is not None and len(execution.samples.tick_times):
        rows = frames(execution.samples.tick_times, rate)
        draw_com(stream, "executed", EXECUTED, execution.samples.com[rows], execution.samples.tick_times[rows])


def draw_plan(
    stream: rr.RecordingStream,
    sequence: ContactSequence,
    schedule: ContactSchedule | None,
    half_sizes: np.ndarray,
) -> None:
    """Draw the planned contacts, numbered by transition (0 for the start), and those that hold at each time."""
    numbered = [(contact, "0") for contact in sequence.start.contacts]
    numbered += [(t.contact, str(i + 1)) for i, t in enumerate(sequence.transitions) if t.contact is not None]
    for limb in Limb:
        mine = [(contact, label) for contact, label in numbered if contact.limb == limb]
        if mine:
            contacts, labels = zip(*mine, strict=True)
            draw_patches(stream, f"world/plan/{limb.label}", contacts, half_sizes, labels)
    if schedule is None:
        return
    for phase in schedule.phases:
        colors = [LIMB_COLORS[contact.limb] for contact in phase.contacts]
        strips = rr.LineStrips3D(patch_outlines(phase.contacts, half_sizes), radii=0.008, colors=colors)
        stream.set_time(TIMELINE, duration=phase.start)
        stream.log("world/plan/held", strips)
    stream.reset_time()


def draw_made_contacts(stream: rr.RecordingStream, execution: Execution, half_sizes: np.ndarray) -> None:
    """Draw where limbs really made contact, as orange outlines that appear at each touchdown and stay."""
    made: list[np.ndarray] = []
    times = execution.samples.tick_times
    start = [limb for limb in Limb if np.linalg.norm(execution.samples.wrench[:1, limb, :3]) > LEAST_FORCE]
    events = [(0.0, limb) for limb in start]
    events += [(touch["time"], Limb.from_label(touch["limb"])) for touch in execution.touchdowns]
    for time, limb in sorted(events):
        row = min(int(np.searchsorted(times, time)), len(times) - 1)
        pose = execution.samples.limb_pose[row, limb]
        if not np.isfinite(pose).all():
            continue
        made.append(patch_outline(Pose.from_quaternion(pose[:3], pose[3:]), half_sizes[limb]))
        stream.set_time(TIMELINE, duration=time)
        stream.log("world/executed/contacts", rr.LineStrips3D(made, radii=0.003, colors=EXECUTED))
    stream.reset_time()


def draw_forces(
    stream: rr.RecordingStream, name: str, times: np.ndarray, wrench: np.ndarray, pose: np.ndarray, radius: float
) -> None:
    """Draw contact forces as arrows at the centre of pressure, `NEWTON_PER_METRE` to the metre.

    Args:
        stream: The recording.
        name: Part of the entity path, `planned` or `measured`.
        times: (n,) s.
        wrench: (n, 4, 6) N and N m; force and moment about the patch's centre, in the world.
        pose: (n, 4, 7) patch poses: position in m and quaternion wxyz.
        radius: m; of the arrows.
    """
    for limb in Limb:
        force, moment = wrench[:, limb, :3], wrench[:, limb, 3:]
        drawn = np.isfinite(pose[:, limb]).all(1) & (np.linalg.norm(force, axis=1) > LEAST_FORCE)
        if not drawn.any():
            continue
        origins = np.array(
            [
                _centre_of_pressure(Pose.from_quaternion(p[:3], p[3:]), f, m)
                for p, f, m in zip(pose[drawn, limb], force[drawn], moment[drawn], strict=True)
            ]
        )
        entity = f"world/forces/{name}/{limb.label}"
        stream.log(entity, rr.Arrows3D.from_fields(radii=radius, colors=LIMB_COLORS[limb]), static=True)
        arrows = rr.Arrows3D.columns(vectors=force[drawn] / NEWTON_PER_METRE, origins=origins)
        stream.send_columns(entity, at(times), arrows.partition(drawn.astype(int)))


def _centre_of_pressure(pose: Pose, force: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """(3,) world point on the patch about which the moment has no tangential part; the centre where undefined."""
    local_force, local_moment = pose.rotation.T @ force, pose.rotation.T @ moment
    if local_force[2] <= LEAST_FORCE:
        return pose.position
    return pose @ np.array([-local_moment[1] / local_force[2], local_moment[0] / local_force[2], 0.0])


def draw_search(stream: rr.RecordingStream, search: SearchResult, ground: Callable[[np.ndarray], np.ndarray]) -> None:
    """Draw the expanded states as points and the cost of the solutions over the search's own time.

    `ground` maps points (n, 2) m to the heights (n,) m at which they are drawn.
    """
    if len(search.expanded):
        count = min(MOST_STATES, len(search.expanded))
        rows = np.unique(np.linspace(0, len(search.expanded) - 1, count).astype(int))
        states = search.expanded[rows]
        points = np.column_stack([states[:, :2], ground(states[:, :2]) + 0.02])
        age = np.linspace(0, 1, len(points))[:, None]
        colors = ((1 - age) * [70, 90, 200] + age * [250, 220, 60]).astype(np.uint8)
        stream.log("world/search/expanded", rr.Points3D(points, radii=0.012, colors=colors), static=True)
        when = (rows + 1) * search.seconds / len(search.expanded)
        index = [rr.TimeColumn(SEARCH_TIMELINE, duration=when)]
        stream.send_columns("search/expanded_states", index, rr.Scalars.columns(scalars=(rows + 1).astype(float)))
    if not search.solutions:
        return
    seconds = np.array([solution.seconds for solution in search.solutions])
    cost = np.array([solution.cost for solution in search.solutions])
    index = [rr.TimeColumn(SEARCH_TIMELINE, duration=seconds)]
    stream.send_columns("search/cost", index, rr.Scalars.columns(scalars=cost))
    stream.log("search/cost", rr.SeriesPoints(names="cost of the solution", colors=PREDICTED), static=True)
    widths = np.maximum(np.diff([*seconds, max(search.seconds, seconds[-1])]), 1e-3)
    bars = rr.BarChart(cost, abscissa=seconds, widths=widths, color=PREDICTED)
    stream.log("search/best_cost", bars, static=True)
