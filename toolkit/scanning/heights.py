"""Height maps, as images and arrays hold them, and the meshes that they are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import imageio.v3
import numpy as np

from toolkit.geometry.triangles import grid_triangles
from toolkit.scanning.samples import Scan

_MOST_HEIGHTS = 1_000_000


@dataclass(frozen=True)
class Heights:
    """A height map.

    Attributes:
        values: Heights (rows, columns) float; the first row is the one with the largest y. NaN where there is none.
        cell: Metres between columns and between rows; None where the file does not say.
        needs_scale: Whether the values are grey levels rather than lengths.
    """

    values: np.ndarray
    cell: tuple[float, float] | None = None
    needs_scale: bool = False

    def mesh(self, scale: float, cell: float | None) -> Scan:
        """The map as a mesh of two triangles for each square of four heights.

        The lower left height is at x = y = 0.

        Args:
            scale: Metres per unit of height.
            cell: Metres between heights, in place of what the file says.

        Raises:
            ValueError: The map has less than two rows or columns, or too many.
        """
        values = np.flipud(self.values)
        rows, columns = values.shape
        if min(rows, columns) < 2 or values.size > _MOST_HEIGHTS:
            raise ValueError(f"{rows} x {columns} heights; at least 2 x 2 and at most {_MOST_HEIGHTS} are read")
        dx, dy = (cell, cell) if cell is not None else self.cell or (1.0, 1.0)
        x, y = np.meshgrid(dx * np.arange(columns), dy * np.arange(rows))
        vertices = np.column_stack([x.ravel(), y.ravel(), scale * values.ravel()])
        return Scan(vertices, grid_triangles(rows, columns))


def npy_heights(path: Path) -> Heights:
    """The heights in a file of NumPy."""
    values = np.load(path, allow_pickle=False)
    if values.ndim != 2 or values.dtype.kind not in "fiu":
        raise ValueError(f"an array of {values.ndim} dimensions and type {values.dtype}; two and numbers are wanted")
    return Heights(values.astype(float))


def png_heights(path: Path) -> Heights:
    """The grey levels of an image."""
    values = np.asarray(imageio.v3.imread(path.read_bytes(), extension=".png"))
    if values.ndim == 3 and (values[..., :1] == values[..., : min(3, values.shape[2])]).all():
        values = values[..., 0]
    if values.ndim != 2:
        raise ValueError("it has colours; a height map is grey")
    return Heights(values.astype(float), needs_scale=True)


def geotiff_heights(path: Path) -> Heights:
    """The first band of a GeoTIFF; cells are in metres where its coordinates are."""
    import rasterio  # pyright: ignore[reportMissingImports]

    with rasterio.open(path) as file:
        if file.width * file.height > _MOST_HEIGHTS:
            raise ValueError(f"{file.height} x {file.width} heights; at most {_MOST_HEIGHTS} are read")
        values = file.read(1, masked=True).astype(float).filled(np.nan)
        placed = not file.transform.is_identity and not (file.crs is not None and file.crs.is_geographic)
        cell = (abs(float(file.transform.a)), abs(float(file.transform.e))) if placed else None
    return Heights(values, cell)
