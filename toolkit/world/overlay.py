"""Unions and differences of polygons that are held against their arguments.

The overlay of polygons whose sides coincide but for rounding may lose whole parts without an error. A result that does
not hold is computed again with all corners on a fine grid, which is slower and exact on that grid.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

_GRID = 1e-9  # m
_HOLE = 1e-9  # m^2; smaller holes are rounding
_COLLECTION = 7  # shapely's number of this type
_AREA = 1e-7  # m^2; areas that differ by less are equal
_PAIRS = 1_000_000  # of points and shapes that are looked at together


def united(shapes: Any) -> BaseGeometry:
    """Union of one polygon or more."""
    return unions(np.asarray(shapes), np.zeros(len(shapes), int))[0]


def unions(shapes: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Unions of groups of polygons: of all (n,) shapes with equal numbers in `group` (n,), which do not decrease."""
    begins = np.flatnonzero(np.diff(group, prepend=group[0] - 1))
    groups = np.split(shapes, begins[1:])
    found = np.array([shapely.union_all(members) for members in groups], object)
    counts = np.diff(begins, append=len(group))
    for index in np.flatnonzero(~_are_unions(found, shapes, np.repeat(np.arange(len(begins)), counts))).tolist():
        found[index] = _cleared(shapely.union_all(groups[index], grid_size=_GRID))
    return found


def cut(shapes: np.ndarray, cutters: np.ndarray) -> np.ndarray:
    """What is left of each of n polygons without the polygon at its place in `cutters`, (n,) polygons of any parts."""
    left = shapely.difference(shapes, cutters)
    for index in np.flatnonzero(shapely.get_type_id(left) == _COLLECTION).tolist():
        left[index] = _cleared(left[index])
    for index in np.flatnonzero(~_are_differences(left, shapes, cutters)).tolist():
        left[index] = _cleared(shapely.difference(shapes[index], cutters[index], grid_size=_GRID))
    return left


def overlap(shapes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Whether each of n polygons has an area in common with the polygon at its place in `others`, (n,) bool.

    True also for some that merely touch.
    """
    result = np.asarray(shapely.area(shapely.intersection(shapes, others)) > _AREA)
    doubtful = np.flatnonzero(~result)
    shapes, others = shapes[doubtful], others[doubtful]
    points, owner = _inner_points(others)
    common = np.logical_and(*(shapely.contains_xy(group[owner], *points.T) for group in (shapes, others)))
    result[doubtful[owner[common]]] = True
    _, first, shape = np.unique([id(shape) for shape in shapes], return_index=True, return_inverse=True)
    for index in range(len(first)):  # the same shape may stand beside many
        with_it = np.flatnonzero(shape == index)
        points, _ = _inner_points(shapes[first[index : index + 1]])
        points = points[shapely.contains_xy(shapes[first[index]], *points.T)]
        point, other = shapely.STRtree(others[with_it]).query(shapely.points(points))
        common = shapely.contains_xy(others[with_it[other]], *points[point].T)
        result[doubtful[with_it[other[common]]]] = True
    return result


def _are_unions(found: np.ndarray, shapes: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Whether unions (n,) have the inner points of the shapes that they are of, (k,) with owners, and no others."""
    good = np.abs(shapely.area(found) - np.bincount(owner, shapely.area(shapes))) < _AREA  # all of them, side by side
    if good.all():
        return good
    open_ = np.flatnonzero(~good)
    shapely.prepare(found[open_])
    points, of = _inner_points(shapes[held := ~good[owner]])
    of = owner[held][of]
    good[open_] = True
    good[of[~shapely.dwithin(found[of], shapely.points(points), _GRID)]] = False
    points, of = _inner_points(found[open_])
    of = open_[of]
    inside = shapely.contains_xy(found[of], *points.T)
    points, of = np.asarray(shapely.points(points[inside])), of[inside]
    counts = np.bincount(owner, minlength=len(found))
    begins, pairs = np.cumsum(counts) - counts, np.cumsum(counts[of])
    for some in np.split(np.arange(len(of)), np.flatnonzero(np.diff(pairs // _PAIRS)) + 1):
        many = counts[of[some]]
        point = np.repeat(some, many)
        shape = np.arange(many.sum()) + np.repeat(begins[of[some]] - (np.cumsum(many) - many), many)
        covered = np.zeros(len(of), bool)
        covered[point[shapely.dwithin(shapes[shape], points[point], _GRID)]] = True
        good[of[some[~covered[some]]]] = False
    return good


def _are_differences(left: np.ndarray, shapes: np.ndarray, cutters: np.ndarray) -> np.ndarray:
    """Whether differences (n,) have the inner points of the shapes that are outside the cutters, and no others."""
    good = np.ones(len(left), bool)
    for group in (left, shapes, cutters):
        shapely.prepare(group)
    for points, owner in (_inner_points(group) for group in (left, shapes, cutters)):
        inside, wanted, unwanted = (shapely.contains_xy(group[owner], *points.T) for group in (left, shapes, cutters))
        wrong = np.flatnonzero(inside != (wanted & ~unwanted))
        places, owner = shapely.points(points[wrong]), owner[wrong]
        edges = (shapely.dwithin(shapely.boundary(group[owner]), places, _GRID) for group in (shapes, cutters))
        good[owner[~np.logical_or(*edges)]] = False
    return good


def _inner_points(shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 2) inside the rings of shapes: one deep inside each, at most one towards each corner; their owners."""
    parts, owner = shapely.get_parts(shapes, return_index=True)
    rings, part = shapely.get_rings(parts, return_index=True)
    rings, owner = np.asarray(shapely.polygons(rings)), owner[part]
    deep = shapely.get_coordinates(shapely.point_on_surface(rings))
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    points = (corners + deep[ring]) / 2
    inside = shapely.contains_xy(rings[ring], *points.T)
    return np.concatenate([deep, points[inside]]), np.concatenate([owner, owner[ring[inside]]])


def _cleared(shape: Any) -> Polygon | MultiPolygon:
    """A shape without the lines, points and tiny holes that rounding makes of what is thinner."""
    parts = [part for part in shapely.get_parts(shapely.get_parts(shape)) if isinstance(part, Polygon)]
    parts = [Polygon(part.exterior, [hole for hole in part.interiors if Polygon(hole).area > _HOLE]) for part in parts]
    return parts[0] if len(parts) == 1 else MultiPolygon(parts)
