"""Mesh files that MuJoCo cannot read, turned into those that it can: COLLADA, STL in plain text, OBJ in parts."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import cast

import numpy as np

from toolkit.mjcf import one_line

READABLE = frozenset({".stl", ".obj", ".msh", ".dae"})
"""Endings of the mesh files that can be read."""
_STL_HEADER, _STL_FACE = 84, 50  # bytes of a binary STL
_SAID = 80  # most letters of what the loader says


def converted(file: Path, *, upright: bool = False) -> bytes | None:
    """A mesh file as binary STL, in the file's own axes and before any scale of the model; None where MuJoCo reads it.

    Of an OBJ file of several objects or groups MuJoCo takes the faces of one; here all count. A COLLADA file becomes
    the convex hull of all its parts, which is what MuJoCo collides with. Its unit counts, its `up_axis` does not, as
    everywhere in ROS, but where `upright`: then y, if it is said to point up, becomes z.

    Raises:
        ValueError: The file holds no solid that can be read.
    """
    ending = file.suffix.lower()
    if not (ending == ".dae" or (ending == ".stl" and _is_text(file)) or (ending == ".obj" and _in_parts(file))):
        return None
    import trimesh  # here, as few robots need it

    if ending == ".dae":
        import coal
        from scipy.spatial import ConvexHull, QhullError

        try:
            points = np.asarray(coal.MeshLoader().load(str(file), np.ones(3)).vertices(), float)
            points = _unit(file) * points[ConvexHull(points).vertices]  # which raises where they lie in a plane
            if upright and lies_down(file):
                points = points[:, [0, 2, 1]] * (1.0, -1.0, 1.0)
            mesh = trimesh.convex.convex_hull(points)
        except (QhullError, ElementTree.ParseError, ValueError, RuntimeError) as error:
            raise ValueError(f"holds no solid ({one_line(error)[:_SAID]})") from None
    else:
        kind = "stl_ascii" if ending == ".stl" else "obj"
        mesh = trimesh.load_mesh(file, file_type=kind, skip_materials=True)
    return cast(bytes, mesh.export(file_type="stl"))


def _unit(file: Path) -> float:
    """Metres of a unit of a COLLADA file, which the loader leaves out."""
    unit = _said(file, "unit")
    return 1.0 if unit is None else float(unit.get("meter", "1"))


def lies_down(file: Path) -> bool:
    """Whether a COLLADA file says that its y axis points up."""
    up = _said(file, "up_axis")
    return up is not None and (up.text or "").strip() == "Y_UP"


def _said(file: Path, name: str) -> ElementTree.Element | None:
    """The first element of a name in a COLLADA file."""
    return next((item for item in ElementTree.parse(file).iter() if item.tag.rpartition("}")[2] == name), None)


def _is_text(file: Path) -> bool:
    """Whether an STL file is in plain text: the size of a binary one follows from its number of faces."""
    data = file.read_bytes()
    faces = int.from_bytes(data[_STL_HEADER - 4 : _STL_HEADER], "little")
    return data.lstrip().startswith(b"solid") and len(data) != _STL_HEADER + _STL_FACE * faces


def _in_parts(file: Path) -> bool:
    """Whether an OBJ file holds more than one object or group."""
    return sum(line.startswith((b"o ", b"g ")) for line in file.read_bytes().splitlines()) > 1
