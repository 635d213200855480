"""What was made of a scan, in figures and as a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
from rich import box
from rich.table import Table

from toolkit.report.surfaces import write_surface_recording
from toolkit.scanning.samples import Scan
from toolkit.scanning.world import ScannedWorld

_INPUT = (200, 80, 160)
_ALPHA = 70  # of 255
_MOST_TRIANGLES = 300_000  # drawn; of a larger scan only points are shown
_MOST_POINTS = 300_000


def scan_table(made: ScannedWorld) -> Table:
    """Figures of a scanned world: its input, what was found in it, and where the robot starts and goes."""
    scene, surfaces = made.scene, made.world.surfaces
    low = np.min([scan.bounds[0] for scan in scene.scans], axis=0)
    high = np.max([scan.bounds[1] for scan in scene.scans], axis=0)
    triangles, points = (sum(len(part) for part in parts) for parts in _sizes(scene.scans))
    feet, palms = ([s for s in surfaces if serves(s)] for serves in (lambda s: s.serves_foot, lambda s: s.serves_palm))
    solids = sum(len(part.solids) for part in scene.exact)
    table = Table(box=box.SIMPLE, pad_edge=False, show_header=False)
    table.add_row("input", f"{triangles} triangles, {points} points without")
    table.add_row("from, to", f"{_place(low)} to {_place(high)} m")
    if len(scene.reading.patches) or len(scene.blobs):
        table.add_row(
            "noise, samples", f"{1e3 * scene.reading.noise:.1f} mm, {1e3 * scene.reading.spacing:.0f} mm apart"
        )
    table.add_row("made of it", f"{len(scene.patches)} flat patches, {solids} solids, {len(scene.blobs)} obstacles")
    table.add_row("explained", f"{scene.explained:.1%} of the input's area lies on patches or solids")
    for name, group in (("for feet", feet), ("for palms", palms)):
        table.add_row(f"surfaces {name}", f"{len(group)}, {sum(s.region.area for s in group):.2f} m²")
    turn = np.degrees(made.places.heading)
    table.add_row("start, goal", f"{_place(made.places.start)} at {turn:.0f} degrees, {_place(made.places.goal)} m")
    return table


def write_scan_recording(path: Path, made: ScannedWorld) -> None:
    """Write a recording of a scanned world and its surfaces with the input over them.

    Args:
        path: file to write; it appears whole or not at all.
        made: the world and its input.

    Raises:
        InputError: it cannot be written.
    """

    def draw(stream: rr.RecordingStream) -> None:
        for number, scan in enumerate(made.scene.scans):
            name = f"world/input/{number}"
            if 0 < len(scan.triangles) <= _MOST_TRIANGLES:
                mesh = rr.Mesh3D(
                    vertex_positions=scan.vertices.astype(np.float32),
                    triangle_indices=scan.triangles.astype(np.uint32),
                    albedo_factor=[*_INPUT, _ALPHA],
                )
                stream.log(name, mesh, static=True)
            else:
                points = scan.vertices[:: len(scan.vertices) // _MOST_POINTS + 1]
                stream.log(name, rr.Points3D(points.astype(np.float32), colors=_INPUT, radii=0.003), static=True)

    write_surface_recording(path, made.world, draw)


def _sizes(scans: list[Scan]) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Triangles of the meshes and points of the clouds."""
    return [scan.triangles for scan in scans], [scan.vertices for scan in scans if len(scan.triangles) == 0]


def _place(point: np.ndarray) -> str:
    """A point in cm."""
    return ", ".join(f"{value:.2f}" for value in np.round(point, 2) + 0.0)
