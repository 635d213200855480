"""From scans to the text of a world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon

from toolkit.errors import InputError
from toolkit.scanning.exact import Exact, take_exact
from toolkit.scanning.patches import Patch, Reading, read_samples
from toolkit.scanning.rough import Blob, blobs
from toolkit.scanning.samples import Samples, Scan, samples_of
from toolkit.world.authoring import THICKNESS, WorldText
from toolkit.world.convex import convex_partition, simplified

_SPACING = 0.02  # m; distance of samples, as far as the scene is small enough
_OPPOSITE = -0.9  # cosine of the angle between the normals of the two sides of a wall
_LOWER = 2e-3  # m; what is there but cannot be touched ends so far below the surface: it covers, and is no part of it
_LEAST = 3e-3  # m^2; smaller patches cannot be touched
_GAP = 1e-3  # m; between the backs of the two sides of a wall


@dataclass(frozen=True)
class Scene:
    """What was made of scans.

    Attributes:
        scans: The input, m.
        exact: What was taken as it is, one for each scan.
        reading: What was found in all the rest.
        patches: All planar patches, those of open exact meshes first.
        blobs: Obstacles for the rough rest.
        area: Area of the input, m^2; noise makes that of a mesh larger than it is.
    """

    scans: list[Scan]
    exact: list[Exact]
    reading: Reading
    patches: list[Patch]
    blobs: list[Blob]
    area: float

    @property
    def explained(self) -> float:
        """Share of the input's area that lies on flat patches or in solids."""
        taken = sum(part.area for part in self.exact)
        return (taken + self.reading.explained * (self.area - taken)) / self.area


def read_scene(scans: Sequence[Scan], progress: Callable[[float], None] = lambda share: None) -> Scene:
    """Find out what scans of one place show.

    Args:
        scans: The scans, in one frame.
        progress: Called with the share that is done, in [0, 1].

    Raises:
        InputError: There is nothing in them.
    """
    exact = [take_exact(scan) for scan in scans]
    progress(0.2)
    samples = [samples_of(part.rest, _SPACING) for part in exact if len(part.rest.vertices)]
    rough = Samples.joined(samples, _SPACING)
    area = float(sum(part.area for part in exact) + rough.area.sum())
    if area <= 0.0:
        raise InputError("nothing in the scan has an area; give a mesh, or more than a few points")
    progress(0.4)
    reading = read_samples(rough)
    progress(0.9)
    patches = [patch for part in exact for patch in part.patches] + reading.patches
    patches = [patch for patch in patches if patch.polygon.area > _LEAST]
    return Scene(list(scans), exact, reading, patches, blobs(reading.rest, reading.spacing, reading.noise), area)


def world_text(scene: Scene, comment: str, friction: float, timing: tuple[float, float] | None) -> WorldText:
    """The world of a scene; its start and goal are still to be set.

    Every patch becomes convex plates as thick as the tiles of generated worlds, so thin that their edges are no
    surfaces, with its body under it; closed exact meshes stay meshes.
    """
    low = min(float(scan.bounds[0, 2]) for scan in scene.scans)
    world = WorldText("scan", comment, friction, timing, goal=(0.0, 0.0, 0.0), abyss=low - 2 * THICKNESS)
    solids = [solid for part in scene.exact for solid in part.solids]
    for number, solid in enumerate(solids):
        world.mesh(f"solid_{number}", solid.vertices, solid.faces, material="platform")
    for number, patch in enumerate(scene.patches):
        depth = _depth(patch, scene.patches)
        for name, outline, top in (("patch", patch.polygon, 0.0), ("under", patch.body, -_LOWER)):
            _add_plates(world, f"{name}_{number}", patch, outline, top, min(-depth, top - _GAP))
    for number, blob in enumerate(scene.blobs):
        world.ellipsoid(f"rough_{number}", blob.diameters, blob.centre, rotation=blob.rotation)
    return world


def _add_plates(world: WorldText, name: str, patch: Patch, outline: Polygon, top: float, bottom: float) -> None:
    """Add convex plates that together have an outline in a patch's frame, between two heights over it in m."""
    material = "platform" if abs(patch.frame.normal[2]) > 0.7 else "panel"
    rings = [] if outline.is_empty else [ring for ring in convex_partition(outline) if Polygon(ring).area > 1e-6]
    for piece, ring in enumerate(rings):
        corners = simplified(ring)
        plate = np.concatenate([np.column_stack([corners, np.full(len(corners), z)]) for z in (top, bottom)])
        world.mesh(name if piece == 0 else f"{name}_{piece}", patch.frame @ plate, material=material)


def _depth(patch: Patch, patches: list[Patch]) -> float:
    """Thickness of a patch's plate, m: less where the other side of a thin wall is behind it."""
    depth = THICKNESS
    normal, centre = patch.frame.normal, patch.frame.position
    for other in patches:
        if other.frame.normal @ normal > _OPPOSITE:
            continue
        between = (centre - other.frame.position) @ normal
        if 2 * _GAP < between < 2 * THICKNESS + _GAP:
            local = patch.frame.inverse() @ other.frame
            ring = np.asarray(other.polygon.exterior.coords)
            seen = (local @ np.column_stack([ring, np.zeros(len(ring))]))[:, :2]
            if patch.polygon.intersects(shapely.make_valid(Polygon(seen))):
                depth = min(depth, float(between - _GAP) / 2)
    return depth
