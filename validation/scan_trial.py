"""One trial of a scanned world: what was found in the scan, and whether a plan made there holds in the real world."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from toolkit.errors import ToolkitError
from toolkit.execution.run import execute
from toolkit.pipeline import PipelineConfig
from toolkit.scanning.building import read_scene
from toolkit.scanning.world import ScanConfig, ScannedWorld, make_world
from toolkit.wholebody.plan import WholeBodyPlan
from toolkit.world.scene import compose_scene
from toolkit.world.surface import Surface
from toolkit.world.world import World
from validation.cases import Case
from validation.jobs import reason_of
from validation.options import TrialSettings
from validation.run_trial import executed, robot_of, run_pipeline
from validation.virtual_scan import virtual_scan

LEAST_OVERLAP = 0.5  # share of a surface's area that has to be found
MOST_ANGLE = np.radians(5.0)
MOST_OFFSET = 0.02  # m along the normal


@dataclass(frozen=True)
class ScanSettings:
    """How worlds are scanned.

    Attributes:
        spacing: m; between the rays.
        noise: m; standard deviation along each axis.
        holes: share of the points that is lost.
        execute: whether plans are made and executed too.
    """

    spacing: float
    noise: float
    holes: float
    execute: bool


def scan_trial(settings: TrialSettings, scanning: ScanSettings, case: Case) -> dict[str, Any]:
    """A record of the experiment `validation.scan`."""
    world = case.world()
    rng = np.random.default_rng([case.seed, 2])
    scan = virtual_scan(world, rng, spacing=scanning.spacing, noise=scanning.noise, holes=scanning.holes)
    record: dict[str, Any] = {"kind": case.kind, "seed": case.seed, "passed": False, "triangles": len(scan.triangles)}
    began = time.perf_counter(), time.process_time()
    try:
        made = made_of(world, read_scene([scan]), case.name)
    except ToolkitError as error:
        return record | {"stage": "scan", "reason": reason_of(error)}
    record |= {
        "scan_seconds": time.perf_counter() - began[0],
        "scan_processor_seconds": time.process_time() - began[1],
        "noise": made.scene.reading.noise,
        "explained": made.scene.explained,
        **compared(world, made.world),
    }
    if not scanning.execute:
        return record | {"stage": "done", "passed": record["found"] >= 0.9 * record["surfaces"], "reason": ""}
    config = PipelineConfig(until="wholebody", execution=settings.execution)
    try:
        result, _ = run_pipeline(settings, case, made.world, config)
    except ToolkitError as error:
        return record | {"stage": "planning", "reason": reason_of(error)}
    record |= {"planned": result.passed, "tested": len(result.trials), "reason": result.reason}
    if not result.passed or result.trial is None or not isinstance(result.trial.plan, WholeBodyPlan):
        return record | {"stage": "planning"}
    robot = robot_of(settings.robot, settings.robots)
    plan = replace(result.trial.plan, world=world, scene=compose_scene(robot, world))
    execution = execute(plan, config=settings.execution, rng=np.random.default_rng([case.seed, 1]))
    passed = execution.failure is None
    reason = "" if execution.failure is None else execution.failure.reason
    return (
        record | executed(execution) | {"stage": "done" if passed else "execution", "passed": passed, "reason": reason}
    )


def made_of(world: World, scene, name: str) -> ScannedWorld:
    """The world that a scene makes, with the start, goal, friction and timing of the one that was scanned."""
    start, goal = world.start, world.goal.position
    config = ScanConfig(
        friction=world.surfaces[0].friction,
        timing=world.timing and (world.timing.shift, world.timing.swing),
        start=(float(start.position[0]), float(start.position[1]), start.yaw),
        goal=(float(goal[0]), float(goal[1])),
    )
    return make_world(scene, Path(f"{name}.xml"), "made of a virtual scan", config)


def compared(world: World, scanned: World) -> dict[str, Any]:
    """How the surfaces of a scanned world fit those of the world itself.

    Returns:
        Counts of the real surfaces, of those found and of scanned ones that are none; and of those found the angles
        between normals in deg, the distances along the normal in m and the shares of the area.
    """
    served = [surface for surface in world.surfaces if surface.serves_foot]
    seen = [surface for surface in scanned.surfaces if surface.serves_foot]
    fits = [max((_fit(real, one) for one in seen), default=(0.0, np.pi, np.inf)) for real in served]
    good = [fit for fit in fits if _is_good(fit)]
    invented = sum(not any(_lies_on(real, one) for real in served) for one in seen)
    return {
        "surfaces": len(served),
        "found": len(good),
        "invented": invented,
        "angles": [float(np.degrees(angle)) for _, angle, _ in good],
        "offsets": [offset for _, _, offset in good],
        "shares": [share for share, _, _ in good],
    }


def _is_good(fit: tuple[float, float, float]) -> bool:
    """Whether a surface counts as found."""
    share, angle, offset = fit
    return share >= LEAST_OVERLAP and angle <= MOST_ANGLE and offset <= MOST_OFFSET


def _fit(real: Surface, found: Surface) -> tuple[float, float, float]:
    """Share of a real surface's area that a found one covers, angle in rad, distance in m where they overlap."""
    overlap = _in_frame(real, found).intersection(real.region)
    if overlap.is_empty:
        return 0.0, np.pi, np.inf
    at = real.pose @ np.array([*overlap.centroid.coords[0], 0.0])
    offset = abs(float((at - found.pose.position) @ found.normal))
    angle = float(np.arccos(np.clip(real.normal @ found.normal, -1.0, 1.0)))
    return overlap.area / real.region.area, angle, offset


def _lies_on(real: Surface, found: Surface) -> bool:
    """Whether most of a found surface lies on a real one."""
    share, angle, offset = _fit(real, found)
    own = share * real.region.area / found.region.area
    return own >= LEAST_OVERLAP and angle <= 2 * MOST_ANGLE and offset <= MOST_OFFSET


def _in_frame(real: Surface, found: Surface) -> BaseGeometry:
    """The region of a found surface in the frame of a real one."""
    local = real.pose.inverse() @ found.pose

    def moved(points: np.ndarray) -> np.ndarray:
        return (local @ np.column_stack([points, np.zeros(len(points))]))[:, :2]

    return shapely.make_valid(shapely.transform(found.region, moved))
