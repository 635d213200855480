"""Read scans: meshes, point clouds and height maps."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from toolkit.errors import InputError
from toolkit.mjcf import LARGEST
from toolkit.scanning.heights import Heights, geotiff_heights, npy_heights, png_heights
from toolkit.scanning.samples import Scan

MESHES = ("obj", "stl", "ply", "glb", "gltf", "off")
_UP_IS_Y = ("glb", "gltf")  # what their standard says
_LARGEST_FILE = 2**30  # bytes
_MOST = 5_000_000  # triangles, or points of a cloud
_SMALLEST = 0.1  # m; a scene that is narrower has other units


@dataclass(frozen=True)
class ReadOptions:
    """How the numbers of a file become metres with z up.

    Attributes:
        scale: Metres per unit; of height maps, per unit of height. None for 1, and for what the file says.
        up: "y" or "z"; None for what the kind of file says.
        cell: Metres between the heights of a map; None for what the file says.
        origin: Point (3,) in m that becomes the origin.
    """

    scale: float | None = None
    up: str | None = None
    cell: float | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)


def read_scan(path: Path, options: ReadOptions) -> Scan:
    """Read a mesh, a point cloud or a height map; the ending of its name says which it is.

    Raises:
        InputError: It cannot be read, or holds nothing that can be used.
    """
    kind = path.suffix.lower().lstrip(".")
    if kind not in _KINDS:
        raise InputError(f"{path}: files that end in .{kind} are not known; known are {', '.join(_KINDS)}")
    try:
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if not path.is_file() or not 0 < size <= _LARGEST_FILE:
        raise InputError(f"{path}: is no file, is empty or is larger than {_LARGEST_FILE // 2**20} MiB")
    scan = _quietly(path, _KINDS[kind], options)
    return _checked(path, _upright(scan, kind, options))


_EXTRA = ("pypcd4", "rasterio")
"""Packages of the extra `scan`."""


def _quietly(path: Path, read: Callable[[Path, ReadOptions], Scan], options: ReadOptions) -> Scan:
    """Read a file; whatever goes wrong in the library that reads it becomes one line."""
    log = logging.getLogger("trimesh")
    before, log.disabled = log.disabled, True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read(path, options)
    except InputError:
        raise
    except ModuleNotFoundError as error:
        package = (error.name or "").split(".")[0]
        if package not in _EXTRA:  # one that only broken files need, to guess how their text is encoded
            raise InputError(f"{path}: is damaged, or not what its ending says (it is no plain text)") from error
        raise InputError(
            f"{path}: needs the package {package}; pip install 'humanoid-contact-toolkit[scan]'"
        ) from error
    except Exception as error:  # each library has its own
        what = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{path}: is damaged, or not what its ending says ({what})") from error
    finally:
        log.disabled = before


def _mesh(path: Path, options: ReadOptions) -> Scan:
    """All meshes of a file in one; where there are none, its points."""
    del options
    with path.open("rb") as stream:
        scene = trimesh.load_scene(stream, file_type=path.suffix.lower().lstrip("."), process=False)
    parts = scene.dump()
    meshes = [part for part in parts if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    if not meshes:
        clouds = [np.asarray(part.vertices, float) for part in parts if isinstance(part, trimesh.PointCloud)]
        return Scan(np.concatenate([*clouds, np.zeros((0, 3))]), np.zeros((0, 3), int))
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    triangles = [np.asarray(mesh.faces) + begin for mesh, begin in zip(meshes, first[:-1], strict=True)]
    vertices = np.concatenate([np.asarray(mesh.vertices, float) for mesh in meshes])
    corners = np.concatenate(triangles)
    if len(corners) and not (0 <= corners.min() and corners.max() < len(vertices)):
        raise ValueError("a triangle has a corner that does not exist")
    return Scan(vertices, corners)


def _pcd(path: Path, options: ReadOptions) -> Scan:
    """The points of a PCD file."""
    del options
    from pypcd4.pypcd4 import PointCloud  # pyright: ignore[reportMissingImports]

    return Scan(PointCloud.from_path(path).numpy(("x", "y", "z")).astype(float), np.zeros((0, 3), int))


def _map(read: Callable[[Path], Heights]) -> Callable[[Path, ReadOptions], Scan]:
    """A reader of height maps as meshes."""

    def scan(path: Path, options: ReadOptions) -> Scan:
        heights = read(path)
        if options.scale is None and heights.needs_scale:
            raise InputError(f"{path}: its heights have no unit; give --scale, metres per grey level")
        if options.cell is None and heights.cell is None:
            raise InputError(f"{path}: does not say how far apart its heights are; give --cell in metres")
        return heights.mesh(options.scale or 1.0, options.cell)

    return scan


_KINDS: dict[str, Callable[[Path, ReadOptions], Scan]] = {
    **dict.fromkeys(MESHES, _mesh),
    "pcd": _pcd,
    "png": _map(png_heights),
    "npy": _map(npy_heights),
    **dict.fromkeys(("tif", "tiff"), _map(geotiff_heights)),
}
_MAPS = ("png", "npy", "tif", "tiff")


def _upright(scan: Scan, kind: str, options: ReadOptions) -> Scan:
    """The scan in metres, with z up, about its new origin; what is not finite is left out."""
    vertices = scan.vertices
    if kind not in _MAPS:
        vertices = vertices * (options.scale or 1.0)
        if (options.up or ("y" if kind in _UP_IS_Y else "z")) == "y":
            vertices = vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    vertices = vertices - np.asarray(options.origin)
    good = np.logical_and.reduce(np.isfinite(vertices), axis=1)
    if len(scan.triangles) == 0:
        return Scan(vertices[good], scan.triangles)
    triangles = scan.triangles[good[scan.triangles].all(axis=1)]
    used, index = np.unique(triangles, return_inverse=True)
    return Scan(vertices[used], index.reshape(-1, 3))


def _checked(path: Path, scan: Scan) -> Scan:
    """The scan, if a robot could walk in it.

    Raises:
        InputError: It has too little or too much in it, or other units.
    """
    if len(scan.vertices) < 3:
        raise InputError(f"{path}: holds no triangles and no points that can be used")
    if max(len(scan.triangles), len(scan.vertices)) > _MOST:
        raise InputError(f"{path}: holds more than {_MOST} triangles or points; make it coarser, or cut a part out")
    low, high = scan.bounds
    if np.abs(scan.bounds).max() > LARGEST:
        raise InputError(
            f"{path}: reaches from {_text(low)} to {_text(high)} m, more than {LARGEST:g} m from the origin; give "
            f"--scale, or --origin {low[0]:.0f},{low[1]:.0f},{low[2]:.0f}"
        )
    if (high - low).max() < _SMALLEST:
        raise InputError(f"{path}: is only {(high - low).max():.3g} m wide; give --scale, metres per unit")
    return scan


def _text(point: np.ndarray) -> str:
    """A point as a user gives one."""
    return ",".join(f"{value:.6g}" for value in point)
