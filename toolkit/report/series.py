"""Time series of a recording: tracking, momenta, centres of pressure, torques, slip, contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr

from toolkit.centroidal.problem import CentroidalMotion
from toolkit.contacts.schedule import ContactSchedule
from toolkit.execution.result import Execution
from toolkit.geometry.limb import Limb
from toolkit.report.colors import AXES, EXECUTED, LIMB_COLORS, LIMIT, Color
from toolkit.report.motion_scene import LEAST_FORCE, TIMELINE, at
from toolkit.wholebody.trajectory import WholeBodyTrajectory

RATE = 100.0  # Hz; to which series are thinned


def thinned(times: np.ndarray, values: np.ndarray, worst: str = "mean") -> tuple[np.ndarray, np.ndarray]:
    """Cut samples into intervals of 1 / `RATE` and keep one value of each.

    Args:
        times: (n,) s; ascending.
        values: (n, ...) float; NaN where undefined.
        worst: "max", "min" or "mean" of an interval's defined values; NaN where there is none.

    Returns:
        (m,) s; first time of each interval, and (m, ...) values.
    """
    if not len(times):
        return times, values
    _, first = np.unique(np.floor((times - times[0]) * RATE + 1e-6).astype(int), return_index=True)
    undefined = np.isnan(values)
    if worst == "mean":
        total = np.add.reduceat(np.where(undefined, 0.0, values), first)
        count = np.add.reduceat((~undefined).astype(float), first)
        return times[first], np.where(count > 0, total / np.maximum(count, 1), np.nan)
    function, neutral = (np.maximum, -np.inf) if worst == "max" else (np.minimum, np.inf)
    reduced = function.reduceat(np.where(undefined, neutral, values), first)
    return times[first], np.where(np.isinf(reduced), np.nan, reduced)


def plot(
    stream: rr.RecordingStream,
    entity: str,
    times: np.ndarray,
    values: np.ndarray,
    names: str | Sequence[str],
    colors: Color | Sequence[Color],
    width: float = 1.5,
    **style: Any,
) -> None:
    """Send curves (n,) or (n, k) over (n,) s; a NaN leaves a gap. `style` is passed on to `SeriesLines`."""
    values = np.asarray(values, float).reshape(len(times), -1)
    columns = values.shape[1]
    lines = rr.SeriesLines(names=names, colors=colors, widths=[width] * columns, **style)
    stream.log(entity, lines, static=True)
    scalars = rr.Scalars.columns(scalars=values.ravel())
    stream.send_columns(entity, at(times), scalars.partition([columns] * len(times)))


def plot_execution(
    stream: rr.RecordingStream,
    execution: Execution,
    trajectory: WholeBodyTrajectory | None,
    schedule: ContactSchedule | None,
) -> None:
    """Send every series of a simulated run; some need the trajectory or the schedule and are left out without it."""
    samples = execution.samples
    times = samples.tick_times
    if not len(times):
        return
    error = np.linalg.norm(samples.com - samples.com_planned, axis=1)
    plot(stream, "series/tracking/com", *thinned(times, 1e3 * error, worst="max"), "CoM", EXECUTED)
    if trajectory is not None:
        for limb, values in limb_errors(execution, trajectory).items():
            curve = thinned(times, 1e3 * values, worst="max")
            plot(stream, f"series/tracking/{limb.label}", *curve, limb.label, LIMB_COLORS[limb])
    for part, name in ((slice(0, 3), "linear"), (slice(3, 6), "angular")):
        for source, values, width in (("planned", samples.momentum_planned, 1.0), ("measured", samples.momentum, 2.0)):
            names = [f"{axis} {source}" for axis in "xyz"]
            plot(stream, f"series/{name}_momentum/{source}", *thinned(times, values[:, part]), names, AXES, width)
    for limb in Limb:
        mine = LIMB_COLORS[limb]
        if np.isfinite(samples.cop_margin[:, limb]).any():
            curve = thinned(times, 1e3 * samples.cop_margin[:, limb], worst="min")
            plot(stream, f"series/cop_margin/{limb.label}", *curve, limb.label, mine)
        for source, wrench, width in (("planned", samples.wrench_planned, 1.0), ("measured", samples.wrench, 2.0)):
            force = np.linalg.norm(wrench[:, limb, :3], axis=1)
            if force.max() > LEAST_FORCE:
                name = f"{limb.label} {source}"
                plot(stream, f"series/force/{limb.label}/{source}", *thinned(times, force), name, mine, width)
    largest = thinned(times, samples.torque_ratio, worst="max")
    plot(stream, "series/torque_ratio/largest", *largest, "torque / limit", EXECUTED)
    plot(stream, "series/torque_ratio/limit", times[[0, -1]], np.ones(2), "limit", LIMIT, 1.0)
    if execution.slip and schedule is not None:
        edges, values = slip_steps(execution, schedule)
        step = rr.components.InterpolationMode.StepAfter
        plot(stream, "series/slip", edges, 1e3 * values, "slip of the stance", EXECUTED, interpolation_mode=step)


def plot_motion(stream: rr.RecordingStream, motion: CentroidalMotion) -> None:
    """Send the planned momenta of a centroidal motion that was not executed."""
    for name, values in (("linear", motion.linear_momentum), ("angular", motion.angular_momentum)):
        names = [f"{axis} planned" for axis in "xyz"]
        plot(stream, f"series/{name}_momentum/planned", motion.problem.times, values, names, AXES, 1.0)


def limb_errors(execution: Execution, trajectory: WholeBodyTrajectory) -> dict[Limb, np.ndarray]:
    """(C,) m; distance between the measured and the planned patch of each limb that has both."""
    errors = {}
    for limb in Limb:
        planned, measured = trajectory.limb_pose[:, limb, :3], execution.samples.limb_pose[:, limb, :3]
        if np.isfinite(planned).any() and np.isfinite(measured).any():
            axes = [np.interp(execution.samples.tick_times, trajectory.times, planned[:, axis]) for axis in range(3)]
            errors[limb] = np.linalg.norm(measured - np.column_stack(axes), axis=1)
    return errors


def slip_steps(execution: Execution, schedule: ContactSchedule) -> tuple[np.ndarray, np.ndarray]:
    """Slip of k stances: (k + 1,) s with the begin of each and the end of the run; (k + 1,) m, the last one twice."""
    end = float(execution.samples.tick_times[-1])
    edges = np.clip([*schedule.stance_times, end], 0.0, end)
    count = min(len(execution.slip), len(edges) - 1)
    return edges[: count + 1], np.array([*execution.slip[:count], execution.slip[count - 1]])


def send_contact_states(
    stream: rr.RecordingStream, schedule: ContactSchedule | None, execution: Execution | None
) -> None:
    """Send the times at which each limb is in contact, planned and measured, as lanes of states."""
    lanes: dict[tuple[Limb, str], list[tuple[float, bool]]] = {}
    if schedule is not None:
        for phase in schedule.phases:
            held = {contact.limb for contact in phase.contacts}
            for limb in Limb:
                lanes.setdefault((limb, "planned"), []).append((phase.start, limb in held))
        for limb in Limb:
            lanes[limb, "planned"].append((schedule.duration, False))
    if execution is not None and len(execution.samples.tick_times):
        force = np.linalg.norm(execution.samples.wrench[..., :3], axis=-1) > LEAST_FORCE
        for limb in Limb:
            samples = zip(execution.samples.tick_times.tolist(), force[:, limb].tolist(), strict=True)
            lanes[limb, "measured"] = [*samples, (float(execution.samples.tick_times[-1]), False)]
    for (limb, source), samples in lanes.items():
        if not any(held for _, held in samples):
            continue
        entity = f"contacts/{limb.label}/{source}"
        color = LIMB_COLORS[limb] if source == "measured" else tuple(int(0.6 * part) for part in LIMB_COLORS[limb])
        style = rr.StateConfiguration(values=["contact"], labels=[" "], colors=[color])
        stream.log(entity, style, static=True)
        before = False
        for time, held in samples:
            if held != before:
                stream.set_time(TIMELINE, duration=time)
                stream.log(entity, rr.StateChange(state="contact" if held else ""))
            before = held
    stream.reset_time()


def touchdown_entries(execution: Execution) -> list[tuple[float, str]]:
    """Time (s) and text of every touchdown, for the log."""
    entries = []
    for touch in execution.touchdowns:
        late, off = 1e3 * (touch["time"] - touch["planned_time"]), 1e3 * touch["position_error"]
        text = f"{touch['transition'] + 1}: {touch['limb']} touched down {late:+.0f} ms from plan, {off:.1f} mm off"
        entries.append((touch["time"], text))
    return entries
